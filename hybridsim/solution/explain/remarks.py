"""This module adds remarks on corners, vanishing loads and simultaneous events to an explanation."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.automaton import CORNER
from hybridsim.model.smoothing.jumps import SIGN
from hybridsim.model.smoothing.one_sided import names_of, number_of
from hybridsim.solution.explain.candidate import as_in
from hybridsim.solution.explain.one_instant import LOCATED

if TYPE_CHECKING:
    from hybridsim.engine.record.segments import Occurrence
    from hybridsim.engine.system.system import System
    from hybridsim.model import Component, Contact, Model
    from hybridsim.solution.solution import Solution

_FIRST_PIECE = "1"  # the name of the first mode of a table's component; its modes are numbered


def remarks(solution: Solution, occurrence: Occurrence, together: Sequence[Occurrence]) -> tuple[str, ...]:
    """Return remarks on facts that the guards do not show; `together` contains all events of the instant."""
    if solution._save != "all":
        return ()  # the modes and the motion around the event were not kept
    system = solution._system
    changed = [one for one in together if one.kind == CORNER]
    z = _modes_after(solution, float(occurrence.instant))
    return (
        *_companions(occurrence, together),
        *(_changed(system, one, z) for one in changed if one is not occurrence),
        *_jump(system, occurrence, z),
        *_unchanged_sides(system, occurrence, z, {one.component for one in changed}),
        *_loads(solution, float(occurrence.instant)),
    )


def change_of_side(solution: Solution, occurrence: Occurrence) -> str:
    """Describe why the argument of a corner such as `abs` changed its sign, and the effect on the run."""
    system = solution._system
    sentence = _changed(system, occurrence, _modes_after(solution, float(occurrence.instant)))
    if next(a for a in system.automata if a.name == occurrence.component).is_step:
        return f"{sentence}; it depends on time alone, so the rates may jump, but no mode changes"
    return f"{sentence}; both sides agree at this instant, so nothing jumps and no mode changes"


def _companions(occurrence: Occurrence, together: Sequence[Occurrence]) -> Iterator[str]:
    """List the other events at the same instant, in order."""
    events = [one for one in together if one.kind != CORNER]
    if len(events) < 2:
        return
    names = [f"{one.kind} {_name(one)}{' (this one)' if one is occurrence else ''}" for one in events]
    yield f"{len(events)} events happen at this instant, in this order: {'; '.join(names)}"


def _name(one: Occurrence) -> str:
    return f"{one.component} {one.source} -> {one.target}" if one.source or one.target else one.component


def _changed(system: System, occurrence: Occurrence, z: np.ndarray) -> str:
    """Describe a corner whose argument changes its sign, or a table that enters its next piece."""
    name, component = _quoted(occurrence.component), _component(system, occurrence.component)
    if component.modes[0].name == _FIRST_PIECE:
        return f"table {name} goes from piece {occurrence.source} to piece {occurrence.target} here"
    mode = component.mode(occurrence.target)
    is_above = mode is component.modes[0]
    argument = as_in(system, z, component.modes[0].guards[0].expr).text
    sentence = f"{name} changes its side here: {argument} becomes {'positive' if is_above else 'negative'}"
    if len(mode.set) == 1:
        (value,) = mode.set.values()
        sentence += f", and {name} is {as_in(system, z, value).text} from here on"
    return sentence


def _jump(system: System, occurrence: Occurrence, z: np.ndarray) -> Iterator[str]:
    """Describe the component that hybridsim adds for a jump in the rates."""
    for component in system.model.all_components():
        surface = component.surface if component.name == occurrence.component else None
        if surface and surface.unknown.startswith(SIGN):
            border = as_in(system, z, surface.function).text
            yield f"{component.name} makes the rates jump at {border} = 0, and switches like a component"


def _unchanged_sides(
    system: System, occurrence: Occurrence, z: np.ndarray, changed: set[str]
) -> Iterator[str]:
    """Describe the corners and tables that affect an event, with their present sides and pieces."""
    read = _read_by(system, occurrence)
    for component, automaton, mode in zip(system.model.all_components(), system.automata, z, strict=True):
        own = component.modes[int(mode)]
        if not automaton.is_corner or component.name in changed or not read & own.set.keys():
            continue
        if component.modes[0].name == _FIRST_PIECE:
            yield f"table {component.name} is on piece {own.name} here"
            continue
        argument = as_in(system, z, component.modes[0].guards[0].expr).text
        side = f"{argument} {'>' if own is component.modes[0] else '<'} 0"
        name = _quoted(component.name)
        if len(own.set) == 1:
            (value,) = own.set.values()
            yield f"{name} is {as_in(system, z, value).text} here, since {side}"
        else:
            yield f"{name} is on its side {side} here"


def _read_by(system: System, occurrence: Occurrence) -> set[str]:
    """Return the names on which the guards or the monitor of an event depend."""
    model = system.model
    behind: dict[str, set[str]] = {name: set(names_of(expr.tree)) for name, expr in model.definitions}
    for component in model.all_components():
        for mode in component.modes:
            for name, expr in mode.set.items():
                behind[name] = behind.get(name, set()) | names_of(expr.tree)
    open_ = {name for tree in _trees(model, occurrence) for name in names_of(tree)}
    seen: set[str] = set()
    while open_:
        name = open_.pop()
        seen.add(name)
        open_ |= behind.get(name, set()) - seen
    return seen


def _trees(model: Model, occurrence: Occurrence) -> Iterator[ast.expr]:
    """Yield the expressions that decide an event: its guard, guards of a surface, or its monitor."""
    yield from (monitor.expr.tree for monitor in model.monitors if monitor.name == occurrence.component)
    for component in model.all_components():
        if component.name != occurrence.component or occurrence.kind == CORNER:
            continue
        for mode in component.modes:
            for guard in mode.guards:
                is_own = mode.name == occurrence.source and guard.name == occurrence.guard
                if is_own or (component.surface and mode.name in (occurrence.source, occurrence.target)):
                    yield guard.expr.tree


def _loads(solution: Solution, t: float) -> Iterator[str]:
    """Describe contacts whose normal load reaches, leaves or touches zero at an instant."""
    times = solution._of_model.instants
    k = int(np.searchsorted(times, t))
    if not 0 < k < len(times) - 1:
        return
    for contact in solution.model.contacts:
        middles = ((times[k - 1] + t) / 2, (t + times[k + 1]) / 2)
        before, here, after = (_load(solution, contact, time) for time in (middles[0], t, middles[1]))
        if before is None or here is None or after is None:
            continue
        was_zero, is_zero = (load == 0.0 or (contact.opens and load < 0.0) for load in (before, after))
        load = f"the normal load of contact {contact.name} ({contact.normal.text})"
        if is_zero and not was_zero:
            yield f"{load} reaches zero here, and friction ends until the load is positive again"
        elif was_zero and not is_zero:
            yield f"{load} leaves zero here, and friction begins again"
        elif not is_zero and abs(here) <= LOCATED * UNIT * max(abs(before), abs(after)):
            yield f"{load} touches zero here"


def _load(solution: Solution, contact: Contact, t: float) -> float | None:
    """Return the normal load of a contact at a time, or None if the load has no value at this time."""
    model = solution.model
    trees = {name: expr.tree for name, expr in model.definitions}
    values, open_ = dict(model.parameter_values()), set(names_of(contact.normal.tree))
    values["t"] = t
    while open_:
        name = open_.pop()
        if name in trees:
            open_ |= names_of(trees[name])
        elif name not in values:
            values[name] = float(solution.output(name, t))
    return number_of(contact.normal.tree, values, trees.get)


def _modes_after(solution: Solution, t: float) -> np.ndarray:
    """Return the modes of all components just after an instant."""
    index, _ = solution._of_model.segment_at(np.array([t]), "+")
    return np.maximum(solution._segments[int(index[0])].z, 0)


def _quoted(name: str) -> str:
    """Return the name of a corner, in quotation marks if the name contains words."""
    return f"'{name}'" if " if " in name else name


def _component(system: System, name: str) -> Component:
    return next(component for component in system.model.all_components() if component.name == name)
