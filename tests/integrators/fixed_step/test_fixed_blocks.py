"""What is kept of a fixed-step run is read from its rows: the same as the whole run, cut off."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs

OMEGA = 0.55 * math.sqrt(1e5 / 0.2)
PERIOD = 2.0 * math.pi / OMEGA
PARAMS = {"F0": 21.6, "omega": OMEGA}
# short steps and long ones, so that the whole is one stretch of the kernel or several, and modes change often
METHODS: list[tuple[str, dict[str, Any]]] = [
    ("rk4-sign", {"friction": "step", "steps_per_period": 3000.0}),
    ("rk4-sign", {"friction": "stage", "steps_per_period": 300.0}),
    ("rk4-dichotomy", {"steps_per_period": 3000.0}),
    ("rk4-dichotomy", {"stick_velocity": "zero", "release": "located", "steps_per_period": 300.0}),
]


def run(name: str, options: dict[str, Any], save: str | float) -> hs.Solution:
    return hs.simulate("dfcs", (0.0, 7.3 * PERIOD), params=PARAMS, integrator=name, keep=save, **options)


@pytest.mark.parametrize(("name", "options"), METHODS)
@pytest.mark.parametrize("kept", [0.4 * PERIOD, PERIOD, 4.2 * PERIOD])
def test_what_is_kept_is_the_end_of_the_whole(name: str, options: dict[str, Any], kept: float) -> None:
    whole, end = run(name, options, "all"), run(name, options, kept)
    assert end.t_start == pytest.approx(whole.t_end - kept, rel=1e-12)
    later = [e for e in whole.events if e.t >= end.t_start]
    assert [(e.t, e.source, e.target) for e in end.events] == [(e.t, e.source, e.target) for e in later]
    for mine, other in zip(end.events, later, strict=True):
        np.testing.assert_array_equal(mine.x_plus, other.x_plus)
    times = np.linspace(end.t_start, end.t_end, 997)
    np.testing.assert_array_equal(end(times), whole(times))
    np.testing.assert_array_equal(end.output("f", times), whole.output("f", times))
    inner = whole.t > end.t_start
    np.testing.assert_array_equal(end.t[1:], whole.t[inner])  # the first knot is the cut itself
    np.testing.assert_array_equal(end.y[:, 1:], whole.y[:, inner])
    assert end.stats["events"] == whole.stats["events"]


@pytest.mark.parametrize(("name", "options"), METHODS)
def test_modes_tile_the_run(name: str, options: dict[str, Any]) -> None:
    """Where the mode changes the instant stands twice; the modes follow one another without a gap."""
    solution = run(name, options, "all")
    changes = solution.event_times("f", "transition")
    assert len(solution.modes["f"]) == len(changes) + 1
    assert [m.t0 for m in solution.modes["f"][1:]] == changes.tolist()
    assert (np.diff(solution.t) >= 0.0).all()
    assert np.isin(changes, solution.t[1:][np.diff(solution.t) == 0.0]).all()
    assert solution.t[0] == 0.0
    assert solution.t[-1] == solution.t_end
    apart = ~np.isin(solution.t, changes)
    # a time is a sum of two doubles inside and one outside: v changes by up to 100 m/s^2 over its last digit
    np.testing.assert_allclose(solution(solution.t[apart]), solution.y[:, apart], rtol=1e-9, atol=1e-14)


def test_events_alone_and_nothing() -> None:
    name, options = METHODS[0]
    whole, events, nothing = (run(name, options, save) for save in ("all", "events", "nothing"))
    assert [(e.t, e.target) for e in events.events] == [(e.t, e.target) for e in whole.events]
    assert nothing.stats["events"] == len(whole.events)
