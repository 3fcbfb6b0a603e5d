"""Names inside a generated program: those of declared quantities start with v_, and no internal one does."""

from __future__ import annotations

from typing import Any


def user(name: str) -> str:
    """Name of a declared quantity inside the generated program; no internal name starts so."""
    return "v_" + name


def declared_name(symbol: Any) -> str:
    """The declared name of a symbol of the program."""
    return str(symbol.name).removeprefix("v_")
