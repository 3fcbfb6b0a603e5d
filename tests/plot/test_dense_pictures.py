"""A picture of very many events takes few operations for each event, and still shows every part of the run."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.plot import time_history
from hybridsim.plot.shared.smooth_parts import Window, samples_of


def sawtooth(ticks: int) -> hs.Solution:
    """x = t between the ticks at t = 1, 2, ..., each of which resets x to zero."""
    tick = hs.Schedule("tick", period=1.0, start=1.0, reset={"x": "0"})
    return hs.simulate(hs.Model("sawtooth", [hs.State("x", 0, "1")], schedules=[tick]), (0.0, ticks + 0.5))


def sampled(ticks: int) -> hs.Solution:
    """An oscillator whose force is computed from its speed at each tick."""
    states = [hs.State("x", 1, "v"), hs.State("v", 0, "u - 0.01*x")]
    tick = hs.Schedule("tick", period=1.0, start=1.0, reset={"u": "-0.1*sin(v)"})
    model = hs.Model("sampled", states, discrete=[hs.Discrete("u", 0.0)], schedules=[tick])
    return hs.simulate(model, (0.0, ticks + 0.5))


def calls_of_plot(solution: hs.Solution) -> int:
    """Return the number of calls of functions in Python and C during the drawing of a run."""
    assert solution.events  # an object for each event is made before
    count = 0

    def count_call(frame: Any, what: str, argument: Any) -> None:
        nonlocal count
        count += what in ("call", "c_call")

    sys.setprofile(count_call)
    try:
        time_history(solution, ["x", "v"])
    finally:
        sys.setprofile(None)
    return count


def test_drawing_states_needs_no_call_for_each_event() -> None:
    time_history(sampled(10))  # imports and caches
    more, fewer = calls_of_plot(sampled(6000)), calls_of_plot(sampled(2000))
    assert more - fewer < 4000


@pytest.mark.parametrize("ticks", [30, 1500])
def test_every_tooth_has_both_of_its_ends(ticks: int) -> None:
    solution = sawtooth(ticks)
    samples = samples_of(solution, ["x"], Window(0.0, ticks + 0.5))
    t, x, first = samples.t, samples.values["x"], samples.firsts
    assert len(first) == ticks + 2 and len(t) <= max(6000 + 9 * ticks, 5 * ticks + 6000)
    number = np.repeat(np.arange(ticks + 1), np.diff(first))
    assert np.allclose(t[first[:-1]], np.arange(ticks + 1)) and np.allclose(x[first[1:-1] - 1], 1)
    assert np.allclose(x, t - number, rtol=0, atol=1e-8)
