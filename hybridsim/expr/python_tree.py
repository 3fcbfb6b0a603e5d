"""This module calls Python's parser without warnings, in one thread at a time, and joins dotted names."""

from __future__ import annotations

import ast
import warnings
from typing import Any

from hybridsim.forks import SharedLock

_lock = SharedLock()


def python_tree(text: str, mode: str = "exec") -> Any:
    """Return the syntax tree of a text, as `ast.parse` does; ``mode="eval"`` parses an expression.

    Before Python 3.12 all threads share one counter of the depth, so that parsing in two threads can raise SystemError
    (CPython issue 106905). Warning filters are shared by all threads, too.
    """
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # no warnings about spellings such as `1if x else 2`
        return ast.parse(text, mode=mode)


def with_dotted_names(tree: ast.expr) -> ast.expr:
    """Return a tree in which names that are joined by dots are single names; the given tree may be modified."""
    if not any(isinstance(node, ast.Attribute) for node in ast.walk(tree)):
        return tree
    joined: ast.expr = _Joined().visit(tree)
    return joined


class _Joined(ast.NodeTransformer):
    """Replaces each chain of names and dots by one name; other attributes remain, and the whitelist rejects them."""

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Return the joined name, or the node itself if its dot does not follow a name."""
        value = self.visit(node.value)
        if not isinstance(value, ast.Name):
            node.value = value
            return node
        return ast.copy_location(ast.Name(f"{value.id}.{node.attr}", ast.Load()), node)
