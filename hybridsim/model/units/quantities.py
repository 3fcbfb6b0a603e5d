"""This module collects the units that a model declares, and the unit of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.library import is_packaged
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Discrete, Parameter, State
from hybridsim.model.units.infer import Inference
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.seconds import SECOND
from hybridsim.model.units.unit import ONE, Unit, most_frequent

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

    def inference(self, counts: bool = False) -> Inference:
        """Return a new inference of units, which begins with these units."""
        return Inference(self.units, self.parameters, counts)

    def rate(self, name: str) -> Unit | None:
        """Return the unit of the time derivative of a quantity."""
        return self.units[name] / self.time if name in self.units and self.time else None


def declared_quantities(model: Model) -> Quantities | None:
    """Return the units that a model declares and the unit of t, or None if the model declares no unit."""
    texts = declared_texts(model)
    of_laws = [unit for contact in model.contacts for unit in contact.law.units.values()]
    if not texts and not of_laws:
        return None
    units = {name: unit for name, text in texts.items() if (unit := read_unit(text)) is not None}
    implied = dict.fromkeys((surface.name for surface in model.surfaces), ONE)
    labels = (*texts.values(), *of_laws, *(output.unit for output in model.outputs if output.unit))
    parameters = frozenset(parameter.name for parameter in model.parameters)
    known = Quantities(texts, tuple(dict.fromkeys(labels)), units | implied, parameters, {*implied})
    time = _time_of(model, known, of_laws)
    if time is not None:
        known.units[TIME] = time
        known.inferred.add(TIME)
    return known


def declared_texts(model: Model) -> dict[str, str]:
    """Return the units that a model declares; in laws of the package they follow from the equations."""
    states = (state for state in model.states if not isinstance(state, ContactState))
    parts: tuple[Parameter | State | Discrete | Input, ...]
    parts = (*model.parameters, *states, *model.discrete, *model.inputs)
    texts = {part.name: part.unit for part in parts if part.unit} | model.connected_units
    for contact in model.contacts:
        if not is_packaged(contact.law):
            texts |= _texts_of_law(model, contact)
    return texts


def _texts_of_law(model: Model, contact: Contact) -> dict[str, str]:
    """Return the units that a law declares for its states and tables, by their names in the model."""
    law = contact.law
    tables = {contact.variable(t.name): law.units[t.name] for t in law.tables if t.name in law.units}
    own = {contact.variable(state.name): state.unit for state in law.states if state.unit}
    states = (state.name for state in model.states if isinstance(state, ContactState))
    copied = {name: own.get(name, own.get(name.rstrip("0123456789"), "")) for name in states}
    return tables | {name: unit for name, unit in copied.items() if unit}


def _time_of(model: Model, known: Quantities, of_laws: Iterable[str]) -> Unit | None:
    """Return the unit of t that follows from most rates and declarations, or s if several units are as frequent."""
    votes = []
    for state in model.states:
        rate = known.inference().unit(state.der.tree)
        if rate is not None and state.name in known.units:
            votes.append((known.units[state.name] / rate).without_angles())
    for text in (*known.texts.values(), *of_laws):
        votes += [unit for symbol in _TIMES if _contains(text, symbol) and (unit := read_unit(symbol))]
    votes = [unit for unit in votes if unit.dimension == SECOND.dimension]
    if any("s" in dict(unit.powers) for unit in known.units.values()):
        votes.append(SECOND)  # as in N
    votes.sort(key=lambda unit: bool(unit.differs(SECOND)))  # of equally many, s
    return most_frequent(votes) if votes else None


def _contains(text: str, symbol: str) -> bool:
    return symbol in "".join(c if c.isalpha() else " " for c in text).split()
