"""This module defines a program: an ordered list of assignments, some of which depend on modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from hybridsim.engine.lowering.program_names import shown, user
from hybridsim.errors import ModelError


@dataclass(frozen=True)
class Assign:
    """The assignment ``name = expression`` (a SymPy expression over names)."""

    name: str
    expression: Any


@dataclass(frozen=True)
class Switch:
    """Assignments that depend on the mode of one component: branches[mode] is a tuple of `Assign`."""

    component: int
    branches: tuple[tuple[Assign, ...], ...]


Item = Assign | Switch


def changed(item: Item, change: Callable[[Any], Any]) -> Item:
    """Return a program item with a function applied to each of its expressions."""
    if isinstance(item, Assign):
        return Assign(item.name, change(item.expression))
    branches = (tuple(Assign(a.name, change(a.expression)) for a in branch) for branch in item.branches)
    return Switch(item.component, tuple(branches))


def assigned(item: Item) -> set[str]:
    """Return the names that a program item sets."""
    if isinstance(item, Assign):
        return {item.name}
    return {a.name for branch in item.branches for a in branch}


def used(item: Item) -> set[str]:
    """Return the names that a program item reads in any mode and does not set itself."""
    if isinstance(item, Assign):
        return {s.name for s in item.expression.free_symbols}
    names: set[str] = set()
    for branch in item.branches:
        own: set[str] = set()
        for a in branch:
            names |= {s.name for s in a.expression.free_symbols} - own
            own.add(a.name)
    return names


def ordered(items: Iterable[Item]) -> list[Item]:
    """Sort program items so that each name is set before it is read; raise an error for a cycle."""
    waiting = list(items)
    pending: dict[str, int] = {}
    for item in waiting:
        for name in assigned(item):
            pending[name] = pending.get(name, 0) + 1
    result: list[Item] = []
    while waiting:
        independent = [i for i in waiting if not any(pending.get(n, 0) for n in used(i))]
        if not independent:
            loop = sorted({shown(n) for i in waiting for n in assigned(i)})
            raise ModelError(
                f"the quantities {', '.join(loop)} depend on each other in a circle",
                remedy="remove one of these dependencies, or declare one of the quantities as a state",
            )
        for item in independent:
            waiting.remove(item)
            for name in assigned(item):
                pending[name] -= 1
        result += independent
    return result


def items_for(items: list[Item], names: Iterable[str]) -> list[Item]:
    """Return the program items that compute the given names, in order."""
    open_names = set(names)
    selected: list[Item] = []
    for item in reversed(items):
        if assigned(item) & open_names:
            selected.append(item)
            open_names |= used(item)
    return selected[::-1]


def fixed_names(program: Any) -> set[str]:
    """Return the names of parameters, and of definitions that depend only on parameters."""
    found = {user(q.name) for q in program.model.parameters}
    for item in program.items:
        if isinstance(item, Assign) and {s.name for s in item.expression.free_symbols} <= found:
            found.add(item.name)
    return found


def parameters_read(program: Any, expressions: Iterable[Any]) -> tuple[int, ...] | None:
    """Return the indices of the parameters in expressions, or None if the expressions depend on other quantities."""
    names = {s.name for e in expressions for s in e.free_symbols}
    if not names <= fixed_names(program):
        return None
    read = names.union(*(used(item) for item in items_for(program.items, names)))
    return tuple(i for i, q in enumerate(program.model.parameters) if user(q.name) in read)
