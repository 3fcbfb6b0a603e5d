"""This module finds the names of a program that depend on parameters only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hybridsim.engine.lowering.program import Assign, items_for, used
from hybridsim.engine.lowering.program_names import user


def fixed_names(program: Any) -> set[str]:
    """Return the names of parameters, and of definitions that depend only on parameters."""
    found = {user(q.name) for q in program.model.parameters}
    for item in program.items:
        if isinstance(item, Assign) and {s.name for s in item.expression.free_symbols} <= found:
            found.add(item.name)
    return found


def parameters_read(program: Any, expressions: Iterable[Any]) -> tuple[int, ...] | None:
    """Return the indices of the parameters in expressions, or None if these depend on more than parameters."""
    names = {s.name for e in expressions for s in e.free_symbols}
    if not names <= fixed_names(program):
        return None
    read = names.union(*(used(item) for item in items_for(program.items, names)))
    return tuple(i for i, q in enumerate(program.model.parameters) if user(q.name) in read)
