"""Public functions called with what they do not take: a UsageError names the function, the argument, what was meant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.calls import name_of, refusing
from hybridsim.errors import UsageError


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda sol: hs.compare("dfcs", rtol=1e-6), "compare() has no argument 'rtol'\ndid you mean 'rtols'?"),
        (lambda sol: hs.compare_suite(rtol=1e-6), "compare_suite() has no argument 'rtol'"),
        (lambda sol: hs.sweep("dfcs"), "sweep(): missing a required argument: 'values'\narguments: model, values"),
        (lambda sol: hs.advise("dfcs", "peak(x)", tolerance=1), "advise() has no argument 'tolerance'"),
        (lambda sol: hs.load_solution(), "load_solution(): missing a required argument: 'path'"),
        (lambda sol: sol.event_times(), "event_times(): missing a required argument: 'component'\nargu"),
        (lambda sol: sol.output("v", times=0.0), "output() has no argument 'times'"),
        (lambda sol: sol.resume(until=1.0), "resume() has no argument 'until'\narguments: t_end, limits, progress"),
    ],
)  # fmt: skip
def test_arguments_that_are_not_taken(call: Callable[[Any], Any], says: str) -> None:
    with pytest.raises(UsageError) as raised:
        call(hs.simulate("dfcs", (0, 0.01)))
    assert says in str(raised.value)


def test_an_error_inside_of_it_stays_as_it_is() -> None:
    @refusing
    def half(x: Any) -> Any:
        return x / 2

    with pytest.raises(TypeError, match="unsupported operand") as raised:
        half("one")
    assert not isinstance(raised.value, UsageError)
    assert half(x=3.0) == 1.5


def test_a_function_without_a_name_is_named_by_its_line() -> None:
    assert name_of(test_arguments_that_are_not_taken) == "test_arguments_that_are_not_taken"
    unnamed = lambda sol: sol.t_end  # noqa: E731  # the subject of the test
    line = unnamed.__code__.co_firstlineno
    assert name_of(unnamed) == f"lambda (line {line} of test_calls.py)"
