"""This module defines the names inside a generated program: declared names get the prefix v_.

Generated code is Python. A dot in a declared name, as in left.x, becomes a middle dot, which Python allows in
identifiers and which no declared name contains.
"""

from __future__ import annotations

import re
from typing import Any

_DOT = "\N{MIDDLE DOT}"


def user(name: str) -> str:
    """Return the name of a declared quantity inside the generated program."""
    return "v_" + name.replace(".", _DOT)


def declared_name(symbol: Any) -> str:
    """Return the declared name of a program symbol."""
    return shown(str(symbol.name))


def shown(text: str) -> str:
    """Return a text for messages, in which declared names replace the names of the program."""
    return re.sub(r"\bv_", "", text).replace(_DOT, ".")
