"""This module reads components from TOML: modes, guards, choices and the initial mode."""

from __future__ import annotations

from collections.abc import Iterable

from hybridsim.errors import Place
from hybridsim.model.parts.component import Choice, Component, Guard, Mode, Surface
from hybridsim.model.toml.table import Table

# Name of the only automaton of a file that declares its modes in [modes.*].
SINGLE = "mode"


def read_components(root: Table) -> Iterable[Component]:
    """Yield the automaton of the top-level [modes.*], followed by the automata of [components.*]."""
    if "modes" in root.data or "initial" in root.data:
        yield _component(SINGLE, root, root.source.place(("modes",)))
    for name, table in root.entries("components", "component"):
        table.only("modes", "initial", "surface", "limit")
        yield _component(name, table, table.place)


def _component(name: str, table: Table, place: Place) -> Component:
    tables = dict(table.entries("modes", "mode"))
    if not tables:
        table.fail("it has no modes", f"write [components.{name}.modes.NAME]")
    marked = [mode for mode, part in tables.items() if part.flag("initial")]
    named = table.text("initial") if "initial" in table.data else None
    for mode in marked:
        if mode != (named or marked[0]):
            remedy = "mark one mode as initial"
            table.fail(
                f"two initial modes, '{named or marked[0]}' and '{mode}'", remedy, "modes", mode, "initial"
            )
    surface = _surface(table)
    modes = [read_mode(mode, part) for mode, part in tables.items()]
    initial, limit = named or (marked[0] if marked else None), None
    if "limit" in table.data:
        part = table.sub(table.data["limit"], f"{table.kind}, limit", "to", "limit")
        limit = None if part is None else _limit(part)
    return Component(name, tuple(modes), initial, surface, limit, place=place)


def read_mode(name: str, table: Table) -> Mode:
    """Read one entry of a table of modes."""
    table.only("guards", "der", "set", "initial")
    guards = tuple(
        _guard(guard, part) for guard, part in table.entries("guards", f"mode {name}, guard", "expr")
    )
    return Mode(name, guards, table.expressions("der"), table.expressions("set"), place=table.place)


def _guard(name: str, table: Table) -> Guard:
    table.only("expr", "then", "fatal", "direction")
    expr = table.required("expr", 'write expr = "EXPRESSION", which is >= 0 while the mode lasts')
    transitions = table.data.get("then", [])
    then = []
    for index, value in enumerate(transitions if isinstance(transitions, list) else [transitions]):
        keys = ("then", index) if isinstance(transitions, list) else ("then",)
        part = table.sub(value, f"{table.kind}, then", "to", *keys)
        if part is not None:
            then.append(_choice(part))
    fatal = table.text("fatal") if "fatal" in table.data else None
    direction = table.text("direction") if "direction" in table.data else None
    return Guard(name, expr, tuple(then), fatal, direction, place=table.place)


def _choice(table: Table) -> Choice:
    table.only("to", "when", "reset")
    table.require("to", 'write to = "MODE", the next mode')
    return Choice(table.text("to"), table.expression("when"), table.resets("reset"), place=table.place)


def _limit(table: Table) -> Choice:
    table.only("to", "reset")
    table.require("to", 'write to = "MODE", the mode after the limit')
    return Choice(table.text("to"), None, table.resets("reset"), place=table.place)


def _surface(parent: Table) -> Surface | None:
    if "surface" not in parent.data or not parent.path:
        return None
    table = parent.sub(parent.data["surface"], f"{parent.kind}, surface", None, "surface")
    if table is None:
        return None
    restitution = table.expression("restitution")
    names = ("unknown", "above", "hold", *(() if restitution is not None else ("below",)))
    jumps = ("jump_above", "jump_below")
    table.only("function", *names, *jumps, "unique", "restitution")
    for key in names:
        table.require(key, f'write {key} = "..."')
    unknown, above, hold, *sides = (table.text(key) for key in names)
    jump_above, jump_below = (
        table.required(key, f"write {key} = 0 if the unknown does not jump there") for key in jumps
    )
    function = table.required("function", 'write function = "EXPRESSION"')
    unique = table.flag("unique")
    below = sides[0] if sides else None
    jumps_of = (jump_above, jump_below)
    return Surface(
        function, unknown, above, below, hold, *jumps_of, unique, restitution=restitution, place=table.place
    )
