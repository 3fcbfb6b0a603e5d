"""Names inside a generated program: names of declared quantities start with v_, internal names never do."""

from __future__ import annotations

from typing import Any


def user(name: str) -> str:
    """Return the name of a declared quantity inside the generated program; internal names never have its prefix."""
    return "v_" + name


def declared_name(symbol: Any) -> str:
    """Return the declared name of a symbol of the program."""
    return str(symbol.name).removeprefix("v_")
