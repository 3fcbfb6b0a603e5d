"""Names for what the program adds to a model: none of them meets a name that the model has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hybridsim.model.model import Model


def free_name(taken: Iterable[str], wish: str) -> str:
    """The wish, or the wish with as many underscores after it as make it differ from all that are taken."""
    names = frozenset(taken)
    while wish in names:
        wish += "_"
    return wish


def names_of_model(model: Model) -> frozenset[str]:
    """Every name that a model declares, or that its contacts make: of quantities, components, events, outputs."""
    parts = (
        model.parameters, model.states, model.discrete, model.inputs, model.contacts, model.surfaces, model.impacts,
        model.monitors, model.schedules, model.outputs, model.all_components(),
    )  # fmt: skip
    declared = {part.name for kind in parts for part in kind}
    return frozenset(declared | set(model.variables()) | {name for name, _ in model.definitions})
