"""Powers whose exponent is a parameter with a whole value: they have a value, and a series, at zero and below."""

from __future__ import annotations

from math import log

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape

INTEGRATORS = ("taylor", "dop853", "tsit5", "rodas5p", "scipy-rk45", "scipy-radau")


def falling(p: float, start: float = 1.0, rate: str = "x**p") -> hs.Model:
    """x falls through zero, as 1 - t; y is the integral of its power."""
    states = [hs.State("x", start, "-1"), hs.State("y", 0.0, rate)]
    return hs.Model("falling", states, {"p": p, "half": "p/2"}, definitions={"n": "2*half"})


def area(p: float, start: float, end: float) -> float:
    """The integral of x**p from the end to the start: a polynomial."""
    return (start ** (p + 1.0) - end ** (p + 1.0)) / (p + 1.0)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("p", [0.0, 1.0, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("rate", ["x**p", "x**n"])
def test_through_zero(integrator: str, p: float, rate: str) -> None:
    sol = hs.simulate(falling(p, rate=rate), (0.0, 2.5), integrator=integrator, rtol=1e-10)
    assert sol.success, sol.message
    assert sol.y[1, -1] == pytest.approx(area(p, 1.0, -1.5), rel=1e-9)


@pytest.mark.parametrize("p", [0.0, 1.0, 2.0, 3.0])
def test_from_zero_on(p: float) -> None:
    sol = hs.simulate(falling(p, start=0.0), (0.0, 2.0), integrator="taylor")
    assert sol.success, sol.message
    assert sol.y[1, -1] == pytest.approx(area(p, 0.0, -2.0), rel=1e-11)


@pytest.mark.parametrize(("p", "exact"), [(-1.0, -log(3.0)), (-2.0, 2.0 / 3.0)])
def test_negative_powers_below_zero(p: float, exact: float) -> None:
    sol = hs.simulate(falling(p, start=-1.0), (0.0, 2.0), integrator="taylor", rtol=1e-12)  # to x = -3
    assert sol.success and sol.y[1, -1] == pytest.approx(exact, rel=1e-11)


def test_other_exponents_are_as_before() -> None:
    sol = hs.simulate(falling(2.5), (0.0, 0.9), integrator="taylor", rtol=1e-12)
    assert sol.y[1, -1] == pytest.approx(area(2.5, 1.0, 0.1), rel=1e-11)


def test_slopes_by_the_exponent_are_those_of_the_power() -> None:
    """Its product is chosen at one value of the exponent alone."""
    model = falling(2.0)
    system = System(model)
    seeds = np.zeros((2 + 1 + system.layout.size, 2))
    seeds[0, 0] = seeds[3, 1] = 1.0  # by x, by p
    z = np.zeros(0, dtype=np.int64)
    p = system.vector(Instant(0.0), system.discrete_start)
    found = TangentTape(system, z)(np.zeros(1), np.array([[0.7, 0.0]]), p, seeds)
    assert found.slopes[0, 1] == pytest.approx([2.0 * 0.7, 0.7**2 * log(0.7)], rel=1e-14)


def test_a_larger_whole_exponent_is_named() -> None:
    sol = hs.simulate(falling(7.0), (0.0, 2.5), integrator="taylor")
    assert sol.status == "step-failure"
    assert (
        "'x**p' in the rate of y has no Taylor series at x <= 0, because its exponent 7 is given by a name"
        in sol.message
    )
    assert "write the number itself" in sol.message
    assert hs.simulate(falling(7.0), (0.0, 2.5), integrator="dop853").success


@pytest.mark.parametrize("base", ["v", "abs(v)"])
def test_drag_of_a_contact(base: str) -> None:
    """With a whole exponent it is the same as with the number, where the contact sticks, too."""
    ends = []
    for exponent in ("p", "2"):
        contacts = [hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5})]
        states = [hs.State("v", 0.0, f"sin(t) - 0.1*{base}**{exponent} - f")]
        model = hs.Model("pushed", states, {"p": 2}, contacts=contacts)
        ends.append(hs.simulate(model, (0.0, 9.0), integrator="dop853", rtol=1e-11))
    assert [len(sol.events) for sol in ends] == [len(ends[0].events)] * 2 and len(ends[0].events) > 2
    assert ends[0].y[0, -1] == pytest.approx(ends[1].y[0, -1], abs=1e-9)
