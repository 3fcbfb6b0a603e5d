"""This module finds unused names for quantities that the program adds to a model."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model


def free_name(taken: Iterable[str], wish: str) -> str:
    """Return the preferred name, with underscores appended until it differs from all taken names."""
    names = frozenset(taken)
    while wish in names:
        wish += "_"
    return wish


def names_of_model(model: Model) -> frozenset[str]:
    """Return all names of a model, including those that its contacts create."""
    parts = (
        model.parameters, model.states, model.discrete, model.inputs, model.contacts, model.surfaces, model.impacts,
        model.monitors, model.schedules, model.outputs, model.all_components(),
    )  # fmt: skip
    declared = {part.name for kind in parts for part in kind}
    return frozenset(declared | set(model.variables()) | {name for name, _ in model.definitions})
