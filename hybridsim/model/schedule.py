"""Events at known times: a list of times, or a clock that ticks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression, parse
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.frozen_map import FrozenMap


@dataclass(frozen=True)
class Schedule(Declared):
    """Resets, or the end of the run, at times that are known beforehand and stepped to, not searched for.

    The k-th time of a clock is start + k*period, k = 0, 1, ..., never a running sum.

    Parameters
    ----------
    times : single times; or instead
    start, period, count : first tick (0 if only a period is given), time between ticks, number of ticks
        (None: no end). All times are expressions of parameters.
    reset : state or discrete state to expression, evaluated at x-.
    terminate : whether the run ends there.
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
        object.__setattr__(self, "times", tuple(parse(time, self.place) for time in as_tuple(self.times)))
        if self.start is None and self.period is not None:
            object.__setattr__(self, "start", parse(0))
        self._expressions("start", "period")
        self._maps("reset", functions=True)
