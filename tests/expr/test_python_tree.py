"""Expressions are read on several threads at once."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from hybridsim.expr import parse


@pytest.fixture
def eager_threads() -> Iterator[None]:
    """Threads take turns after every few instructions."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_threads_do_not_disturb_each_other(eager_threads: None) -> None:
    text = "+".join(f"(a*sin({k}*b) - (c/{k + 1}))" for k in range(12))
    filters = list(warnings.filters)
    with ThreadPoolExecutor(4) as threads:
        names = set(threads.map(lambda k: parse(f"{text} + {k}.5").names, range(400)))
    assert names == {frozenset({"a", "b", "c"})}
    assert warnings.filters == filters
