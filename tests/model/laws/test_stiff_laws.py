"""Stiff laws at rtol 1e-8 with the stiff integrators, within 1e-6 of equations written out here for SciPy at 1e-12."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybridsim as hs

STIFF = ["rodas5p", "cvode-bdf", "scipy-radau", "scipy-bdf"]


def reference(
    rates: Callable[[float, np.ndarray], list[float]],
    start: list[float],
    t: list[float],
    method: str = "DOP853",
) -> np.ndarray:
    """The states at times (after 0), at tolerances far below what is asked of the integrators."""
    found = solve_ivp(rates, (0, t[-1]), start, method, t, rtol=1e-12, atol=1e-17)
    assert found.success
    return found.y.T


def compare(model: hs.Model, integrator: str, t: list[float], expected: np.ndarray) -> None:
    """Each state to 1e-6 of its largest value at these times."""
    sol = hs.simulate(model, (0, t[-1]), integrator=integrator, rtol=1e-8)
    assert sol.success, sol.message
    found = np.array([sol(time) for time in t])
    scale = np.abs(expected).max(axis=0)
    errors = np.abs(found - expected).max(axis=0) / scale
    assert errors.max() < 1e-6, errors


JERKS = [4.0, 8.5, 11.0, 15.0, 20.0]


@cache
def stick_slip_with_lugre() -> np.ndarray:
    """The states of the source's example at the times `JERKS`."""
    p = hs.load("lugre-presliding").parameter_values()

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        g = p["F_c"] + (p["F_s"] - p["F_c"]) * np.exp(-((v / p["v_s"]) ** 2))
        dz = v - p["sigma_0"] * abs(v) / g * z
        f = p["sigma_0"] * z + p["sigma_1"] * dz + p["sigma_2"] * v
        return [v, (p["k"] * (p["v_pull"] * t - x) - f) / p["m"], dz]

    return reference(rates, [0, 0, 0], JERKS)


@pytest.mark.parametrize("integrator", STIFF)
def test_lugre(integrator: str) -> None:
    """The stick-slip of the source, over its first two jerks."""
    compare(hs.load("lugre-presliding"), integrator, JERKS, stick_slip_with_lugre())


@pytest.mark.parametrize("integrator", STIFF)
def test_rate_and_state(integrator: str) -> None:
    """A slider on a spring just stiffer than N (b - a)/L, whose pulled end is made ten times faster."""
    mu_0, a, b, length, v_0, normal, k, m = 0.6, 0.01, 0.015, 1e-5, 1e-6, 10.0, 6e3, 1e-2
    contact = hs.Contact(
        "f",
        "v",
        normal,
        "rate-and-state",
        {"mu_0": mu_0, "a": a, "b": b, "L": length, "v_0": v_0},
        nominal={"theta": 1},
    )
    states = [
        hs.State("e", mu_0 * normal / k, f"{10 * v_0} - v", nominal=1e-3),
        hs.State("v", v_0, f"({k}*e - f)/{m}", nominal=1e-6),
    ]
    model = hs.Model("slider", states, contacts=[contact])

    def rates(_: float, y: np.ndarray) -> list[float]:
        e, v, theta = y
        f = normal * (mu_0 + a * np.log(v / v_0) + b * np.log(v_0 * theta / length))
        return [10 * v_0 - v, (k * e - f) / m, 1 - v * theta / length]

    t = [0.5, 1.0, 2.0, 4.0]
    expected = reference(rates, [mu_0 * normal / k, v_0, length / v_0], t, "Radau")
    compare(model, integrator, t, expected)


@pytest.mark.parametrize("integrator", STIFF)
def test_tanh(integrator: str) -> None:
    """The reference model over two periods, v0 a thousandth of its speed."""
    scene = hs.load("dfcs")
    p = scene.parameter_values()
    contact = hs.Contact("f", "v", "N", "tanh", {"mu": "mu", "v0": 1e-4})
    model = hs.Model("smooth", states=scene.states, parameters=scene.parameters, contacts=[contact])

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y
        f = p["mu"] * p["N"] * np.tanh(v / 1e-4)
        return [v, (p["F0"] * np.sin(p["omega"] * t) - p["c"] * v - p["k"] * x - f) / p["m"]]

    period = 2 * np.pi / p["omega"]
    t = [0.3 * period, 0.8 * period, 1.5 * period, 2 * period]
    compare(model, integrator, t, reference(rates, [0, 0], t))
