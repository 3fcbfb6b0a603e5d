"""Derivatives at roots at zero, kinks and edges of a domain: right, or refused by name."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


def run(
    rates: dict[str, tuple[object, str]], span: tuple[float, float] = (0.0, 1.0), **parameters: object
) -> hs.Solution:
    model = hs.Model(
        "edge",
        states=[hs.State(name, start, der) for name, (start, der) in rates.items()],
        parameters=[hs.Parameter(name, value) for name, value in parameters.items()],
    )
    return hs.simulate(model, span, integrator="dop853")


@pytest.mark.parametrize(
    ("rate", "function"),
    [
        ("sqrt(abs(x))", r"sqrt\(abs\(x\)\)"),
        ("-sign(x)*sqrt(abs(x))", r"sqrt\(abs\(x\)\)"),
        ("sqrt(x**2)", r"sqrt\(x\*\*2\)"),
        ("abs(x)**(2/3)", r"abs\(x\)\*\*"),
        ("abs(x)**p", r"abs\(x\)\*\*p"),
    ],
)
def test_a_run_that_stays_where_its_rate_has_no_derivative_is_refused_by_name(
    rate: str, function: str
) -> None:
    """At rest at x = 0 these rates have the slopes infinity, or +1 and -1."""
    message = rf"the rate of x has no derivative with respect to x.*{function}"
    with pytest.raises(hs.UsageError, match=message) as caught:
        hs.sensitivities(run({"x": (0.0, rate)}, p=0.7), [])
    assert "(x = 0)" in str(caught.value)


@pytest.mark.parametrize(
    "rate", ["abs(x)**1.5", "-x*sqrt(abs(x))", "-x*sqrt(x**2)", "abs(x)**p", "log(1 + abs(x))**2"]
)
def test_a_rate_that_is_flat_at_rest_has_the_derivative_zero(rate: str) -> None:
    """All of these are o(x) at x = 0, so that a change of the start stays as it is."""
    found = hs.sensitivities(run({"x": (0.0, rate)}, p=1.7), ["p"])
    assert found.by_start.tolist() == [[1.0]] and found.by_parameter.tolist() == [[0.0]]


def test_a_cone_is_refused_at_its_tip_and_right_beside_it() -> None:
    """For resting x and y, z gains r = sqrt(x**2 + y**2) in unit time, with dr/dx = x/r."""
    rates = {"x": (0.0, "0"), "y": (0.0, "0"), "z": (0.0, "sqrt(x**2 + y**2)")}
    with pytest.raises(hs.UsageError, match=r"the rate of z has no derivative with respect to x and y"):
        hs.sensitivities(run(rates))
    beside = hs.sensitivities(run(rates | {"x": (0.3, "0"), "y": (0.4, "0")}))
    assert np.allclose(beside.by_start[2], [0.6, 0.8, 1.0], rtol=1e-12)


def test_a_root_that_is_passed_at_an_instant_has_its_derivative() -> None:
    """y = integral of sqrt(|x0 + t|) over 0 .. 1 has dy/dx0 = sqrt(1 + x0) - sqrt(-x0) for -1 < x0 < 0."""
    found = hs.sensitivities(run({"x": (-0.3, "1"), "y": (0.0, "sqrt(abs(x))")}))
    assert abs(found.by_start[1, 0] - (math.sqrt(0.7) - math.sqrt(0.3))) < 1e-6


@pytest.mark.parametrize("formula", ["sqrt(a)", "abs(a)", "max(a, b)", "a**0.5 + a"])
def test_a_parameter_at_a_root_or_kink_is_refused_by_name(formula: str) -> None:
    for sol in (
        run({"x": (1.0, f"x*({formula})")}, a=0.0, b=0.0),
        run({"x": (formula, "1")}, a=0.0, b=0.0),
        run({"x": (1.0, "c*x")}, a=0.0, b=0.0, c=formula),
    ):
        with pytest.raises(hs.UsageError, match=r"no derivative (by|with respect to) a|exactly at its zero"):
            found = hs.sensitivities(sol, ["a"])
            assert np.isnan(found.by_parameter).all(), found
            raise hs.UsageError(found.warnings[0])


def test_a_parameter_at_a_flat_corner_has_its_derivative() -> None:
    """The start a*abs(a) has the derivative 2*abs(a) = 0 at a = 0."""
    found = hs.sensitivities(run({"x": ("1 + a*abs(a)", "0")}, a=0.0), ["a"])
    assert found.by_parameter.tolist() == [[0.0]]


def test_a_quantity_at_a_root_has_no_finite_derivative_there_and_others_elsewhere() -> None:
    """q = sqrt(x) up to x = 1/2, with x = k t, has dq/dk = t/(2 sqrt(k t))."""
    model = hs.Model(
        "root",
        states=[hs.State("x", 0.0, "k")],
        parameters={"k": 1.0},
        outputs=[hs.Output("q", "sqrt(x) if x < 0.5 else 1")],
    )
    found = hs.sensitivities(hs.simulate(model, (0.0, 1.0)), ["k"]).at([0.0, 0.25, 0.75], "q")
    first, *others = found.by_parameter[:, 0, 0]
    assert not math.isfinite(first)
    assert others == pytest.approx([0.25, 0.0], abs=1e-12)
