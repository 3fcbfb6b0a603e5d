"""Exact solutions of particular systems, each recognised by its structure, as references for comparisons."""

from __future__ import annotations

from hybridsim.analysis.closed_forms.closed_form import ClosedForm
from hybridsim.analysis.closed_forms.coulomb_model import coulomb_oscillator
from hybridsim.model import Model

__all__ = ["ClosedForm", "find_closed_form"]

# Each takes a model and a span, and returns a closed form where the model is its system.
_KNOWN = (coulomb_oscillator,)


def find_closed_form(model: Model, t_span: tuple[float, float]) -> ClosedForm | None:
    """The closed form of a model from its initial values over the span, None where none is known."""
    for known in _KNOWN:
        found = known(model, t_span)
        if found is not None:
            return found
    return None
