"""What `simulate` accepts and refuses, and that its arguments do what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError
from hybridsim.model import Monitor, Parameter, Schedule, State

E = math.e


def decay(**more: object) -> hs.Model:
    """x' = -x from 1: x(t) = exp(-t)."""
    return hs.Model("decay", states=(State("x", 1, "-x"),), **more)


@pytest.mark.parametrize(
    "integrator", ["dop853", "exact", "scipy-dop853", "scipy-rk45", "cvode-adams", "cvode-bdf"]
)
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_the_error_follows_the_tolerance(integrator: str, rtol: float) -> None:
    sol = hs.simulate(decay(), (0, 3), integrator=integrator, rtol=rtol)
    # CVODE controls local errors only: its documentation speaks of tens of rtol over a run
    assert abs(sol(3.0)[0] - math.exp(-3)) <= 100 * rtol


def test_an_output_grid_changes_nothing_but_the_output() -> None:
    model = hs.load("bouncing-ball")
    free = hs.simulate(model, (0, 3))
    gridded = hs.simulate(model, (0, 3), t_eval=np.linspace(0, 3, 7))
    assert [(e.t, e.target) for e in free.events] == [(e.t, e.target) for e in gridded.events]
    assert gridded.t.tolist() == np.linspace(0, 3, 7).tolist()
    assert gridded.y.shape == (2, 7)
    assert (gridded.y == free(gridded.t)).all()
    assert free.stats["steps"] == gridded.stats["steps"]


def test_parameters_may_be_expressions_of_others() -> None:
    model = decay(parameters=(Parameter("a", 2), Parameter("b", "3*a")))
    assert hs.simulate(model, (0, 0), params={"b": "a + 1"}).model.parameter_values()["b"] == 3.0


def test_x0_by_name_or_in_order() -> None:
    assert hs.simulate(decay(), (0, 1), x0={"x": E}, rtol=1e-12)(1.0)[0] == pytest.approx(1, abs=1e-10)
    assert hs.simulate(decay(), (0, 1), x0=[E], rtol=1e-12)(1.0)[0] == pytest.approx(1, abs=1e-10)


def test_max_step_is_respected() -> None:
    sol = hs.simulate(decay(), (0, 1), integrator="dop853", max_step=0.01)
    assert np.diff(sol.t).max() <= 0.01 * (1 + 1e-12)
    assert sol.stats["steps"] >= 100


def test_a_schedule_fires_after_t0_and_its_first_time_also_at_t0() -> None:
    ticks = Schedule("tick", start=0, period=1, reset={"x": "x + 1"})
    sol = hs.simulate(hs.Model("count", states=(State("x", 0, "0"),), schedules=(ticks,)), (0, 3))
    assert [e.t for e in sol.events] == [0.0, 1.0, 2.0, 3.0]
    assert sol(3.0)[0] == 4.0
    assert sol(3.0, side="-")[0] == 3.0
    later = hs.simulate(sol.model, (1, 3), x0=[2.0])
    assert [e.t for e in later.events] == [2.0, 3.0]


def test_a_run_ends_at_a_terminating_monitor() -> None:
    monitor = Monitor("half", "x - 0.5", "down", "terminate")
    sol = hs.simulate(decay(monitors=(monitor,)), (0, 10), rtol=1e-12)
    assert sol.status == "terminated" and sol.success
    assert sol.t_end == pytest.approx(math.log(2), abs=1e-11)
    assert "half" in sol.message


def test_progress_reaches_one() -> None:
    seen: list[float] = []
    hs.simulate(decay(), (0, 2), progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"t_span": (0, math.inf)}, ["t_span", "inf"]),
        ({"t_span": (0,)}, ["t_span"]),
        ({"params": {"a": 1}}, ["a"]),
        ({"x0": {"y": 1}}, ["y", "x"]),
        ({"x0": [1, 2]}, ["2 values", "1 states"]),
        ({"x0": {"x": math.nan}}, ["x", "nan"]),
        ({"z0": {"f": "stick"}}, ["f"]),
        ({"integrator": "dop583"}, ["dop583", "dop853"]),
        ({"rtol": 0}, ["rtol", "0"]),
        ({"rtol": 1e-17}, ["rtol", "1e-17"]),
        ({"atol": -1.0}, ["atol", "-1"]),
        ({"atol": {"q": 1.0}}, ["q", "x"]),
        ({"max_step": 0}, ["max_step", "0"]),
        ({"first_step": -1}, ["first_step", "-1"]),
        ({"t_eval": [0, 5]}, ["t_eval"]),
        ({"steps_per_period": 10}, ["steps_per_period", "option"]),
        ({"integrator": "rk4-dichotomy"}, ["period", "step"]),
        ({"integrator": "rk4-sign", "step": 0.1, "t_span": (1, 0)}, ["rk4-sign", "past"]),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments: dict[str, object], words: list[str]) -> None:
    given = {"t_span": (0, 1)} | arguments
    with pytest.raises(UsageError) as caught:
        hs.simulate(decay(), **given)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "integrator", ["dop853", "exact", "scipy-dop853", "scipy-rk45", "cvode-adams", "cvode-bdf"]
)
def test_a_jump_of_the_load_frees_a_body_at_rest(integrator: str) -> None:
    """m = 1, limit 3; the load is 1 up to t = 1 and -5 after: v = -(5 - 3)(t - 1)."""
    load = hs.Input("F", "table", times=(0, 1, 1, 3), values=(1, 1, -5, -5))
    model = hs.Model(
        "pushed",
        states=(State("x", 0, "v"), State("v", 0, "F - f")),
        inputs=(load,),
        contacts=(hs.Contact("f", velocity="v", normal="6", law="coulomb", arguments={"mu": 0.5}),),
    )
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    assert [(e.t, e.source, e.target) for e in sol.events if e.kind == "transition"] == [
        (1.0, "stick", "slip-")
    ]
    assert (sol(np.linspace(0, 1, 20)) == 0.0).all()
    assert sol(2.0) == pytest.approx([-1.0, -2.0], abs=1e-7)


def test_a_guard_that_is_negative_from_the_start_is_named_with_its_value() -> None:
    floor = hs.Guard("floor", "-h", [hs.Choice("flight", reset={"w": "-w"})])
    model = hs.Model(
        "ball",
        states=[hs.State("h", 1.5, "w"), hs.State("w", 0.0, "-9.81")],
        components=[hs.Component("mode", [hs.Mode("flight", floor)], initial="flight")],
    )
    sol = hs.simulate(model, (0, 1))
    assert sol.status == "cascade"
    assert (
        "Guard floor is -1.5 in flight before and after" in sol.message and "reverse its sign" in sol.message
    )


def test_a_run_backward_says_so() -> None:
    sol = hs.simulate(hs.load("dfcs"), (1.0, 0.0))
    assert sol.status == "backward-nonunique"
    assert "this run goes backward in time, from t = 1.0 to 0.0: swap the ends of t_span" in sol.message
    free = hs.simulate(hs.Model("decay", [hs.State("x", 1.0, "-x")]), (1.0, 0.0))
    assert free.message.startswith("reached t = 0.0 backward in time with ")
