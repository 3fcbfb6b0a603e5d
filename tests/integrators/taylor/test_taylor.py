"""Steps of the Taylor integrator that end where they have to."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
def test_a_step_that_would_leave_a_few_ulps_goes_all_the_way(rtol: float) -> None:
    """The knots of a record end steps: what is left before one by rounding is too short for a step of its own."""
    solution = hs.simulate("base-isolation", (0.0, 1.5), integrator="taylor", rtol=rtol)
    assert solution.status == "finished"
    other = hs.simulate("base-isolation", (0.0, 1.5), integrator="dop853", rtol=1e-12)
    times = np.linspace(0.0, 1.5, 101)
    size = np.abs(other(times)).max(axis=1, keepdims=True)
    assert np.all(np.abs(solution(times) - other(times)) <= 100 * rtol * size)
    assert [event.target for event in solution.events] == [event.target for event in other.events]


@pytest.mark.parametrize("rate", ["1 if x == 0 else -x", "-sqrt(abs(x))"])
def test_what_jumps_inside_a_mode_is_refused(rate: str) -> None:
    """A series would follow one side past the jump, and say nothing."""
    model = hs.Model("jump", states=[hs.State("x", 1, der="v"), hs.State("v", 0, der=rate)])
    with pytest.raises(hs.UsageError, match="do not detect a jump"):
        hs.simulate(model, (0, 0.1), integrator="taylor")
    assert hs.simulate(model, (0, 0.1)).success


def test_a_condition_on_parameters_is_no_corner() -> None:
    model = hs.Model(
        "switch", states=[hs.State("x", 1, der="-x if k > 1 else x*min(k, 2)")], parameters={"k": 2}
    )
    assert hs.simulate(model, (0, 1), integrator="taylor")(1.0)[0] == pytest.approx(0.36787944117144233)


@pytest.mark.parametrize("has_monitor", [False, True])  # the compiled loop, and the general one
@pytest.mark.parametrize(("n", "rtol"), [(8, 1e-4), (14, 1e-6), (20, 1e-9), (24, 1e-11), (30, 1e-12)])
def test_a_rate_that_begins_flat_is_not_taken_for_rest(n: int, rtol: float, has_monitor: bool) -> None:
    """All terms of sin(pi t)**n vanish at t = 0, and the rate at t = 10; each turn is worth binom(n, n/2)/2**n."""
    model = hs.Model(
        "pulses",
        states=[
            hs.State("x", 0.0, f"sin(pi*t)**{n}"),
            hs.State("y", 0.0, f"sin(q)**{n}"),
            hs.State("q", 0.0, "pi"),
        ],
        monitors=[hs.Monitor("far", "x - 100")] if has_monitor else [],
    )
    sol = hs.simulate(model, (0, 10), integrator="taylor", rtol=rtol)
    turns = 10 * math.comb(n, n // 2) / 2**n
    assert sol(10.0)[:2] == pytest.approx([turns, turns], rel=300 * rtol)


@pytest.mark.parametrize("floor", [0.0, 1.0, 1000.0])
@pytest.mark.parametrize("rtol", [1e-9, 1e-11, 1e-12])
def test_a_small_hop_over_a_high_floor_is_one_step(floor, rtol):
    """Thrown up at w the ball is back after 2 w/g; the gap is a small difference of large terms."""
    model = hs.Model(
        "hop",
        states=[hs.State("h", floor, "w"), hs.State("w", 1e-3, "-10 + p")],
        impacts=[hs.Impact("p", gap=f"h - {floor}", restitution=0.3)],
    )
    sol = hs.simulate(model, (0.0, 2.5e-4), integrator="taylor", rtol=rtol)
    assert sol.event_times("p") == pytest.approx([2e-4], abs=1e-15 + 1e-12 * floor)
    assert sol.stats["steps"] == 2
