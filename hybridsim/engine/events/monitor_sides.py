"""Decide which monitors fire at an instant: a monitor fires if its function leaves its side of zero."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after
from hybridsim.engine.events.outcome import Outcome
from hybridsim.model.parts.monitor import Monitor

_SIDES_BY_DIRECTION = {"up": (1,), "down": (-1,), "both": (1, -1)}


@dataclass
class MonitorSides:
    """The signs of the monitors at one instant, and the monitors that have fired at this instant.

    Parameters
    ----------
    before : sides (M,) just before the instant; 0 for a monitor at zero.
    leads : side (M,) to which the motion before leads a monitor that is at zero, if it changes; else 0.
    is_open : mask (M,) of monitors for which rounding hides the side and the direction.
    fired : monitors that have fired, with their directions.
    recorded : the fired monitors that have been recorded.
    """

    monitors: Sequence[Monitor]
    before: np.ndarray
    leads: np.ndarray
    is_open: np.ndarray
    fired: dict[int, int] = field(default_factory=dict)
    recorded: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, monitors: Sequence[Monitor], before: np.ndarray) -> MonitorSides:
        """Return the signs of the monitors without directions of crossing, because the earlier motion is unknown."""
        return cls(monitors, before, np.zeros_like(before), np.zeros(len(before), dtype=np.bool_))

    @classmethod
    def located(
        cls, monitors: Sequence[Monitor], before: np.ndarray, series: Any, stopping: Sequence[int]
    ) -> MonitorSides:
        """Return the signs of the monitors, with directions of crossing from Taylor series just before the instant.

        stopping: monitors that were located to change their sides there.
        """
        found = cls.of(monitors, before)
        for k, (value, bound) in enumerate(zip(series.monitors, series.monitor_bounds, strict=True)):
            if k in stopping:
                found.leads[k] = -before[k] or side_after(value, bound, 1)[0]
            elif abs(value[0]) <= bound[0]:
                side = side_after(value, bound, 1)[0]
                found.leads[k] = side if side == -before[k] else 0
                found.is_open[k] = side == 0
        return found

    def fire(self, outcome: Outcome | None, action: str = "") -> list[int]:
        """Mark and return the monitors that fire at this instant and have the given action; by default, any action.

        The state after the event decides. With outcome=None, or an outcome that failed, the motion before it decides.
        """
        known = outcome is not None and not outcome.status
        due = []
        for k, monitor in enumerate(self.monitors):
            if k in self.fired or action not in ("", monitor.action):
                continue
            way = self._left(k, outcome) if outcome is not None and known else int(self.leads[k])
            if way in _SIDES_BY_DIRECTION[monitor.direction]:
                self.fired[k] = way
                due.append(k)
        return due

    def _left(self, k: int, outcome: Outcome) -> int:
        """Return the direction in which a monitor left its side, or 0 if the monitor stayed on its side."""
        before, after = int(self.before[k]), int(outcome.monitor_sides[k])
        if after == before or (after == 0 and (self.is_open[k] or math.isnan(outcome.monitor_floors[k]))):
            return 0
        return -before

    def restore_hidden_sides(self, outcome: Outcome) -> None:
        """Restore the signs of monitors for which rounding hides whether their functions are zero."""
        hidden = self.is_open & (outcome.monitor_sides == 0)
        outcome.monitor_sides[hidden] = self.before[hidden]
