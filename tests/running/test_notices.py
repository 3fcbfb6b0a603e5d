"""Warnings on a solution: each where its cause is, and none where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of

STIFF = hs.Model(
    "stiff",
    states=[hs.State("x", 1, der="-k*(x - cos(t)) - sin(t)"), hs.State("y", 0, der="x")],
    parameters={"k": 2e3},
)


def told(sol: hs.Solution, word: str) -> list[str]:
    return [warning for warning in sol.warnings if warning.startswith(word)]


@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "scipy-rk45"])
def test_steps_kept_short_by_stability(integrator: str) -> None:
    """x is cos(t) after a moment; what is left is smooth, and explicit steps are 3 to 6 times 1/k all the same."""
    sol = hs.simulate(STIFF, (0, 4), integrator=integrator, rtol=1e-6)
    (warning,) = told(sol, "stiff")
    assert "rodas5p" in warning
    decay = float(warning.split("(time constant ")[1].split(")")[0])
    assert decay == pytest.approx(1 / 2e3, rel=1e-3)


def sampled(period: float) -> hs.Model:
    """A state that follows a triangle wave 1e5 times faster than the wave turns, and a clock that counts."""
    return hs.Model(
        "sampled",
        states=[hs.State("x", 0, der="-1e5*(x - u)")],
        inputs=[hs.Input("u", "wave", shape="triangle", period=1)],
        discrete=[hs.Discrete("n", 0)],
        schedules=[hs.Schedule("tick", period=period, reset={"n": "n + 1"})],
    )


@pytest.mark.parametrize(("period", "name"), [(0.5, "rodas5p"), (2.0**-10, "dop853")])
def test_auto_counts_the_restarts_at_clock_ticks(period: float, name: str) -> None:
    """The explicit method needs 33000 compiled steps; the implicit one restarts twice or a thousand times."""
    assert hs.simulate(sampled(period), (0, 1)).integrator == name


def test_no_implicit_method_is_recommended_if_it_restarts_at_each_tick() -> None:
    (warning,) = told(hs.simulate(sampled(2.0**-10), (0, 1), integrator="dop853"), "stiff")
    assert "restart at each clock tick" in warning and "rodas5p" not in warning


@pytest.mark.parametrize(
    ("integrator", "k"), [("rodas5p", 2e3), ("scipy-radau", 2e3), ("dop853", 1.0), ("tsit5", 1.0)]
)
def test_nothing_is_stiff_for_an_implicit_method_or_without_a_fast_decay(integrator: str, k: float) -> None:
    sol = hs.simulate(STIFF, (0, 400 if k == 1.0 else 4), integrator=integrator, params={"k": k}, rtol=1e-6)
    assert sol.warnings == ()


def test_a_fast_oscillation_is_no_stiffness() -> None:
    model = hs.Model("fast", states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="-1e6*x - 10*v")])
    sol = hs.simulate(model, (0, 0.5), integrator="tsit5", rtol=1e-6)
    assert sol.stats["steps"] > 500
    assert sol.warnings == ()


def switched(width: float) -> hs.Model:
    """A state driven to and fro between the edges of a hysteresis, on its way along a slow drift."""
    return hs.Model(
        "switched",
        states=[hs.State("x", 1, der="u - 0.1"), hs.State("y", 0, der="1")],
        parameters={"d": width},
        components=[
            hs.Component(
                "relay",
                [
                    hs.Mode("high", hs.Guard("low", "x + d", "low"), set={"u": "-1"}),
                    hs.Mode("low", hs.Guard("high", "d - x", "high"), set={"u": "1"}),
                ],
                initial="high",
            )
        ],
    )


def test_chattering_is_named_with_its_time() -> None:
    for integrator in ("dop853", "exact", "scipy-dop853"):
        sol = hs.simulate(switched(1e-4), (0, 1.2), integrator=integrator)
        (warning,) = told(sol, "chattering")
        assert "belong to relay" in warning
        since = float(warning.split("from t = ")[1].split(",")[0])
        assert since >= 1 / 1.1  # where x first comes to the edge


def test_a_hysteresis_that_shows_is_no_chattering() -> None:
    sol = hs.simulate(switched(0.01), (0, 20), integrator="dop853")
    assert len(sol.events) > 200
    assert sol.warnings == ()


def test_many_periods_are_no_chattering() -> None:
    assert hs.simulate("dfcs", (0, 3)).warnings == ()


def test_bounces_that_accumulate_are_told_as_such_and_not_as_chattering() -> None:
    model = hs.Model(
        "shelf",
        states=[hs.State("h", 2, der="w"), hs.State("w", 0, der="-9.81 + p")],
        impacts=[hs.Impact("p", gap="h - 1", restitution="0.95")],
    )
    sol = hs.simulate(model, (0, 20), integrator="taylor")
    assert len(sol.events) > 200
    assert sol.modes["p"][-1].mode == "closed"
    assert all(warning.startswith("accumulation: events of p") for warning in sol.warnings)


@pytest.mark.parametrize("integrator", ["dop853", "taylor", "exact"])
def test_a_touch_is_told_where_a_compiled_loop_runs(integrator: str) -> None:
    """1 - x is (1 - t)^2, a square that no integrator can tell from a crossing."""
    model = hs.Model(
        "touch",
        states=[hs.State("x", 0, der="v"), hs.State("v", 2, der="-2")],
        components=[
            hs.Component(
                "c", [hs.Mode("below", hs.Guard("top", "1 - x", "above")), hs.Mode("above")], initial="below"
            )
        ],
    )
    sol = hs.simulate(model, (0, 3), integrator=integrator)
    crossed = any(event.kind == "transition" for event in sol.events)
    assert crossed or told(sol, "near-grazing: guard top of c")
    assert [e.t for e in sol.events] == pytest.approx([1.0], abs=1e-7)


@pytest.mark.parametrize(
    ("integrator", "options"),
    [
        ("dop853", {"rtol": 1e-13}),
        ("dop853", {"rtol": 1e-9}),
        ("tsit5", {"rtol": 1e-9}),
        ("rodas5p", {"rtol": 1e-9}),
        ("taylor", {"rtol": 1e-12}),
        ("taylor", {"rtol": 1e-12, "max_step": 0.05}),
        ("exact", {}),
        ("scipy-dop853", {"rtol": 1e-9}),
        ("cvode-adams", {"rtol": 1e-9}),
        ("rk4-dichotomy", {"step": 1e-3}),
    ],
)
def test_a_guard_that_touches_zero_and_is_never_negative_ends_no_mode(integrator: str, options: dict) -> None:
    """a (1 + cos(w t + phi)): at its zeros all that is left of it is rounding of the sum, however short the steps."""
    model = hs.Model(
        "touch",
        parameters={"a": 1.0, "w": 1.0, "phi": 0.0},
        states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="cos(3*t) - x - 0.1*v")],
        components=[
            hs.Component(
                "c",
                [hs.Mode("below", hs.Guard("top", "a*(1 + cos(w*t + phi))", "above")), hs.Mode("above")],
                initial="below",
            )
        ],
    )
    draw = np.random.default_rng(26)
    for _ in range(8):
        a, w, phi = 10.0 ** draw.uniform(-3, 3), draw.uniform(0.3, 3.0), draw.uniform(-3.0, 3.0)
        sol = hs.simulate(model.with_(a=a, w=w, phi=phi), (0, 8), integrator=integrator, **options)
        assert sol.success, sol.message
        assert not [event for event in sol.events if event.kind == "transition"], (a, w, phi)


SWITCHED = """
schema = 1
[inputs.u]
kind = "table"
times = [0, 1]
values = [0, 1]
[states]
x = { start = 1, der = "-x if u > 0.5 else -2*x" }
"""


@pytest.mark.parametrize("integrator", ["auto", "rk4-sign"])
def test_a_jump_in_a_rate_is_told_by_the_run_as_by_check(integrator: str) -> None:
    """What `check` says of jumps, and nothing else, is a warning of every run of the model."""
    model = hs.Model.from_toml(SWITCHED, path="switched.toml")
    (caution,) = warnings_of(model)
    options = {"step": 0.01} if integrator == "rk4-sign" else {}
    sol = hs.simulate(model, (0, 2), integrator=integrator, limits={"steps": 300}, **options)
    assert sol.warnings == (caution.sentence,)
    assert caution.sentence.startswith(
        "switched.toml:8: '-x if u > 0.5 else -2*x' in state x is not treated as a switching surface"
    )
    assert "[contacts.NAME]" in caution.sentence and "\n" not in caution.sentence
    if sol.status == "limit":
        assert sol.resume(limits={"steps": 400}).warnings == sol.warnings


def test_a_corner_is_told_of_by_neither() -> None:
    model = hs.Model.from_toml(SWITCHED.replace("-x if u > 0.5 else -2*x", "-u - abs(x)"))
    assert warnings_of(model) == () and hs.simulate(model, (0, 2)).warnings == ()


@pytest.mark.parametrize("name", ["dop853", "taylor", "scipy-rk45", "cvode-bdf"])
@pytest.mark.parametrize("x", [0.5, -3.0])
def test_a_load_that_is_negative_from_the_start(name: str, x: float) -> None:
    """No mode of a contact admits it: the run says why, and not that no motion is admissible."""
    block = hs.Model(
        "block",
        states=[hs.State("x", x, "v"), hs.State("v", 0, "-x - f")],
        contacts=[hs.Contact("f", "v", "-1 - x**2", "coulomb", {"mu": 0.5})],
    )
    sol = hs.simulate(block, (0, 1), integrator=name)
    assert sol.status == "inconsistent" and sol.t_end == 0.0
    assert "normal load of contact f became negative: -1 - x**2 < 0" in sol.message


def test_auto_says_what_keeps_a_linear_model_from_the_closed_form() -> None:
    def message(function: str) -> str:
        watched = replace(hs.load("dfcs"), monitors=(hs.Monitor("seen", function),))
        return hs.simulate(watched, (0, 0.01)).message

    obstacle = "the model has monitors that are not polynomials of the states, so exact may be slower"
    assert obstacle in message("exp(x) - 1.001")
    for function in ("x - 1e-9", "x**2 - 1e-9"):
        assert "exact, chosen because its modes are linear in the states" in message(function)
    assert "exact may be slower" not in hs.simulate("belt", (0, 0.1)).message
