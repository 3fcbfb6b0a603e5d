"""This package contains exact solutions of particular systems, recognised by their equations."""

from __future__ import annotations

from hybridsim.model import Model
from hybridsim.reference.closed_forms.closed_form import ClosedForm
from hybridsim.reference.closed_forms.coulomb_model import coulomb_oscillator

__all__ = ["ClosedForm", "find_closed_form"]

# Each entry takes a model and a span, and returns a closed form if it recognises the model.
_KNOWN = (coulomb_oscillator,)


def find_closed_form(model: Model, t_span: tuple[float, float]) -> ClosedForm | None:
    """Return the closed form of a model from its initial values over the span, or None."""
    for known in _KNOWN:
        found = known(model, t_span)
        if found is not None:
            return found
    return None
