"""Many times are found in their segments as a search of each by itself finds them."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.record.time_lookup import locate_times


def searched(times, starts, ends, origins, spans, sign, is_later):
    """The same by NumPy's search, time by time."""
    index = np.searchsorted(sign * starts, sign * times, side="right" if is_later else "left") - 1
    index = np.maximum(index, 0)
    s = (times - origins[index, 0]) - origins[index, 1]
    begins, last = spans[index, 0], spans[index, 1]
    s = np.clip(s, begins, last) if sign > 0 else np.clip(s, last, begins)
    s = np.where(times == starts[index], begins, s)
    return index, np.where(times == ends[index], last, s)


@pytest.mark.parametrize("is_later", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("order", ["in a row", "against it", "anyhow"])
def test_times_are_found_in_their_segments(order: str, sign: float, is_later: bool) -> None:
    rng = np.random.default_rng(7)
    for count in (1, 2, 3, 40):
        lengths = rng.uniform(0.0, 1.0, count)
        lengths[rng.random(count) < 0.2] = 0.0  # two events at one instant
        starts = sign * np.cumsum(np.concatenate([[0.3], lengths[:-1]]))
        ends = np.append(starts[1:], starts[-1] + sign * lengths[-1])
        origins = np.stack([starts, rng.uniform(-1e-17, 1e-17, count)], axis=1)
        spans = np.stack([np.zeros(count), ends - starts], axis=1)
        times = np.concatenate([starts, ends, rng.uniform(*sorted((starts[0], ends[-1])), 200)])
        times = np.sort(times) if order != "anyhow" else rng.permutation(times)
        times = times[::-1].copy() if order == "against it" else times
        index, s = np.empty(len(times), dtype=np.int64), np.empty(len(times))
        locate_times(times, starts, ends, origins, spans, sign, is_later, index, s)
        wanted = searched(times, starts, ends, origins, spans, sign, is_later)
        np.testing.assert_array_equal(index, wanted[0])
        np.testing.assert_array_equal(s, wanted[1])


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
def test_states_at_many_times_are_those_at_each(integrator: str) -> None:
    """Times in a row, of which several lie in one step, against one at a time, and against the segments' own."""
    sol = hs.simulate("dfcs-stribeck", (0, 0.3), integrator=integrator)
    rng = np.random.default_rng(3)
    times = np.sort(np.concatenate([rng.uniform(0, 0.3, 500), sol.event_times("f"), sol.t]))
    together = sol(times)
    for k in rng.permutation(len(times))[:200].tolist():
        np.testing.assert_array_equal(together[:, k], sol(times[k]))
    index, s = sol._of_model.segment_at(times, "+")
    for i, segment in enumerate(sol._segments):
        inside = (index == i) & (s > segment.s[0]) & (s < segment.s[-1])
        np.testing.assert_allclose(together.T[inside], segment.dense(s[inside]), rtol=0, atol=1e-15)
