"""This module defines events at known times: a list of times, or a periodic clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral

from hybridsim.expr import Expression, parse
from hybridsim.model.parts.declared import Declared, as_tuple
from hybridsim.model.parts.frozen_map import FrozenMap


@dataclass(frozen=True)
class Schedule(Declared):
    """Resets, or the end of the run, at known times. Integration steps end exactly at these times.

    The k-th tick of a clock is computed as start + k*period, k = 0, 1, ..., without accumulated rounding.

    Parameters
    ----------
    name : str
        Name of the schedule and its events.
    times : sequence of str or float, optional
        List of times; a time that is listed twice counts twice. Alternatively, define a clock by the next three.
    start, period : str or float, optional
        Time of the first tick (default 0) and time between ticks. All times are expressions of parameters, in the
        unit of t.
    count : int, optional
        Number of ticks; None for an unlimited number.
    reset : mapping of str to str or float, optional
        New value of each changed state or discrete state, an expression evaluated at x-, or ``"+= amount"``. Amounts
        added at the same instant are summed.
    terminate : bool, optional
        Whether the run ends at the event.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> dose = hs.Schedule("dose", period=1, count=3, reset={"x": "+= 1"})
    >>> model = hs.Model("drug", states=[hs.State("x", 0, 0)], schedules=[dose])
    >>> hs.simulate(model, (0, 5)).y[:, -1].tolist()
    [3.0]
    """

    name: str
    times: tuple[Expression, ...] = ()
    start: Expression | None = None
    period: Expression | None = None
    count: int | None = None
    reset: Mapping[str, Expression] = field(default_factory=FrozenMap)
    terminate: bool = False

    def __post_init__(self) -> None:
        self._texts("name")
        object.__setattr__(
            self,
            "times",
            tuple(self._parsed(time, "times", functions=False) for time in as_tuple(self.times)),
        )
        if self.start is None and self.period is not None:
            object.__setattr__(self, "start", parse(0))
        self._expressions("start", "period")
        self._flags("terminate")
        count: object = self.count
        if not (count is None or isinstance(count, Integral)) or isinstance(count, bool):
            raise self._fault(f"`count` cannot be {count!r}", "use a whole number >= 1, or omit `count`")
        self._maps("reset", functions=True)
