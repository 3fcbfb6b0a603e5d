"""This module writes a model as complete TOML text, which reads back to an equal model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hybridsim.expr import Expression
from hybridsim.expr.grammar import MAX_INTEGER
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.laws.law_table import LawTable
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.component import Component, Guard
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.inputs import HeldInput, Input
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import State
from hybridsim.model.parts.schedule import Schedule
from hybridsim.model.parts.shape import Shape

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model


def write_model(model: Model) -> str:
    """Return the TOML text of a model, including its laws and tables."""
    import tomli_w

    return tomli_w.dumps({"schema": 1, **_plain(_document(model))}, indent=1)


def _document(model: Model) -> dict[str, Any]:
    laws: dict[str, FrictionLaw] = {}
    for contact in model.contacts:
        laws.setdefault(contact.law.name, contact.law)
    return {
        **{
            field: getattr(model, field)
            for field in ("name", "title", "source", "description", "look", "duration")
        },
        "parameters": _short(
            "value", {p.name: _fields(p, "value", "unit", "title") for p in model.parameters}
        ),
        "states": {s.name: _state(s) for s in model.states if not isinstance(s, ContactState)},
        "discrete": _short(
            "start",
            {
                d.name: _fields(d, "start", "unit", "title")
                for d in model.discrete
                if not isinstance(d, HeldInput)
            },
        ),
        "definitions": dict(model.definitions),
        "inputs": {signal.name: _input(signal) for signal in model.inputs}
        | {d.name: _held(d) for d in model.discrete if isinstance(d, HeldInput)},
        "laws": {name: _law(law) for name, law in laws.items()},
        "contacts": {contact.name: _contact(contact, laws) for contact in model.contacts},
        "surfaces": {surface.name: _fields(surface, "expr", "above", "below") for surface in model.surfaces},
        "impacts": {impact.name: _fields(impact, "gap", "restitution") for impact in model.impacts},
        "components": {component.name: _component(component) for component in model.components},
        "monitors": {monitor.name: _monitor(monitor) for monitor in model.monitors},
        "schedules": {schedule.name: _schedule(schedule) for schedule in model.schedules},
        "outputs": _short(
            "expr", {o.name: _fields(o, "expr", "unit", "modes", "title") for o in model.outputs}
        ),
        "drawing": {shape.name: _shape(shape) for shape in model.drawing},
    }


def _fields(part: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(part, name) for name in names}


def _is_set(value: Any) -> bool:
    return value is not None and value is not False and value not in ("", (), {}, [])


def _short(key: str, entries: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return plain values if no entry has further fields, otherwise the entries with all fields."""
    if all(not _is_set(value) for entry in entries.values() for name, value in entry.items() if name != key):
        return {name: entry[key] for name, entry in entries.items()}
    return entries


def _input(signal: Input) -> dict[str, Any]:
    fields = ("kind", "times", "values", "interpolation", "shape", "unit", "time_unit")
    return {**_fields(signal, *fields), **signal.expressions}


def _held(held: HeldInput) -> dict[str, Any]:
    return {"kind": "held", "value": held.start, "unit": held.unit}


def _shape(shape: Shape) -> dict[str, Any]:
    size = {"size": shape.size[0]} if len(shape.size) == 1 else {}
    return {**_fields(shape, "kind", *shape.fields()), **size}


def _state(state: State) -> dict[str, Any]:
    return _fields(state, "start", "unit", "nominal", "title", "der")


def _law(law: FrictionLaw) -> dict[str, Any]:
    fields = (
        "title", "source", "slip", "slip_backward", "stick", "stick_backward", "force", "definitions", "copies",
        "initial",
    )  # fmt: skip
    return {
        "parameters": _parameters(law),
        **_fields(law, *fields),
        "states": {state.name: _state(state) for state in law.states},
        "tables": {table.name: {**_table(table), "unit": law.units.get(table.name)} for table in law.tables},
        "modes": {mode.name: _mode(mode) for mode in law.modes},
    }


def _parameters(law: FrictionLaw) -> Any:
    """Return the parameters of a law. They are a list of names if one of them has neither a default nor a unit."""
    declared = {name: {"value": value, "unit": law.units.get(name)} for name, value in law.parameters.items()}
    entries = _short("value", declared)
    bare = {name for name, entry in declared.items() if not any(map(_is_set, entry.values()))}
    return [name if name in bare else {name: entries[name]} for name in declared] if bare else entries


def _table(table: LawTable) -> dict[str, Any]:
    way = {} if table.interpolation == "cubic" else _fields(table, "interpolation")
    return {**_fields(table, "at", "values", "over", "across", "across_at"), **way}


def _contact(contact: Contact, laws: Mapping[str, FrictionLaw]) -> dict[str, Any]:
    law: dict[str, Any] = {"name": contact.law.name}
    if laws[contact.law.name] != contact.law:  # another law with the same name is written into its contact
        law |= _law(contact.law)
    return {
        **_fields(contact, "velocity", "normal", "opens", "start", "nominal"),
        "law": {**law, **contact.arguments},
    }


def _component(component: Component) -> dict[str, Any]:
    surface, limit = component.surface, component.limit
    fields = (
        "function", "unknown", "above", "below", "hold", "jump_above", "jump_below", "unique", "restitution",
    )  # fmt: skip
    return {
        "initial": component.initial,
        "limit": limit and _fields(limit, "to", "reset"),
        "surface": surface and _fields(surface, *fields),
        "modes": {mode.name: _mode(mode) for mode in component.modes},
    }


def _mode(mode: Any) -> dict[str, Any]:
    return {"set": mode.set, "der": mode.der, "guards": {guard.name: _guard(guard) for guard in mode.guards}}


def _guard(guard: Guard) -> dict[str, Any]:
    then = [_fields(choice, "when", "to", "reset") for choice in guard.then]
    return {"expr": guard.expr, "then": then, "fatal": guard.fatal}


def _monitor(monitor: Monitor) -> dict[str, Any]:
    return _fields(monitor, "expr", "direction", "action", "reset")


def _schedule(schedule: Schedule) -> dict[str, Any]:
    return _fields(schedule, "times", "start", "period", "count", "reset", "terminate")


def _plain(value: Any) -> Any:
    """Return a value for TOML: expressions become numbers or strings, unset entries are omitted."""
    if isinstance(value, Expression):
        number = _number(value.text)
        return value.text if number is None else number
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items() if _is_set(item)}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _number(text: str) -> float | None:
    """Return a text as a number if TOML reads this number back to the same text, otherwise None."""
    for kind in (int, float):
        try:
            value = kind(text)
        except ValueError:
            continue
        return value if repr(value) == text and (kind is float or abs(value) <= MAX_INTEGER) else None
    return None
