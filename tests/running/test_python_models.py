"""Models whose rates, guards and resets are Python functions, against closed forms and against expressions."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.jit import ENABLED
from hybridsim.engine.recent import system_of
from hybridsim.engine.timepair import Instant

TAKES_FUNCTIONS = ("dop853", "tsit5", "scipy-dop853", "scipy-rk45", "scipy-radau", "cvode-adams")


def fall(t: float, x: Any, p: Any) -> Any:
    return x[1], -p.g


def height(t: float, x: Any, p: Any) -> Any:
    return x[0]


def rebound(t: float, x: Any, p: Any) -> Any:
    return -p.e * x[1]


def ball(**changes: Any) -> hs.Model:
    floor = hs.Guard("floor", height, hs.Choice("flight", reset={"h": 0.0, "w": rebound}))
    fields: dict[str, Any] = {
        "states": {"h": 1.0, "w": 0.0},
        "parameters": {"g": 9.81, "e": 0.8},
        "flow": fall,
        "components": [hs.Component("ball", [hs.Mode("flight", [floor])])],
    }
    return hs.Model("ball", **(fields | changes))


def bounces(count: int, g: float = 9.81, e: float = 0.8) -> np.ndarray:
    """Times at which a ball dropped from 1 meets the floor: each flight takes e times the one before."""
    first = math.sqrt(2.0 / g)
    return first + 2.0 * first * np.array([sum(e**j for j in range(1, k + 1)) for k in range(count)])


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


def oscillate(t: float, x: Any, p: Any) -> Any:
    rates = np.empty(2)
    rates[0] = x[1]
    rates[1] = -(p.w**2) * x[0]
    return rates


def oscillator(**changes: Any) -> hs.Model:
    fields: dict[str, Any] = {
        "states": {"x": 1.0, "v": 0.0},
        "parameters": {"w": 3.0},
        "flow": oscillate,
        "monitors": [hs.Monitor("zero", height, direction="down")],
        "outputs": {"energy": lambda t, x, p: 0.5 * (x[1] ** 2 + p.w**2 * x[0] ** 2)},
    }
    return hs.Model("oscillator", **(fields | changes))


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


def thermostat(start: float = 15.0, mode: str = "on", low: Any = None) -> hs.Model:
    on = hs.Mode("on", [hs.Guard("warm", lambda t, x, p: p.high - x[0], "off")], flow=heat)
    off = hs.Mode("off", [hs.Guard("cold", low or (lambda t, x, p: x[0] - p.low), "on")])
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


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("t0", [0.0, 0.7, 12.5])
def test_series_by_differences_hold_the_exact_ones_within_their_bounds(scale: float, t0: float) -> None:
    # x = exp(-t/T) and y = cos(2 pi t/T), so that whole periods are tempting steps; guard x y - 1/2
    def flow(t: float, x: Any, p: Any) -> Any:
        w = 2.0 * math.pi / p.T
        return -x[0] / p.T, -w * math.sin(w * t)

    product = hs.Monitor("g", lambda t, x, p: x[0] * x[1] - 0.5)
    model = hs.Model("m", states={"x": 1, "y": 1}, parameters={"T": scale}, flow=flow, monitors=[product])
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


class Spring:
    def __init__(self, k: float) -> None:
        self.table = {"k": k}

    def __call__(self, t: float, x: Any, p: Any) -> Any:
        return [x[1], -self.table["k"] * x[0]]


@pytest.mark.skipif(not ENABLED, reason="without the compiler every function runs in Python")
def test_functions_that_cannot_be_compiled_run_with_scipy_and_say_so() -> None:
    model = oscillator(flow=Spring(9.0))
    sol = hs.simulate(model, (0, 2))
    assert sol.integrator == "scipy-dop853" and "numba cannot compile" in sol.message
    assert any("called from Python" in w and "Spring" in w for w in sol.warnings)
    np.testing.assert_allclose(sol.y[0], np.cos(3 * sol.t), atol=1e-8)
    np.testing.assert_allclose(sol.event_times("zero"), math.pi / 6, atol=1e-8)
    for name in ("dop853", "cvode-adams"):
        with pytest.raises(hs.UsageError, match="numba cannot compile") as caught:
            hs.simulate(model, (0, 2), integrator=name)
        assert "scipy-dop853" in str(caught.value)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "rodas5p"])
def test_methods_that_need_a_tape_are_refused_with_the_reason(integrator: str) -> None:
    with pytest.raises(hs.UsageError, match="a tape, which is made from expressions"):
        hs.simulate(ball(), (0, 1), integrator=integrator)


# -- faults -------------------------------------------------------------------------------------------------


def three(t: float, x: Any, p: Any) -> Any:
    return 1.0, 2.0, 3.0


def words(t: float, x: Any, p: Any) -> Any:
    return "fast", "slow"


def row(t: float, x: Any, p: Any) -> Any:
    return x


def misspelt(t: float, x: Any, p: Any) -> Any:
    return x[1], -p.gravity


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (ball(flow=three), "the flow three returned tuple of shape .3,., and the model has 2 states"),
        (ball(flow=words), "the flow words returned .'fast', 'slow'."),
        (ball(flow=height), "the flow height returned 1.0, and the model has 2 states"),
        (oscillator(monitors=[hs.Monitor("m", row)]), "the function row returned ndarray of shape .2,."),
        (ball(flow=misspelt), "misspelt raised AttributeError: .*gravity"),
    ],
)
def test_what_a_function_returns_is_looked_at_before_the_run(model: hs.Model, message: str) -> None:
    with pytest.raises(hs.ModelError, match=message):
        hs.simulate(model, (0, 1), integrator="scipy-dop853")


@pytest.mark.parametrize("integrator", ["dop853", "scipy-dop853"])
def test_an_exception_in_the_run_is_told_with_the_name_of_the_function(integrator: str) -> None:
    def breaks(t: float, x: Any, p: Any) -> Any:
        if t > 0.5:
            raise ValueError("beyond the table")
        return x[1], -p.g

    sol = hs.simulate(ball(flow=breaks), (0, 1), x0={"h": 100.0}, integrator=integrator)
    assert not sol.success
    assert "the function breaks raised ValueError: beyond the table at t = 0.5" in sol.message
    assert sol.t[-1] == pytest.approx(0.5, abs=1e-6)


def test_a_rate_that_is_no_number_ends_the_run_and_names_the_states() -> None:
    sol = hs.simulate(ball(flow=lambda t, x, p: (x[1], math.nan)), (0, 1), integrator="dop853")
    assert sol.status == "step-failure" and "derivative of w" in sol.message


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"contacts": [hs.Contact("f", velocity="w", normal=1, law="coulomb", arguments={"mu": 1})]},
            "contacts",
        ),
        ({"definitions": {"k": "2*g"}}, "definitions"),
        ({"monitors": [hs.Monitor("low", "h - 0.5")]}, "monitor low is the expression 'h - 0.5'"),
        ({"states": [hs.State("h", 1, "w"), hs.State("w", 0, 0)]}, "state h has der = 'w'"),
    ],
)
def test_what_needs_expressions_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(hs.ModelError, match=message):
        ball(**fields).validate()


def test_functions_in_a_model_of_expressions_are_refused() -> None:
    states = [hs.State("x", 0, "1")]
    model = hs.Model("m", states=states, monitors=[hs.Monitor("high", height)])
    with pytest.raises(hs.ModelError, match="monitor high is the Python function height"):
        model.validate()
    with pytest.raises(hs.UsageError, match="states gives x no rate"):
        hs.Model("m", states={"x": 0})


def test_functions_cannot_be_written_to_toml() -> None:
    with pytest.raises(hs.UsageError, match="cannot be written to TOML"):
        ball().to_toml()


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
    assert "works on a tape" in refused.message
    assert "made of Python functions" in comparison.table() == str(comparison)


def test_a_function_of_other_arguments_is_told_what_it_is_called_with() -> None:
    """A flow as SciPy has it, of time and state alone."""
    model = hs.Model("turn", states={"x": 1.0, "v": 0.0}, flow=lambda t, x: (x[1], -x[0]))
    with pytest.raises(hs.ModelError, match=r"takes \(t, x\), and is called with \(t, x, p\)"):
        hs.simulate(model, (0, 1))


def raising(t: float, x: Any, p: Any) -> Any:
    return -1.0, 1.0 / max(x[0], 0.0)  # of a plain 0


def returning(t: float, x: Any, p: Any) -> Any:
    return -1.0, 1.0 / (0.5 * (x[0] + abs(x[0])))  # of a zero of NumPy's


@pytest.mark.parametrize("integrator", ["dop853", "scipy-rk45"])
@pytest.mark.parametrize(
    ("flow", "told"),
    [
        (raising, "the function raising raised ZeroDivisionError"),
        (returning, "the function returning returned (-1, inf); look there for a division by zero"),
    ],
)
def test_a_division_by_zero_in_a_flow_is_told_with_the_name_of_the_function(
    integrator: str, flow: Any, told: str
) -> None:
    """Compiled code raises at neither: what Python says of the same call is told."""
    sol = hs.simulate(hs.Model("drained", {"h": 1.0, "y": 0.0}, flow=flow), (0, 2), integrator=integrator)
    assert sol.status == "step-failure"
    assert told in sol.message


STIFFNESS: Any = 1.0
TABLE = np.array([1.0])


def by_a_global(t: float, x: Any, p: Any) -> Any:
    return x[1], -STIFFNESS * x[0]


def by_an_array(t: float, x: Any, p: Any) -> Any:
    return x[1], -TABLE[0] * x[0]


def by_a_closure() -> Any:
    k = 1.0

    def flow(t: float, x: Any, p: Any) -> Any:
        return x[1], -k * x[0]

    def change(value: float) -> None:
        nonlocal k
        k = value

    return flow, change


def test_what_functions_read_from_outside_is_what_it_is_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """x'' = -k x: x(5) = cos(5 sqrt(k)), with k changed between runs of one model and of another like it."""
    closed, change = by_a_closure()
    monkeypatch.setattr(f"{__name__}.TABLE", np.array([1.0]))
    flows = (by_a_global, by_an_array, closed)
    models = [hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=flow) for flow in flows]
    for k in (1.0, 4.0):
        monkeypatch.setattr(f"{__name__}.STIFFNESS", k)
        TABLE[0] = k
        change(k)
        for model in (*models, *(hs.Model("swing", states=m.states, flow=m.flow) for m in models[:1])):
            for integrator in ("dop853", "dop853", "scipy-dop853"):
                sol = hs.simulate(model, (0, 5), integrator=integrator, rtol=1e-10)
                assert sol.y[0, -1] == pytest.approx(math.cos(5 * math.sqrt(k)), abs=1e-7)


def pull(x: float) -> float:
    return -STIFFNESS * doubled(x) / 2.0


def doubled(x: float) -> float:
    return 2.0 * x if x < 1e300 else doubled(0.5 * x)  # calls itself


def by_helpers(t: float, x: np.ndarray, p: Any) -> tuple[float, float]:
    return x[1], pull(x[0])


def by_a_local_helper() -> Callable[..., Any]:
    def spring(x: float) -> float:
        return pull(x)

    return lambda t, x, p: (x[1], spring(x[0]))


SETTINGS = ModuleType("settings")


def by_a_default(x: float, force: float = 0.0) -> float:
    return force


def by_a_module(t: float, x: Any, p: Any) -> Any:
    return x[1], by_a_default(x[0]) - SETTINGS.K * x[0]


@pytest.mark.parametrize("make", [lambda: by_helpers, by_a_local_helper])
def test_plain_functions_that_it_calls_are_compiled_along_with_it(
    make: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=make())
    for k in (1.0, 4.0):  # what a helper reads from outside is what it is now
        monkeypatch.setattr(f"{__name__}.STIFFNESS", k)
        sol = hs.simulate(model, (0, 5), integrator="dop853", rtol=1e-10)
        assert sol.y[0, -1] == pytest.approx(math.cos(5 * math.sqrt(k)), abs=1e-7)
        assert not sol.warnings


def test_helpers_without_a_module_and_of_the_name_of_a_global() -> None:
    def spring(x: float) -> float:
        return -4.0 * x

    spring.__module__ = None  # type: ignore[assignment]  # as sympy.lambdify makes them
    pull = 0.0  # a number of the name of a global function

    def flow(t: float, x: Any, p: Any) -> Any:
        return x[1], spring(x[0]) + pull

    model = hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=flow)
    for integrator in ("dop853", "scipy-dop853"):
        sol = hs.simulate(model, (0, 5), integrator=integrator, rtol=1e-10)
        assert sol.y[0, -1] == pytest.approx(math.cos(10.0), abs=1e-7)


def test_what_is_read_of_a_module_and_defaults_are_what_they_are_now() -> None:
    model = hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=by_a_module)
    for k, g in ((1.0, 0.0), (4.0, 0.0), (4.0, 4.0)):
        SETTINGS.K = k  # type: ignore[attr-defined]  # made for the test
        by_a_default.__defaults__ = (g,)
        sol = hs.simulate(model, (0, 5), integrator="dop853", rtol=1e-10)
        assert sol.y[0, -1] == pytest.approx(g / k + (1.0 - g / k) * math.cos(5 * math.sqrt(k)), abs=1e-7)


def test_a_flow_with_a_default_is_called_from_python() -> None:
    def flow(t: float, x: Any, p: Any, k: float = 4.0) -> Any:
        return x[1], -k * x[0]

    sol = hs.simulate(hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=flow), (0, 5), rtol=1e-10)
    assert sol.y[0, -1] == pytest.approx(math.cos(10.0), abs=1e-7)
    assert any("called from Python" in text for text in sol.warnings)


def test_nothing_is_compiled_again_as_long_as_nothing_outside_has_changed() -> None:
    model = hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=by_an_array)
    assert system_of(model) is system_of(model)
