"""Models whose rates, guards and resets are Python functions, against closed forms and against expressions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system_cache import system_of
from running.python_flows import ball, bounces, fall, height, oscillator

TAKES_FUNCTIONS = ("dop853", "tsit5", "scipy-dop853", "scipy-rk45", "scipy-radau", "cvode-adams")


@pytest.mark.parametrize("integrator", TAKES_FUNCTIONS)
def test_a_bouncing_ball_meets_the_floor_at_the_times_of_its_closed_form(integrator: str) -> None:
    sol = hs.simulate(ball(), (0, 3), integrator=integrator)  # the seventh bounce comes at 3.12
    assert sol.success
    np.testing.assert_allclose([e.t for e in sol.events], bounces(6), atol=1e-8)
    assert all(e.x_plus[0] == 0.0 for e in sol.events)
    assert sum("differences of the Python functions" in w for w in sol.warnings) == 1


def test_cvode_bdf_runs_functions_with_a_jacobian_by_differences() -> None:
    sol = hs.simulate(ball(), (0, 1), integrator="cvode-bdf")
    np.testing.assert_allclose([e.t for e in sol.events], bounces(1), atol=1e-7)


def test_a_monitor_and_an_output_of_an_oscillator() -> None:
    sol = hs.simulate(oscillator(), (0, 6))
    assert sol.integrator == "dop853" and "Python function" in sol.message
    expected = np.arange(0.5 * math.pi / 3, 6, 2 * math.pi / 3)
    np.testing.assert_allclose(sol.event_times("zero"), expected, atol=1e-8)
    t = np.linspace(0, 6, 61)
    np.testing.assert_allclose(sol(t)[0], np.cos(3 * t), atol=1e-8)  # the dense output: series by differences
    np.testing.assert_allclose(sol.output("energy", t), 4.5, rtol=1e-7)


def test_copies_with_other_values_and_backward_runs() -> None:
    fast = oscillator().with_(w=5.0).with_start(x=2.0)
    sol = hs.simulate(fast, (0, 1))
    assert sol.y[0, -1] == pytest.approx(2.0 * math.cos(5.0), abs=1e-8)
    back = hs.simulate(fast, (1, 0), x0=sol.y[:, -1])
    np.testing.assert_allclose(back.y[:, -1], [2.0, 0.0], atol=1e-7)


def heat(t: float, x: Any, p: Any) -> Any:
    return (p.hot - x[0],)


def cool(t: float, x: Any, p: Any) -> Any:
    return (-x[0],)


def warm(t: float, x: Any, p: Any) -> Any:
    return p.high - x[0]


def cold(t: float, x: Any, p: Any) -> Any:
    return x[0] - p.low


def thermostat(start: float = 15.0, mode: str = "on", low: Any = None) -> hs.Model:
    on = hs.Mode("on", [hs.Guard("warm", warm, "off")], flow=heat)
    off = hs.Mode("off", [hs.Guard("cold", low or cold, "on")])
    return hs.Model(
        "thermostat",
        states={"T": start},
        parameters={"hot": 40.0, "low": 18.0, "high": 22.0},
        flow=cool,
        components=[hs.Component("heater", [on, off], initial=mode)],
    )


@pytest.mark.parametrize("integrator", ["dop853", "scipy-rk45", "cvode-adams"])
def test_a_thermostat_switches_at_the_times_of_its_closed_form(integrator: str) -> None:
    sol = hs.simulate(thermostat(), (0, 2), integrator=integrator)
    times = [math.log((40 - 15) / (40 - 22))]
    while times[-1] < 2:
        step = math.log(22 / 18) if len(times) % 2 else math.log((40 - 18) / (40 - 22))
        times.append(times[-1] + step)
    np.testing.assert_allclose([e.t for e in sol.events], times[:-1], atol=1e-8)
    assert [e.target for e in sol.events[:3]] == ["off", "on", "off"]


def test_a_start_on_a_guard_is_decided_by_its_derivative_along_the_flow() -> None:
    # at T = 22 in "on" the guard 22 - T is zero and falls: an immediate transition
    leaving = hs.simulate(thermostat(start=22.0), (0, 0.1))
    assert [(e.t, e.target) for e in leaving.events[:1]] == [(0.0, "off")]
    # at T = 18 in "on" nothing happens; at T = 22 in "off" the guard T - 18 is far away
    assert not hs.simulate(thermostat(start=18.0), (0, 0.1)).events
    # thrown up from the floor: zero and rising; only the second derivative tells for a start at rest
    assert not hs.simulate(ball(), (0, 0.1), x0={"h": 0.0, "w": 1.0}).events
    lifted = ball(flow=lambda t, x, p: (x[1], p.g))
    assert not hs.simulate(lifted, (0, 0.1), x0={"h": 0.0, "w": 0.0}).events


def test_the_third_derivative_decides() -> None:
    def jerk(t: float, x: Any, p: Any) -> Any:
        return x[1], p.jerk * t

    def still(t: float, x: Any, p: Any) -> Any:
        return 0.0, 0.0

    def changes(flow: Any, jerk_rate: float) -> list[float]:
        modes = [hs.Mode("up", [hs.Guard("g", height, "down")]), hs.Mode("down")]
        model = hs.Model(
            "jerk",
            states={"h": 0.0, "w": 0.0},
            parameters={"jerk": jerk_rate},
            flow=flow,
            components=[hs.Component("c", modes, initial="up")],
        )
        return [e.t for e in hs.simulate(model, (0, 1)).events]

    assert changes(jerk, -1.0) == [0.0]
    assert changes(jerk, 1.0) == []
    assert changes(still, 1.0) == []  # zero identically: no question of rounding


def test_a_velocity_inside_rounding_is_said_to_be_undecided() -> None:
    # the guard's value and all its derivatives are lost in the rounding of 1e6: h - 1e6 + 1e-12 t**4
    def slow(t: float, x: Any, p: Any) -> Any:
        return (-4e-13 * t**3 * p.one,)

    guard = hs.Guard("g", lambda t, x, p: x[0] - 1e6, "out")
    modes = [hs.Mode("in", [guard]), hs.Mode("out")]
    model = hs.Model(
        "slow",
        states={"h": 1e6},
        parameters={"one": 1.0},
        flow=slow,
        components=[hs.Component("c", modes, initial="in")],
    )
    sol = hs.simulate(model, (0, 1))
    assert any("undecided at rounding" in w for w in sol.warnings)
    assert all(e.t > 0.0 for e in sol.events)  # the mode is kept at the start


# -- series and Jacobians by differences --------------------------------------------------------------------


def decay_and_turn(t: float, x: Any, p: Any) -> Any:
    """Rates of x = exp(-t/T) and y = cos(2 pi t/T)."""
    w = 2.0 * math.pi / p.T
    return -x[0] / p.T, -w * math.sin(w * t)


def product(t: float, x: Any, p: Any) -> Any:
    return x[0] * x[1] - 0.5


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("t0", [0.0, 0.7, 12.5])
def test_series_by_differences_hold_the_exact_ones_within_their_bounds(scale: float, t0: float) -> None:
    # whole periods are tempting steps
    monitors = [hs.Monitor("g", product)]
    model = hs.Model(
        "m", states={"x": 1, "y": 1}, parameters={"T": scale}, flow=decay_and_turn, monitors=monitors
    )
    system = system_of(model)
    t, w = t0 * scale, 2.0 * math.pi
    x = np.array([math.exp(-t0), math.cos(w * t0)])
    p, z = system.vector(Instant(t), system.discrete_start), np.zeros(0, dtype=np.int64)
    found = system.series(0.0, x, p, z, 1e-16 * np.abs(x), 0.0)
    a = math.exp(-t0) * np.array([1.0, -1.0, 1.0 / 2.0, -1.0 / 6.0])
    c, s = math.cos(w * t0), math.sin(w * t0)
    b = np.array([c, -w * s, -(w**2) * c / 2.0, w**3 * s / 6.0])
    powers = scale ** np.arange(4.0)
    np.testing.assert_allclose(found.states * powers, [a, b], atol=1e-7)
    exact = np.convolve(a, b)[:4] - [0.5, 0.0, 0.0, 0.0]
    value, bound = found.monitors[0] * powers, found.monitor_bounds[0] * powers
    assert (np.abs(value - exact) <= bound).all()
    assert (bound[:3] < 1e-8).all() and bound[3] < 1e-4  # and the bounds are of use


def test_a_jacobian_by_differences() -> None:
    def flow(t: float, x: Any, p: Any) -> Any:
        return x[0] * x[1], math.sin(x[0]) - p.k * x[1]

    system = system_of(hs.Model("m", states={"x": 0, "y": 0}, parameters={"k": 1e4}, flow=flow))
    p, z = system.vector(Instant(0.0), system.discrete_start), np.zeros(0, dtype=np.int64)
    found = system.jacobian(0.0, np.array([0.3, 2e-5]), p, z)
    np.testing.assert_allclose(found, [[2e-5, 0.3], [math.cos(0.3), -1e4]], rtol=1e-8)


def test_auto_takes_a_stiff_method_where_the_jacobian_asks_for_one() -> None:
    def decay(t: float, x: Any, p: Any) -> Any:
        return (-1e8 * (x[0] - math.cos(t)),)

    sol = hs.simulate(hs.Model("stiff", states={"x": 1.0}, flow=decay), (0, 1))
    assert sol.integrator == "cvode-bdf" and "stability" in sol.message
    assert sol.y[0, -1] == pytest.approx(math.cos(1.0), abs=1e-6)


# -- what numba cannot compile ------------------------------------------------------------------------------


def test_functions_and_expressions_give_the_same_run() -> None:
    """A choice by condition, a reset by a monitor and a schedule, beside the same model in expressions."""
    texts: dict[str, Any] = {"near": "0.8 - h", "w": "-0.5*w", "slow": "-w < 2.5", "twice": "2*w"}
    functions: dict[str, Any] = {
        "near": lambda t, x, p: 0.8 - x[0],
        "w": lambda t, x, p: -0.5 * x[1],
        "slow": lambda t, x, p: -x[1] < 2.5,
        "twice": lambda t, x, p: 2.0 * x[1],
    }

    def run(given: dict[str, Any], floor: Any, **fields: Any) -> hs.Solution:
        choices = [
            hs.Choice("rest", given["slow"], {"h": 0, "w": 0}),
            hs.Choice("flight", reset={"h": 0, "w": given["w"]}),
        ]
        rest = hs.Mode("rest", **fields.pop("rest"))
        modes = [hs.Mode("flight", [hs.Guard("floor", floor, choices)]), rest]
        model = hs.Model(
            "hop",
            parameters={"g": 9.81},
            components=[hs.Component("ball", modes, initial="flight")],
            monitors=[hs.Monitor("near", given["near"], "up", "reset", {"w": given["twice"]})],
            schedules=[hs.Schedule("kick", times=[0.2], reset={"w": given["twice"]})],
            **fields,
        )
        return hs.simulate(model, (0, 2), integrator="dop853")

    still = {"der": {"h": "0", "w": "0"}}
    told = run(texts, "h", states=[hs.State("h", 1, "w"), hs.State("w", 0, "-g")], rest=still)
    stop = {"flow": lambda t, x, p: (0.0, 0.0)}
    done = run(functions, height, states={"h": 1, "w": 0}, flow=fall, rest=stop)
    assert [(e.kind, e.component, e.target) for e in done.events] == [
        (e.kind, e.component, e.target) for e in told.events
    ]
    assert len(done.events) >= 4
    np.testing.assert_allclose([e.t for e in done.events], [e.t for e in told.events], atol=1e-9)


def test_a_comparison_of_a_model_of_functions() -> None:
    """Two methods on a spring of known motion: x = cos(2 t)."""
    model = hs.Model(
        "spring", states={"x": 1.0, "v": 0.0}, parameters={"k": 4.0}, flow=lambda t, x, p: (x[1], -p.k * x[0])
    )
    comparison = hs.compare(
        model,
        t_span=(0, 5),
        integrators=["dop853", "exact"],
        rtols=[1e-8],
        repeat=1,
        reference=lambda t: np.array([np.cos(2 * np.asarray(t)), -2 * np.sin(2 * np.asarray(t))]),
    )
    done, refused = comparison.rows
    assert done.errors is not None and done.errors.state < 1e-7
    assert "declared as expressions" in refused.message
    assert "made of Python functions" in comparison.table() == str(comparison)
