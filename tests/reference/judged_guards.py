"""The engine's verdict on guards that are given as series, with zeros by decree, without a model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.choice.verdict import NO_SIDE, JudgedEvent, verdict

ABOVE, HOLD = 0, 1


class Parts(NamedTuple):
    """What a verdict reads of automata."""

    guards_of: np.ndarray
    hold: np.ndarray
    above: np.ndarray
    is_unilateral: np.ndarray


def event_of(series: Any, bounds: Any, decreed: Any) -> tuple[Parts, JudgedEvent]:
    """Each guard is the surface of a component of its own, which leaves it upward.

    decreed: 1 on the surface, 2 released from it without a jump, 3 the same of a gap.
    """
    decreed = np.asarray(decreed)
    count = len(decreed)
    parts = Parts(
        np.arange(count).reshape(-1, 1, 1).repeat(2, axis=1).copy(),
        np.full(count, HOLD),
        np.full(count, ABOVE),
        decreed == 3,
    )
    event = JudgedEvent(
        before=np.full(count, HOLD),
        now=np.full(count, HOLD),
        is_zero=np.zeros(count, dtype=np.bool_),
        on_surface=decreed >= 1,
        released_to=np.where(decreed >= 2, 0, NO_SIDE),
        judged=np.array([series, bounds], dtype=float),
        decreed=np.zeros(count, dtype=np.int64),
        all_sides=np.zeros((1, count), dtype=np.int64),
        all_orders=np.zeros((1, count), dtype=np.int64),
        all_floors=np.zeros((1, count)),
    )
    return parts, event


def verdict_on(series: Any, bounds: Any, decreed: Any, members: Any = None) -> tuple[int, JudgedEvent]:
    """The verdict on guards in the mode above, all of them or some, and the event with their sides."""
    parts, event = event_of(series, bounds, decreed)
    count = len(event.decreed)
    chosen = np.arange(count) if members is None else np.asarray(members, dtype=np.int64)
    z = np.full(count, ABOVE)
    found = int(verdict(parts, None, 0, event, z, chosen, True, True, 0))
    assert (event.decreed[chosen] == np.asarray(decreed)[chosen]).all()
    return found, event
