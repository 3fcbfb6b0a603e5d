"""This module checks the arguments of comparisons; every error names the argument and its value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybridsim.arguments import cannot_be, is_row, number, time_span
from hybridsim.errors import UsageError

MOST = 10**6  # for quantities that are counted one by one: periods, samples, repetitions
MOST_STEPS = 10**9  # per period
_PERIODS = 20  # long enough for the transient of a damped scene, short enough to repeat dozens of runs
_TIME = 10.0  # for a model without a period: a few swings of a mechanism of about 1 Hz


def positive(value: Any, what: str) -> float:
    """Return a number above zero."""
    remedy = "use a number above zero"
    found = number(value, what, remedy)
    if not found > 0:
        raise cannot_be(what, value, remedy)
    return found


def whole(value: Any, what: str, most: int = MOST) -> int:
    """Return a whole number from 1 to a limit that is set by memory and time."""
    remedy = f"use a whole number from 1 to {most}"
    found = number(value, what, remedy)
    if not (1 <= found <= most and found.is_integer()):
        raise cannot_be(what, value, remedy)
    return int(found)


def positives(values: Any, what: str) -> tuple[float, ...] | None:
    """Return a list of numbers above zero, or None if the argument is None."""
    return None if values is None else tuple(positive(value, what) for value in _row(values, what))


def wholes(values: Any, what: str) -> tuple[int, ...] | None:
    """Return a list of whole numbers above zero, or None if the argument is None."""
    return None if values is None else tuple(whole(value, what, MOST_STEPS) for value in _row(values, what))


def mapping(value: Any, what: str) -> Mapping[str, Any]:
    """Return a mapping whose keys are names; None becomes an empty mapping."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise cannot_be(what, value, "use a mapping from names to values")
    return value


def checked_names(values: Any, argument: str) -> tuple[str, ...]:
    """Return a tuple of names; a single name becomes a tuple of length one."""
    found = (values,) if isinstance(values, str) else tuple(_row(values, argument, "use names"))
    for value in found:
        if not isinstance(value, str):
            raise UsageError(f"`{argument}` cannot contain {value!r}", remedy="use names")
    return found


def named_options(item: Any) -> tuple[str, Mapping[str, Any]]:
    """Return the name of an integrator and its options, from a name or a pair."""
    if isinstance(item, str):
        return item, {}
    if isinstance(item, tuple | list) and len(item) == 2 and isinstance(item[0], str):
        return item[0], mapping(item[1], f"options of {item[0]}")
    raise UsageError(
        f"`integrators` cannot contain {item!r}",
        remedy="use names, pairs (name, dict of options), or Series objects",
    )


def row_of_integrators(value: Any) -> tuple[Any, ...]:
    """Return the requested integrators as a tuple; a single name becomes a tuple of length one."""
    return (value,) if isinstance(value, str) else tuple(_row(value, "integrators", "use a list of names"))


def _row(values: Any, what: str, remedy: str = "use a list of numbers") -> Any:
    if not is_row(values):
        raise cannot_be(what, values, remedy)
    return values


def run_span(
    t_span: tuple[float, float] | None, duration: float | None, period: float | None
) -> tuple[float, float]:
    """Return the time span of the runs; the default is the duration, else some forcing periods, else a fixed time."""
    if t_span is None:
        if duration is not None:
            return 0.0, duration
        return 0.0, _PERIODS * period if period else _TIME
    t0, t1 = time_span(t_span)
    if not t1 > t0:
        raise UsageError(
            f"`t_span` cannot be ({t0:g}, {t1:g})",
            remedy="use t1 > t0, because comparisons run forward in time",
        )
    return t0, t1
