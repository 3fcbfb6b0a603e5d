"""A part of a rate that is below rounding at both ends of a step and not between them is not stepped over."""

from __future__ import annotations

import math

import mpmath
import pytest

import hybridsim as hs

METHODS = ("taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853")


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("centre, width", [(0.5, 0.07), (0.4, 0.03), (0.5, 0.02)])
def test_a_pulse_in_time(centre: float, width: float, integrator: str) -> None:
    """y' = 1 + exp(-((t - c)/w)**2): y(1) = 1 + w sqrt(pi)/2 (erf((1 - c)/w) + erf(c/w))."""
    rate = f"1 + exp(-((t - {centre})/{width})**2)"
    model = hs.Model("pulse", [hs.State("y", 0, rate), hs.State("u", 1, "sin(3*t) - u")])
    area = width * math.sqrt(math.pi) / 2 * (math.erf((1 - centre) / width) + math.erf(centre / width))
    for rtol in (1e-6, 1e-9):
        sol = hs.simulate(model, (0, 1), integrator=integrator, rtol=rtol)
        assert sol.y[0, -1] == pytest.approx(1 + area, abs=10 * rtol)


# none of the stages of tsit5 meets it after long steps of an even rate, and its error estimate is zero
@pytest.mark.parametrize("integrator", [name for name in METHODS if name != "tsit5"])
def test_a_force_that_is_there_near_rest_alone(integrator: str) -> None:
    """v' = 1 + exp(-(v/w)**2) from v = -1: v = 1 at the integral of dv/v', by quadrature in 30 digits."""
    width = 0.05
    model = hs.Model("slow", [hs.State("x", 0, "v"), hs.State("v", -1, f"1 + exp(-(v/{width})**2)")])
    with mpmath.workdps(30):
        needed = mpmath.quad(
            lambda v: 1 / (1 + mpmath.exp(-((v / mpmath.mpf(width)) ** 2))),
            [-1, -0.2, -0.05, 0, 0.05, 0.2, 1],
        )
    sol = hs.simulate(model, (0, float(needed)), integrator=integrator, rtol=1e-9)
    assert sol.y[1, -1] == pytest.approx(1.0, abs=1e-7)


def test_a_stribeck_contact_that_comes_near_rest_under_way() -> None:
    """Two methods agree where the body comes near rest under way in one long step, and friction rises there."""
    model = hs.Model.from_toml("""
schema = 1
name = "near-rest"
[states]
x = { start = -0.3, der = "v" }
v = { start = 2.0, der = "4*sin(1.7*t) - 3*x - 0.1*v - f" }
[contacts.f]
velocity = "v + 1.2"
normal = "1"
law = { name = "stribeck", mu_s = "0.3", mu_k = "0.2", v_s = "0.1" }
""")
    for end in (4.0, 8.0):
        fine = hs.simulate(model, (0, end), integrator="dop853", rtol=1e-11)
        assert hs.simulate(model, (0, end), integrator="taylor", rtol=1e-10).y[:, -1] == pytest.approx(
            fine.y[:, -1], abs=1e-7
        )
