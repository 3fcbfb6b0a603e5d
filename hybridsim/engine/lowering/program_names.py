"""This module defines the names inside a generated program: declared names get the prefix v_."""

from __future__ import annotations

from typing import Any


def user(name: str) -> str:
    """Return the name of a declared quantity inside the generated program."""
    return "v_" + name


def declared_name(symbol: Any) -> str:
    """Return the declared name of a program symbol."""
    return str(symbol.name).removeprefix("v_")
