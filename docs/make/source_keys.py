"""Keys of sources: equal where the code does the same, whatever files it lies in and whatever is written beside it.

A key is made from the syntax trees of the statements at the top of each module, without comments, docstrings, imports
and the texts of errors. Names that were changed count as the names that the glossary gives for them.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

GLOSSARY = Path(__file__).resolve().parents[1] / "glossary.md"


@cache
def new_names() -> Mapping[str, str]:
    """Retired names and what stands in their place, as docs/glossary.md has them.

    One word may have several successors, and one successor several words: they all count as one name.
    """
    same: dict[str, str] = {}

    def first(name: str) -> str:
        while same.get(name, name) != name:
            name = same[name]
        return name

    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \|", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE)
    for before, now in rows:
        same.setdefault(now, now)
        same[first(before)] = first(now)
    return {name: first(name) for name in same}


class _Bare(ast.NodeTransformer):
    """Takes away what no figure depends on."""

    def __init__(self, tree: ast.Module) -> None:
        bound = (node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))
        self.imported = {alias.asname or alias.name for node in bound for alias in node.names}

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """A name of a module is the name alone: `bounded.UNIT` is `UNIT`."""
        if isinstance(node.value, ast.Name) and node.value.id in self.imported:
            return ast.Name(node.attr, node.ctx)
        return self.generic_visit(node)

    def visit_Import(self, node: ast.Import) -> None:
        """Where something is imported from does not matter."""

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """Where something is imported from does not matter."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """A module by its name is so wherever it lies."""
        if isinstance(node.value, str) and node.value.startswith("hybridsim."):
            return ast.Constant(node.value.rpartition(".")[2])
        return node

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        """What an error says does not matter; which one is raised does."""
        for inner in ast.walk(node):
            if isinstance(inner, ast.Constant) and isinstance(inner.value, str):
                inner.value = ""
        return self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """A docstring, or another text that is not used."""
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return self.generic_visit(node)


@cache
def statements(source: bytes) -> tuple[str, ...]:
    """The bare syntax trees of the statements at the top of a module."""
    tree = ast.parse(source)
    return tuple(
        re.sub(
            r"\b(id|name|attr|arg)='(\w+)'",
            lambda found: f"{found[1]}='{new_names().get(found[2], found[2])}'",
            ast.dump(statement),
        )
        for statement in _Bare(tree).visit(tree).body
        if not (isinstance(statement, ast.If) and getattr(statement.test, "id", "") == "TYPE_CHECKING")
    )


def key(modules: Iterable[bytes], data: Iterable[bytes]) -> str:
    """The key of these modules, by their texts, and of these files of data."""
    digests = {hashlib.sha256(one.encode()).digest() for source in modules for one in statements(source)}
    digests |= {hashlib.sha256(content).digest() for content in data}
    return hashlib.sha256(b"".join(sorted(digests))).hexdigest()[:12]
