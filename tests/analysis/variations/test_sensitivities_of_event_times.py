"""Derivatives where events accumulate, share an instant, or are recorded only. All are closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

INTEGRATORS = ["taylor", "dop853"]
G, E, H, Q, END = 9.81, 0.5, 1.0, 2.0, 3.0
T = math.sqrt(2.0 * H / G) * (1.0 + E) / (1.0 - E)  # the ball's last bounce; it moves by T/(2 H) with H
BEHIND = math.exp(END - T)


def ball(reset: Mapping[str, str], floor: str = "floor", *others: hs.Component) -> hs.Model:
    """A ball comes to rest at T; y grows by 1/2 per unit of time until then, and y' = 1 + y afterwards."""
    bounce = hs.Guard(floor, "h", hs.Choice("fly", reset={"h": "0", "w": "-e*w"}))
    rest = hs.Mode("rest", der={"h": 0, "w": 0, "y": "1 + y"})
    return hs.Model(
        "ball",
        states=[
            hs.State("h", "h0", "w"),
            hs.State("w", 0, "-g"),
            hs.State("y", 1, 0.5),
            hs.State("u", 1, "-u"),
        ],
        parameters={"g": G, "e": E, "h0": H, "q": Q},
        components=[
            hs.Component(
                "ball",
                [hs.Mode("fly", bounce), rest],
                initial="fly",
                limit=hs.Choice("rest", reset=dict(reset)),
            ),
            *others,
        ],
    )


# the reset, y behind the limit, and its derivatives by y before it, by q and by the time of the limit
RESETS: Mapping[str, tuple[float, float, float, float]] = {
    "2": (2.0, 0.0, 0.0, 0.0),
    "q": (Q, 0.0, 1.0, 0.0),
    "+= q": (1.0 + 0.5 * T + Q, 1.0, 1.0, 0.0),
    "q*y": (Q * (1.0 + 0.5 * T), Q, 1.0 + 0.5 * T, 0.0),
    "q*t": (Q * T, 0.0, T, Q),
}


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("reset", RESETS)
def test_the_reset_of_a_limit(reset: str, integrator: str) -> None:
    """y(3) = (1 + y+) exp(3 - T) - 1, with y- = 1 + T/2."""
    after, by_y, by_q, by_t = RESETS[reset]
    solution = hs.simulate(ball({"y": reset}), (0, END), integrator=integrator)
    assert solution.y[2, -1] == pytest.approx((1.0 + after) * BEHIND - 1.0, rel=1e-9)
    found = hs.sensitivities(solution, ["h0", "q"])
    by_h0 = (by_t + 0.5 * by_y - 1.0 - after) * BEHIND * T / (2.0 * H)
    assert found.by_parameter[2] == pytest.approx([by_h0, by_q * BEHIND], rel=1e-8)
    assert found.by_start[2, 2] == pytest.approx(by_y * BEHIND, rel=1e-8)


def test_what_the_reset_of_a_limit_sets_off() -> None:
    """At T y becomes 3 q and u grows by it: u(3) = exp(-3) + 3 q exp(T - 3)."""
    grow = hs.Guard("up", "5 - y", hs.Choice("high", reset={"u": "u + y"}))
    other = hs.Component("other", [hs.Mode("low", grow), hs.Mode("high")], initial="low")
    found = hs.sensitivities(hs.simulate(ball({"y": "3*q"}, "floor", other), (0, END)), ["h0", "q"])
    expected = [3.0 * Q / BEHIND * T / (2.0 * H), 3.0 / BEHIND]
    assert found.by_parameter[3] == pytest.approx(expected, rel=1e-8)
    assert found.by_start[3, 3] == pytest.approx(math.exp(-END), rel=1e-9)


def test_a_guard_with_the_name_of_a_limit_is_refused() -> None:
    with pytest.raises(UsageError, match="guard limit of ball"):
        hs.sensitivities(hs.simulate(ball({"y": "2"}, "limit"), (0, END)))


def dosed(*schedules: hs.Schedule) -> hs.Model:
    states = [hs.State("x", 0, "-x")]
    return hs.Model("doses", states=states, parameters={"T1": 1.0, "T2": 1.0}, schedules=list(schedules))


def dose(name: str, **at: object) -> hs.Schedule:
    return hs.Schedule(name, reset={"x": "+= 1"}, **at)


COINCIDING: Mapping[str, Callable[[], hs.Model]] = {
    "one schedule": lambda: dosed(dose("a", times=["T1", "T2"])),
    "one schedule of three": lambda: dosed(dose("a", times=["T1", 1, "T1"])),
    "two schedules": lambda: dosed(dose("a", times=["T1"]), dose("b", times=["T2"])),
    "a clock": lambda: dosed(dose("a", times=["T1"]), dose("b", start="T2/2", period="T2/2", count=2)),
}


@pytest.mark.parametrize("case", COINCIDING)
def test_equal_times_that_move_apart_are_refused(case: str) -> None:
    solution = hs.simulate(COINCIDING[case](), (0, 3))
    with pytest.raises(UsageError, match="separate after a small change"):
        hs.sensitivities(solution)


def test_equal_times_that_move_together() -> None:
    """x(3) = 2 exp(T1 - 3), and the last dose is at a time of its own."""
    solution = hs.simulate(dosed(dose("a", times=["T1", "T1", "2*T2"])), (0, 3))
    found = hs.sensitivities(solution)
    assert found.by_parameter[0] == pytest.approx([2.0 * math.exp(-2.0), 2.0 * math.exp(-1.0)], rel=1e-9)


def test_a_second_schedule_that_moves_off_the_start_is_refused() -> None:
    solution = hs.simulate(dosed(dose("a", times=[1]), dose("b", times=["T2"])), (1, 3))
    assert solution.y[0, -1] == pytest.approx(2.0 * math.exp(-2.0), rel=1e-9)
    with pytest.raises(UsageError, match="b has an event at the start"):
        hs.sensitivities(solution)


def crossing(size: float, second: str) -> hs.Model:
    """Two guards that are zero at t = 1: the first does not depend on E."""
    parts = [
        hs.Component(
            name,
            [hs.Mode("a", hs.Guard("g", guard, "b"), set={rate: 0}), hs.Mode("b", set={rate: 1})],
            initial="a",
        )
        for name, guard, rate in (("P", "1 - x", "b"), ("Q", second, "c"))
    ]
    states = [hs.State("x", 0, 1), hs.State("y", 0, "b"), hs.State("z", 0, "c")]
    return hs.Model("crossing", states=states, parameters={"E": size, "m": 0.7}, components=parts)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_coinciding_guards_that_move_apart_by_a_parameter_of_any_size(size: float) -> None:
    solution = hs.simulate(crossing(size, f"E/{size!r} - x"), (0, 1.5))
    with pytest.raises(UsageError, match="separate after a small change"):
        hs.sensitivities(solution, ["E"])
    assert hs.sensitivities(solution, ["m"]).by_parameter[:, 0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_coinciding_guards_that_move_together(size: float) -> None:
    """The second is the first times E + m, and m's own effect cancels: y(3/2) = z(3/2) = 1/2 + x0."""
    solution = hs.simulate(crossing(size, "(E + m)*(m/m - x)"), (0, 1.5))
    found = hs.sensitivities(solution)
    assert found.by_start[:, 0] == pytest.approx([1.0, 1.0, 1.0], rel=1e-12)
    assert np.abs(found.by_parameter * [size, 0.7]).max() < 1e-12


def test_a_recorded_monitor_is_among_the_times() -> None:
    """x = (1 + x0) exp(t) - 1 with x0 = 0 reaches c at log(1 + c), 2 c at log(1 + 2 c)."""
    model = hs.Model(
        "recorded",
        states=[hs.State("x", 0, "a + x")],
        parameters={"a": 1.0, "c": 2.0},
        monitors=[hs.Monitor("first", "x - c"), hs.Monitor("second", "x - 2*c")],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 2), rtol=1e-12))
    assert found.times == pytest.approx([math.log(3.0), math.log(5.0)], rel=1e-11)
    # x = a (exp(t) - 1) + x0 exp(t) and x' = a + x: dt = (dc - x/a da - exp(t) dx0)/(a + x)
    assert found.times_by_parameter == pytest.approx(np.array([[-2 / 3, 1 / 3], [-4 / 5, 2 / 5]]), rel=1e-9)
    assert found.times_by_start[:, 0] == pytest.approx([-1.0, -1.0], rel=1e-9)
    assert found.by_parameter[0] == pytest.approx([math.exp(2.0) - 1.0, 0.0], rel=1e-9)


def test_a_monitor_that_is_recorded_in_stick_reads_the_belt() -> None:
    """The block goes with the belt at v = p t: x = p t^2/2 reaches c at sqrt(2 c/p)."""
    declared = hs.Model.from_toml(
        """schema = 1
name = "carried"
parameters = { p = 0.5, c = 1.0 }
states.x = { start = 0, der = "v" }
states.v = { start = 0, der = "-f" }
contacts.f = { velocity = "v - p*t", normal = 10, law = { name = "coulomb", mu = 1 } }
monitors.far = { expr = "x - c" }
"""
    )
    found = hs.sensitivities(hs.simulate(declared, (0, 3)), ["p", "c"])
    assert found.times == pytest.approx([2.0], rel=1e-12)
    assert found.times_by_parameter[0] == pytest.approx([-2.0, 1.0], rel=1e-9)
