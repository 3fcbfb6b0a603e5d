"""This module collects the units that a model declares, with the unit of its time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Discrete, Parameter, State
from hybridsim.model.units.infer import Inference
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.unit import ONE, Unit

_TIMES = ("s", "ms", "us", "µs", "min", "h", "d")


@dataclass
class Quantities:
    """The known units of the names of a model.

    Parameters
    ----------
    texts : the declared units as they are written, by name, without empty ones.
    labels : all units that the model writes, those of outputs included; messages use them.
    units : the known units by name.
    inferred : the names whose units are not declared but follow from expressions.
    parameters : the names of the parameters.
    """

    texts: dict[str, str]
    labels: tuple[str, ...]
    units: dict[str, Unit]
    parameters: frozenset[str]
    inferred: set[str] = field(default_factory=set)

    @property
    def time(self) -> Unit | None:
        """The unit of t."""
        return self.units.get(TIME)

    def inference(self) -> Inference:
        """Return an empty inference that knows these units."""
        return Inference(self.units, self.parameters)

    def rate(self, name: str) -> Unit | None:
        """Return the unit of the time derivative of a quantity."""
        return self.units[name] / self.time if name in self.units and self.time else None


def declared_quantities(model: Model) -> Quantities | None:
    """Return the units that a model declares, or None if it declares none."""
    texts = declared_texts(model)
    if not texts:
        return None
    units = {name: unit for name, text in texts.items() if (unit := read_unit(text)) is not None}
    implied = dict.fromkeys((surface.name for surface in model.surfaces), ONE)
    time = _time_of([*texts.values()])
    if time is not None:
        implied[TIME] = time
    parameters = frozenset(parameter.name for parameter in model.parameters)
    labels = (*texts.values(), *(output.unit for output in model.outputs if output.unit))
    return Quantities(texts, tuple(dict.fromkeys(labels)), units | implied, parameters, {*implied})


def declared_texts(model: Model) -> dict[str, str]:
    """Return the units that a model declares; those of the states of friction laws follow from their equations."""
    states = (state for state in model.states if not isinstance(state, ContactState))
    parts: tuple[Parameter | State | Discrete | Input, ...]
    parts = (*model.parameters, *states, *model.discrete, *model.inputs)
    return {part.name: part.unit for part in parts if part.unit} | model.connected_units


def _time_of(texts: Iterable[str]) -> Unit | None:
    """Return the unit of t: the unit of time that most declarations contain, or s if they imply it."""
    used: Counter[str] = Counter()
    for text in texts:
        symbols = [symbol for symbol in _TIMES if _contains(text, symbol)]
        used.update(symbols)
        unit = read_unit(text)
        if not symbols and unit is not None and "s" in dict(unit.powers):
            used["s"] += 0  # as in N, if no other unit of time is found
    if not used:
        return None
    return read_unit(max(used, key=lambda symbol: (used[symbol], symbol == "s")))


def _contains(text: str, symbol: str) -> bool:
    return symbol in "".join(c if c.isalpha() else " " for c in text).split()
