"""Write a model as complete TOML text, which reads back to an equal model."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from hybridsim.expr import Expression
from hybridsim.expr.grammar import MAX_INTEGER
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.component import Component, Guard
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import Output
from hybridsim.model.parts.schedule import Schedule

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_model(model: Model) -> str:
    """Return the TOML text of a model, including its laws and tables."""
    return "\n".join(_lines(model)) + "\n"


def _lines(model: Model) -> Iterator[str]:
    yield "schema = 1"
    yield f"name = {_value(model.name)}"
    for field in ("title", "source", "description", "look"):
        if text := getattr(model, field):
            yield f"{field} = {_value(text)}"
    if model.duration is not None:
        yield f"duration = {_value(model.duration)}"
    yield from _section(
        "parameters", {p.name: _short("value", p.value, unit=p.unit, title=p.title) for p in model.parameters}
    )
    yield from _section(
        "states",
        {
            s.name: {"start": s.start, "unit": s.unit, "nominal": s.nominal, "der": s.der}
            for s in model.states
            if not isinstance(s, ContactState)
        },
    )
    yield from _section("discrete", {d.name: _short("start", d.start, unit=d.unit) for d in model.discrete})
    yield from _section("definitions", dict(model.definitions))
    for signal in model.inputs:
        yield from _section(f"inputs.{_key(signal.name)}", _input(signal))
    laws: dict[str, FrictionLaw] = {}
    for contact in model.contacts:
        laws.setdefault(contact.law.name, contact.law)
    for law in laws.values():
        yield from _section(f"laws.{_key(law.name)}", _law(law))
    for contact in model.contacts:
        yield from _section(f"contacts.{_key(contact.name)}", _contact(contact, laws))
    for surface in model.surfaces:
        sides = {"above": surface.above, "below": surface.below}
        yield from _section(f"surfaces.{_key(surface.name)}", {"expr": surface.expr, **sides})
    for impact in model.impacts:
        entries = {"gap": impact.gap, "restitution": impact.restitution}
        yield from _section(f"impacts.{_key(impact.name)}", entries)
    for component in model.components:
        yield from _component(component)
    for monitor in model.monitors:
        yield from _section(f"monitors.{_key(monitor.name)}", _monitor(monitor))
    for schedule in model.schedules:
        yield from _section(f"schedules.{_key(schedule.name)}", _schedule(schedule))
    yield from _section("outputs", {output.name: _output(output) for output in model.outputs})


def _section(path: str, entries: Mapping[str, Any]) -> Iterator[str]:
    written = [f"{_key(name)} = {_value(value)}" for name, value in entries.items() if _given(value)]
    if written:
        yield f"\n[{path}]"
        yield from written


def _given(value: Any) -> bool:
    return value is not None and value is not False and value not in ("", (), {}, [])


def _short(key: str, value: Expression, **more: Any) -> Any:
    """Return a plain value if there are no further fields, otherwise a table."""
    rest = {name: text for name, text in more.items() if _given(text)}
    return {key: value, **rest} if rest else value


def _input(signal: Input) -> dict[str, Any]:
    fields = ("kind", "times", "values", "interpolation", "shape")
    return {**{name: getattr(signal, name) for name in fields}, **signal.expressions}


def _law(law: FrictionLaw) -> dict[str, Any]:
    # TOML has no null, so parameters without a default need the list form
    parameters: Any = law.parameters
    if None in law.parameters.values():
        parameters = [name if value is None else {name: value} for name, value in law.parameters.items()]
    fields = (
        "title", "source", "slip", "slip_backward", "stick", "stick_backward", "force", "definitions", "copies",
        "initial",
    )  # fmt: skip
    states = {
        s.name: {"start": s.start, "unit": s.unit, "nominal": s.nominal, "der": s.der} for s in law.states
    }
    tables = {t.name: {"at": t.at, "values": t.values, "over": t.over} for t in law.tables}
    modes = {
        mode.name: {"set": mode.set, "der": mode.der, "guards": {g.name: _guard(g) for g in mode.guards}}
        for mode in law.modes
    }
    return {
        "parameters": parameters,
        **{name: getattr(law, name) for name in fields},
        "states": states,
        "tables": tables,
        "modes": modes,
    }


def _contact(contact: Contact, laws: Mapping[str, FrictionLaw]) -> dict[str, Any]:
    law: dict[str, Any] = {"name": contact.law.name}
    if laws[contact.law.name] != contact.law:  # another law with the same name is written into its contact
        law |= _law(contact.law)
    fields = ("velocity", "normal", "opens", "start", "nominal")
    return {**{name: getattr(contact, name) for name in fields}, "law": {**law, **contact.arguments}}


def _component(component: Component) -> Iterator[str]:
    head = f"components.{_key(component.name)}"
    surface = component.surface
    fields = (
        "function",
        "unknown",
        "above",
        "below",
        "hold",
        "jump_above",
        "jump_below",
        "unique",
        "restitution",
    )
    entries: dict[str, Any] = {"initial": component.initial}
    if component.limit is not None:
        entries["limit"] = {"to": component.limit.to, "reset": component.limit.reset}
    if surface is not None:
        entries["surface"] = {field: getattr(surface, field) for field in fields}
    yield from _section(head, entries)
    for mode in component.modes:
        yield f"\n[{head}.modes.{_key(mode.name)}]"
        for field, value in (("set", mode.set), ("der", mode.der)):
            if value:
                yield f"{field} = {_value(value)}"
        for guard in mode.guards:
            yield f"guards.{_key(guard.name)} = {_value(_guard(guard))}"


def _guard(guard: Guard) -> dict[str, Any]:
    then = [{"when": choice.when, "to": choice.to, "reset": choice.reset} for choice in guard.then]
    return {"expr": guard.expr, "then": then, "fatal": guard.fatal}


def _monitor(monitor: Monitor) -> dict[str, Any]:
    fields = ("expr", "direction", "action", "reset")
    return {field: getattr(monitor, field) for field in fields}


def _schedule(schedule: Schedule) -> dict[str, Any]:
    fields = ("times", "start", "period", "count", "reset", "terminate")
    return {field: getattr(schedule, field) for field in fields}


def _output(output: Output) -> Any:
    return _short("expr", output.expr, unit=output.unit, modes=output.modes)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _text(text: str) -> str:
    # a basic string of TOML equals one of JSON, except that DEL must be escaped
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _value(value: Any) -> str:
    if isinstance(value, Expression):
        return _number(value.text) or _text(value.text)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        items = ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items() if _given(item))
        return f"{{ {items} }}" if items else "{}"
    return "[" + ", ".join(_value(item) for item in value) + "]"


def _number(text: str) -> str | None:
    """Return the text if it is a number that TOML reads back to the same text, otherwise None."""
    for kind in (int, float):
        try:
            value = kind(text)
        except ValueError:
            continue
        return text if repr(value) == text and (kind is float or abs(value) <= MAX_INTEGER) else None
    return None
