"""Python's parser, used by one thread at a time and without warnings."""

from __future__ import annotations

import ast
import warnings
from typing import Any

from hybridsim.forks import SharedLock

_lock = SharedLock()


def python_tree(text: str, mode: str = "exec") -> Any:
    """Return the syntax tree of a text like `ast.parse`; ``mode="eval"`` parses an expression.

    Before Python 3.12 all threads share one counter of the depth, so that parsing in two threads can raise SystemError
    (CPython issue 106905). Warning filters are shared by all threads, too.
    """
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # no warnings about spellings such as `1if x else 2`
        return ast.parse(text, mode=mode)
