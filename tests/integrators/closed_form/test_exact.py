"""Closed forms of linear modes: runs against closed forms and multiple precision, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs


def oscillator(rate: str, guard: str = "", **parts: object) -> hs.Model:
    """v' = rate, with a guard of a first mode."""
    first = hs.Mode("a", guards=[hs.Guard("g", guard, "b")] if guard else [])
    return hs.Model(
        "m",
        states=[hs.State("x", 1, "v"), hs.State("v", 0, rate)],
        parameters={"k": 4},
        components=[hs.Component("c", modes=[first, hs.Mode("b")], initial="a")],
        **parts,
    )


@pytest.mark.parametrize(("F0", "ratio"), [(30.0, 0.6), (22.0, 0.64)])
def test_a_hundred_periods_of_dry_friction_to_rounding(F0: float, ratio: float) -> None:
    """Event times and states against the closed form in 30 digits."""
    model = hs.load("dfcs").with_(F0=F0, omega=ratio * math.sqrt(1e5 / 0.2))
    omega = model.parameter_values()["omega"]
    period = 2 * math.pi / omega
    exact = Oscillator(0.2, 5.65, 1e5, 20, 20, F0, omega, numbers=multiprecision(30)).run(0, 100 * period, 0)
    solution = hs.simulate(model, (0, 100 * period), integrator="exact")
    modes = {"stick": 0, "slip+": 1, "slip-": -1}
    assert [modes[event.target] for event in solution.events] == [change.mode for change in exact.changes]
    amplitude = float(exact.amplitude(99 * period, 100 * period))
    for event, change in zip(solution.events, exact.changes, strict=True):
        assert abs(event.t - change.t) <= 1e-13 * period
        assert abs(event.x_plus[0] - change.x) <= 1e-12 * amplitude
    for t in np.linspace(99 * period, 100 * period, 41):
        x, v, _ = exact.state(mpmath.mpf(float(t)))
        assert np.abs(solution(t) - [float(x), float(v)]).max(initial=0.0) <= 1e-12 * amplitude * omega
        assert abs(solution(t)[0] - float(x)) <= 1e-12 * amplitude


@pytest.mark.parametrize(
    ("rate", "reason"),
    [
        ("-x*v", "a product of states"),
        ("-x*t", "a product of a state and a function of time"),
        ("-x*sin(t)", "a product of a state and a function of time"),
        ("-x/(1 + t)", "a division by a state or by a function of time"),
        ("-sqrt(x)", "a square root of a state or of a function of time"),
        ("-sin(x)", "a sine or an exponential whose argument is not linear in time"),
        ("sin(t**2) - x", "a sine or an exponential whose argument is not linear in time"),
        ("-tanh(v)", "a tangent or a tanh of a state or of time"),
        ("sinh(x)", "a hyperbolic function of a state or of time"),
        ("-x if x == 0 else -v", "a corner, a jump or another nonlinear function of a state or of time"),
        ("t**9 - x", "a product of more than 8 functions of time"),
    ],
)
def test_what_is_not_linear_is_refused_with_the_reason(rate: str, reason: str) -> None:
    with pytest.raises(hs.UsageError, match=f"the rate of v has {reason}"):
        hs.simulate(oscillator(rate), (0, 1), integrator="exact")


@pytest.mark.parametrize("guard", ["x*v + 1", "x + t*x", "sin(x) + 0.5"])
def test_a_guard_that_is_not_linear_is_refused_by_name(guard: str) -> None:
    with pytest.raises(hs.UsageError, match="guard g of c in mode a has"):
        hs.simulate(oscillator("-x", guard), (0, 1), integrator="exact")


def test_functions_of_a_jump_are_constant_on_its_sides() -> None:
    """x = 1 - e t^2/2 down to zero at sqrt(2/e), where v = -sqrt(2 e); from there on v' = -1/e."""
    sol = hs.simulate(oscillator("-exp(sign(x))"), (0, 2), x0=[1, 0], integrator="exact")
    down = math.sqrt(2.0 / math.e)
    left = 2.0 - down
    v = -math.sqrt(2.0 * math.e)
    assert sol.success
    assert sol(down)[0] == pytest.approx(0.0, abs=1e-15)
    assert sol(2.0) == pytest.approx([v * left - left**2 / (2 * math.e), v - left / math.e], rel=1e-14)


def test_a_close_pair_is_found_and_its_second_zero_is_where_it_belongs() -> None:
    """g = cos(t) + 1 - depth is zero at pi -+ acos(1 - depth); the pair is one mode apart."""
    up = hs.Mode("up", guards=[hs.Guard("g", "c + 1 - depth", "down")])
    down = hs.Mode("down", guards=[hs.Guard("g", "depth - c - 1", "up")])
    model = hs.Model(
        "dip",
        states=[hs.State("c", 1, "-s"), hs.State("s", 0, "c")],
        parameters={"depth": 1e-2},
        components=[hs.Component("m", modes=[up, down], initial="up")],
    )
    for depth in (1e-2, 1e-5, 1e-8, 1e-11, 1e-13):
        solution = hs.simulate(model.with_(depth=depth), (0, 5), integrator="exact")
        with mpmath.workdps(30):
            apart = float(mpmath.acos(1 - mpmath.mpf(depth)))
        # beyond the slope, the rounding of 1 - depth moves the zeros as well
        close = 4e-15 / apart + 2e-15
        assert [event.t for event in solution.events if event.kind == "transition"] == pytest.approx(
            [math.pi - apart, math.pi + apart], abs=close
        ), depth


def test_a_discrete_state_that_enters_linearly_is_right_after_a_reset() -> None:
    """x'' = q - x: each reset of q starts a cosine about the new q."""
    model = oscillator(
        "q - x",
        discrete=[hs.Discrete("q", 1)],
        schedules=[hs.Schedule("s", times=[1.0], reset={"q": "x + 2"})],
    )
    solution = hs.simulate(model, (0, 2.5), integrator="exact")
    assert solution(0.7) == pytest.approx([1.0, 0.0], abs=1e-15)
    assert solution(2.5) == pytest.approx([3 - 2 * math.cos(1.5), 2 * math.sin(1.5)], rel=1e-14)


def test_backward_undoes_forward() -> None:
    model = oscillator("-k*x + t**2*exp(-t)*sin(2*t)")
    forward = hs.simulate(model, (0, 3), integrator="exact")
    back = hs.simulate(model.with_start(x=forward.y[0, -1], v=forward.y[1, -1]), (3, 0), integrator="exact")
    assert back(0.0) == pytest.approx([1.0, 0.0], abs=1e-13)
    assert back(1.5) == pytest.approx(forward(1.5), abs=1e-13)


def test_impacts_that_accumulate_are_said_to() -> None:
    """The ball's flights are 2 e**k sqrt(2 h/g); their sum is finite."""
    floor = hs.Guard("floor", "h", [hs.Choice("flight", reset={"h": "0", "w": "-0.5*w"})])
    model = hs.Model(
        "ball",
        states=[hs.State("h", 1, "w"), hs.State("w", 0, "-9.81")],
        components=[hs.Component("b", modes=[hs.Mode("flight", guards=[floor])])],
    )
    solution = hs.simulate(model, (0, 5), integrator="exact")
    assert solution.status == "accumulation"
    fall, expected = math.sqrt(2 / 9.81), []
    t = fall
    for k in range(12):
        expected.append(t)
        t += 2 * fall * 0.5 ** (k + 1)
    assert [event.t for event in solution.events[:12]] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("rate", "end"), [(2, 400), (20, 40), (100, 8), (200, 3.55), (200, 4)])
def test_a_load_that_grows_from_less_than_doubles_hold(rate: float, end: float) -> None:
    """x' = -x + exp(k (t - T)): x(T) = exp(-T) + (1 - exp(-(k + 1) T))/(k + 1), of a load exp(-k T) at the start."""
    sol = hs.simulate(
        hs.Model("late", [hs.State("x", 1, f"-x + exp({rate}*(t - {end}))")]), (0, end), integrator="exact"
    )
    expected = math.exp(-end) + (1 - math.exp(-(rate + 1) * end)) / (rate + 1)
    assert sol.success and sol.y[0, -1] == pytest.approx(expected, rel=1e-12)


def test_an_event_by_a_load_that_was_nothing() -> None:
    """x = exp(-t) + 100/51 exp(50 (t - 18)) passes 1.1 near 18 + log(1.1*51/100)/50; one Newton step from there."""
    low = hs.Mode("low", hs.Guard("up", "1.1 - x", "high"))
    model = hs.Model(
        "late",
        [hs.State("x", 1, "-x + 100*exp(50*(t - 18))")],
        components=[hs.Component("a", [low, hs.Mode("high")], "low")],
    )
    guess = 18 + math.log(1.1 * 51 / 100) / 50
    expected = guess - math.exp(-guess) / (50 * 1.1)
    assert hs.simulate(model, (0, 19), integrator="exact").event_times("a") == pytest.approx(
        [expected], abs=1e-13
    )


def test_growth_to_the_end_of_doubles_is_told() -> None:
    """x' = 200 x: from 1e-300 it is exp(800) larger at 4; from 1 it leaves doubles before."""
    small = hs.simulate(hs.Model("growth", [hs.State("x", 1e-300, "200*x")]), (0, 4), integrator="exact")
    assert small.success and math.log(small.y[0, -1]) == pytest.approx(800 - 300 * math.log(10), rel=1e-13)
    large = hs.simulate(hs.Model("growth", [hs.State("x", 1, "200*x")]), (0, 4), integrator="exact")
    assert large.status == "step-failure" and "grow without bound" in large.message


def test_growth_over_many_stretches_is_the_closed_form() -> None:
    """x'' - 2 a x' + x = 0 grows by exp(600): its closed form in 40 digits; a fast decay beside it costs nothing."""
    growth = hs.Model(
        "growth", [hs.State("x", 1, "v"), hs.State("v", 0, "0.01*v - x"), hs.State("y", 1, "-1e4*y")]
    )
    sol = hs.simulate(growth, (0, 120_000), integrator="exact")
    assert sol.stats["steps"] < 10
    with mpmath.workdps(40):
        a = mpmath.mpf(0.01) / 2
        w = mpmath.sqrt(1 - a * a)
        for t in (20_000, 60_000, 90_000, 120_000):
            expected = mpmath.cos(w * t) - a / w * mpmath.sin(w * t)
            assert float(mpmath.mpf(sol(t)[0]) / mpmath.e ** (a * t) - expected) == pytest.approx(
                0, abs=1e-10
            )


def test_what_goes_by_series_stays_at_rounding() -> None:
    """A monitor takes the run out of closed forms: after 4000 turns still cos(t)."""
    model = hs.Model(
        "o", [hs.State("x", 1, "v"), hs.State("v", 0, "-x")], monitors=[hs.Monitor("far", "x - 5")]
    )
    sol = hs.simulate(model, (0, 25_000), integrator="exact")
    assert sol.y[0, -1] == pytest.approx(math.cos(25_000), abs=2e-10)


@pytest.mark.parametrize("seed", range(1, 9))
def test_a_decision_does_not_hang_on_the_last_bits_of_a_basis(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A body creeps to rest: its velocity fades below what rounding of the basis makes of a part that stays.

    An eigenvector is known to rounding of its largest entry. Whatever that makes of the velocity, it stops.
    """
    from hybridsim.engine.linear import units

    made = units.modals

    def otherwise_rounded(*given: Any, **named: Any) -> Any:
        (flows, widest), noise = made(*given, **named), np.random.default_rng(seed)
        basis = flows.full_basis
        entries = 2.0**-53 * np.abs(basis).max(axis=1, keepdims=True) * noise.integers(-2, 3, basis.shape)
        basis += entries
        return flows, widest

    monkeypatch.setattr(units, "modals", otherwise_rounded)
    # a value of its own, for which no tables are kept
    sol = hs.simulate("pid-servo", (0, 40), params={"ki": 200 + seed / 1024}, integrator="exact")
    assert sol.status == "finished" and sol.events[-1].target == "stick"
    assert sol(40.0)[1] == 0.0


BESIDE_A_CORNER = """
[states]
v = { start = 1.8, der = -1 }
[discrete]
k = 0.5
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "v - 1", then = [{ to = "off" }] }
[components.a.modes.off]
guards.g = { expr = "0.5 + (v if v > 0 else k*v)", then = [{ to = "out" }] }
[components.a.modes.out]
"""


def test_auto_leaves_a_mode_that_is_not_linear_beyond_a_corner_to_another_method() -> None:
    """v = 1.8 - t is 1 at 0.8 and -1 at 2.8, where half of it makes the second guard zero."""
    model = hs.Model.from_toml(BESIDE_A_CORNER)
    run = hs.simulate(model, (0, 4), integrator="auto")
    assert run.status == "finished"
    assert run.event_times("a") == pytest.approx([0.8, 2.8], abs=1e-9)
    linear = hs.Model.from_toml(BESIDE_A_CORNER.replace("k*v", "v/2"))
    run = hs.simulate(linear, (0, 4), integrator="auto")
    assert "exact" in run.message and run.event_times("a") == pytest.approx([0.8, 2.8], abs=1e-14)
