"""Python's own parser, one thread at a time and without its warnings."""

from __future__ import annotations

import ast
import warnings
from typing import Any

from hybridsim.forks import SharedLock

_lock = SharedLock()


def python_tree(text: str, mode: str = "exec") -> Any:
    """The syntax tree of a text, as `ast.parse` gives it; ``mode="eval"`` for an expression.

    Before Python 3.12 the making of the tree counts its depth in a place that all threads share, and ends with a
    SystemError where two of them are at it (CPython issue 106905). Filters of warnings belong to all threads, too.
    """
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # odd spellings such as `1if x else 2` are no news to a model's user
        return ast.parse(text, mode=mode)
