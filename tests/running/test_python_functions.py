"""Python functions of a model: which are compiled, what they read from outside, and what is said of faulty ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.system.system_cache import system_of
from running.python_flows import ball, height, oscillator


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
    assert any("uncompiled Python" in w and "Spring" in w for w in sol.warnings)
    np.testing.assert_allclose(sol.y[0], np.cos(3 * sol.t), atol=1e-8)
    np.testing.assert_allclose(sol.event_times("zero"), math.pi / 6, atol=1e-8)
    for name in ("dop853", "cvode-adams"):
        with pytest.raises(hs.UsageError, match="numba cannot compile") as caught:
            hs.simulate(model, (0, 2), integrator=name)
        assert "scipy-dop853" in str(caught.value)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "rodas5p"])
def test_methods_that_need_a_tape_are_refused_with_the_reason(integrator: str) -> None:
    with pytest.raises(hs.UsageError, match="it needs rates that are declared as expressions"):
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
        (ball(flow=three), "the flow three must return 2 numbers, but returned tuple of shape .3,."),
        (ball(flow=words), "the flow words must return 2 numbers, but returned .'fast', 'slow'."),
        (ball(flow=height), "the flow height must return 2 numbers, but returned 1.0"),
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
    assert sol.status == "step-failure" and "rate of w" in sol.message


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
    with pytest.raises(hs.UsageError, match="the state 'x' has no rate"):
        hs.Model("m", states={"x": 0})


def test_functions_cannot_be_written_to_toml() -> None:
    with pytest.raises(hs.UsageError, match="cannot be written to TOML"):
        ball().to_toml()


def test_a_function_of_other_arguments_is_told_what_it_is_called_with() -> None:
    """A flow as SciPy has it, of time and state alone."""
    model = hs.Model("turn", states={"x": 1.0, "v": 0.0}, flow=lambda t, x: (x[1], -x[0]))
    with pytest.raises(hs.ModelError, match=r"takes \(t, x\), but is called with \(t, x, p\)"):
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
        (returning, "the function returning returned (-1, inf); look for a division by zero there"),
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
    assert any("uncompiled Python" in text for text in sol.warnings)


def test_nothing_is_compiled_again_as_long_as_nothing_outside_has_changed() -> None:
    model = hs.Model("swing", states={"x": 1.0, "v": 0.0}, flow=by_an_array)
    assert system_of(model) is system_of(model)
