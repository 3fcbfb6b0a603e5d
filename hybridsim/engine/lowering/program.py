"""This module defines a program: an ordered list of assignments, some of which depend on modes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Any

from hybridsim.engine.lowering.program_names import shown, user
from hybridsim.errors import ModelError


@dataclass(frozen=True)
class Assign:
    """The assignment ``name = expression`` (a SymPy expression over names)."""

    name: str
    expression: Any

    @cached_property
    def assigned(self) -> frozenset[str]:
        """Return the name that the item sets."""
        return frozenset((self.name,))

    @cached_property
    def used(self) -> frozenset[str]:
        """Return the names that the item reads."""
        return frozenset(s.name for s in self.expression.free_symbols)


@dataclass(frozen=True)
class Switch:
    """Assignments that depend on the mode of one component: branches[mode] is a tuple of `Assign`."""

    component: int
    branches: tuple[tuple[Assign, ...], ...]

    @cached_property
    def assigned(self) -> frozenset[str]:
        """Return the names that the item sets."""
        return frozenset(a.name for branch in self.branches for a in branch)

    @cached_property
    def used(self) -> frozenset[str]:
        """Return the names whose values the item needs in any mode."""
        names: set[str] = set()
        for branch in self.branches:
            own: set[str] = set()
            for a in branch:
                names |= a.used - own
                own.add(a.name)
        return frozenset(names)


Item = Assign | Switch


def changed(item: Item, change: Callable[[Any], Any]) -> Item:
    """Return a program item with a function applied to each of its expressions."""
    if isinstance(item, Assign):
        return Assign(item.name, change(item.expression))
    branches = (tuple(Assign(a.name, change(a.expression)) for a in branch) for branch in item.branches)
    return Switch(item.component, tuple(branches))


def ordered(items: Iterable[Item]) -> list[Item]:
    """Sort program items so that each name is set before it is read; raise an error for a cycle."""
    waiting = list(items)
    pending = Counter(name for item in waiting for name in item.assigned)
    result: list[Item] = []
    while waiting:
        is_independent = [not any(pending[n] for n in item.used) for item in waiting]
        if not any(is_independent):
            loop = sorted({shown(n) for i in waiting for n in i.assigned})
            raise ModelError(
                f"the quantities {', '.join(loop)} depend on each other in a circle",
                remedy="remove one of these dependencies, or declare one of the quantities as a state",
            )
        independent = list(compress(waiting, is_independent))
        waiting = [item for item, is_next in zip(waiting, is_independent, strict=True) if not is_next]
        pending.subtract(name for item in independent for name in item.assigned)
        result += independent
    return result


def items_for(items: list[Item], names: Iterable[str]) -> list[Item]:
    """Return the program items that compute the given names, in order."""
    open_names = set(names)
    selected: list[Item] = []
    for item in reversed(items):
        if not open_names.isdisjoint(item.assigned):
            selected.append(item)
            open_names |= item.used
    return selected[::-1]


def fixed_names(program: Any) -> set[str]:
    """Return the names of parameters, and of definitions that depend only on parameters."""
    found = {user(q.name) for q in program.model.parameters}
    for item in program.items:
        if isinstance(item, Assign) and item.used <= found:
            found.add(item.name)
    return found


def parameters_read(program: Any, expressions: Iterable[Any]) -> tuple[int, ...] | None:
    """Return the indices of the parameters in expressions, or None if the expressions depend on other quantities."""
    names = {s.name for e in expressions for s in e.free_symbols}
    if not names <= fixed_names(program):
        return None
    read = names.union(*(item.used for item in items_for(program.items, names)))
    return tuple(i for i, q in enumerate(program.model.parameters) if user(q.name) in read)
