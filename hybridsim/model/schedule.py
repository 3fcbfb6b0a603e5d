"""Events at known times: a list of times, or a clock that ticks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral

from hybridsim.expr import Expression, parse
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.frozen_map import FrozenMap


@dataclass(frozen=True)
class Schedule(Declared):
    """Resets, or the end of the run, at times that are known beforehand and stepped to, not searched for.

    The k-th time of a clock is start + k*period, k = 0, 1, ..., never a running sum.

    Parameters
    ----------
    name : str
        What its events are called.
    times : sequence of str or float, optional
        Single times, one that is listed twice counts twice; or instead a clock, by the next three.
    start, period : str or float, optional
        First tick (0 if only a period is given), time between ticks. All times are expressions of parameters,
        in the unit of t.
    count : int, optional
        Number of ticks; None: no end.
    reset : mapping of str to str or float, optional
        State or discrete state to the expression that gives its new value, evaluated at x-, or to ``"+= amount"``,
        which adds: amounts of one instant are summed in any order.
    terminate : bool, optional
        Whether the run ends there.
    place : Place, optional
        Where it is written, for the messages of errors.

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
            raise self._fault(f"count is {count!r}", "give a whole number >= 1, or leave it out")
        self._maps("reset", functions=True)
