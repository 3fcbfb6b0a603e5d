"""This module rewrites the expressions of a part with the names of the model that contains the part."""

from __future__ import annotations

import ast
from bisect import bisect_left
from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

from hybridsim.errors import Place
from hybridsim.expr.grammar import CONSTANTS, TIME
from hybridsim.expr.increment import HEAD, Increment
from hybridsim.expr.parse import Expression
from hybridsim.expr.rebuild import rebuilt
from hybridsim.expr.write import write

Kind = TypeVar("Kind", bound=Expression)
_FIXED = frozenset({TIME, *CONSTANTS})


def prefixed(expr: Kind, prefix: str, use: str, own: Collection[str] = ()) -> Kind:
    """Return an expression with a prefix before each of its names, except the time and the names in ``own``.

    The text keeps its form, and errors point at the columns of the new text. ``use`` is the part in error messages.
    """
    place = (expr.place or Place()).inside(use)
    fixed = _FIXED.union(own)
    parts = list(ast.walk(expr.tree))
    functions = {id(part.func) for part in parts if isinstance(part, ast.Call)}
    names = [part for part in parts if isinstance(part, ast.Name) and id(part) not in functions]
    nodes = [name for name in names if name.id not in fixed]
    if not nodes:
        return replace(expr, place=place)
    renamed = frozenset(name if name in fixed else prefix + name for name in expr.names)
    head = HEAD if isinstance(expr, Increment) else ""
    if all(hasattr(node, "col_offset") for node in nodes):
        starts = sorted(node.col_offset for node in nodes)
        tree = _prefixed(expr.tree, prefix, fixed, starts)
        amount = expr.text[len(head) :]
        cuts = [0, *starts, len(amount)]
        text = prefix.join(amount[a:b] for a, b in pairwise(cuts))
    else:  # an expression that was derived from others: its columns belong to several texts
        tree = _prefixed(expr.tree, prefix, fixed, None)
        text = write(tree)
    return replace(expr, text=head + text, names=renamed, place=place, tree=tree)


def _prefixed(node: ast.expr, prefix: str, fixed: Collection[str], starts: list[int] | None) -> ast.expr:
    """Return a copy of a tree with a prefix before its names, and with the columns shifted accordingly."""
    made = rebuilt(node, lambda part: _prefixed(part, prefix, fixed, starts))
    if isinstance(node, ast.Name) and node.id not in fixed:
        made = ast.Name(prefix + node.id, ast.Load())
    elif isinstance(node, ast.Constant):
        made = ast.Constant(node.value)
    if starts is not None and made is not node:
        made.col_offset = node.col_offset + len(prefix) * bisect_left(starts, node.col_offset)
    return made
