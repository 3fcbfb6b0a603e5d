"""Laws that are functions of speed, place and load: the time and place of a stop by closed forms or by quadrature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import acos, log, pi, sin, sqrt

import mpmath
import pytest
from scipy.interpolate import PchipInterpolator

import hybridsim as hs

SMOOTH = ["taylor", "dop853", "rodas5p", "scipy-radau", "cvode-bdf"]
LINEAR = ["exact", *SMOOTH]
N = 10.0
# rtol 1e-9 over a hundred steps; CVODE controls the error of a step and not of a run, and gets ten times that
WITHIN = {"cvode-bdf": 2e-6, "scipy-radau": 2e-6}


def sliding(
    law: str | hs.FrictionLaw, arguments: Mapping[str, float], v: float, normal: str = "10"
) -> hs.Model:
    """A body of mass 1 that is let go at x = 0 with the speed v."""
    return hs.Model(
        "sliding",
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", v, "-f", nominal=1)],
        contacts=[hs.Contact("f", "v", normal, law, arguments)],
    )


def stop(model: hs.Model, t_end: float, integrator: str) -> tuple[float, float]:
    """When and where it stops."""
    sol = hs.simulate(model, (0, t_end), integrator=integrator, rtol=1e-9)
    assert sol.success, sol.message
    assert sol(t_end)[1] == 0.0
    assert [(e.source, e.target) for e in sol.events] in ([("slip+", "stick")], [("slip-", "stick")])
    return sol.events[0].t, float(sol(t_end)[0])


def by_quadrature(force: Callable[[mpmath.mpf], mpmath.mpf], v: float, *knots: float) -> float:
    """Time to stop from v, the integral of dv/f(v) in 30 digits."""
    with mpmath.workdps(30):
        return float(mpmath.quad(lambda u: 1 / force(u), [0, *knots, v]))


@pytest.mark.parametrize("integrator", LINEAR)
def test_viscous(integrator: str) -> None:
    mu, c, v = 0.3, 2.0, 4.0
    t, x = stop(sliding("viscous", {"mu": mu, "c": c}, v), 3.0, integrator)
    assert t == pytest.approx(log(1 + c * v / (mu * N)) / c, rel=WITHIN.get(integrator, 1e-7))
    assert x == pytest.approx((v - mu * N * t) / c, rel=WITHIN.get(integrator, 1e-7))


@pytest.mark.parametrize("integrator", LINEAR)
def test_asymmetric(integrator: str) -> None:
    """The distance to a stop, and the forces at which it gives way, are those of the direction."""
    mu = {"mu_forward": 0.2, "mu_backward": 0.5}
    for v, own in ((3.0, 0.2), (-3.0, 0.5)):
        t, x = stop(sliding("asymmetric", mu, v), 5.0, integrator)
        assert t == pytest.approx(abs(v) / (own * N), rel=1e-9)
        assert x == pytest.approx(v * abs(v) / (2 * own * N), rel=1e-9)
    for sign, own in ((1, 0.2), (-1, 0.5)):
        contact = hs.Contact("f", "v", 10, "asymmetric", mu)
        loaded = hs.Model("loaded", [hs.State("v", 0, f"{sign}*t - f")], contacts=[contact])
        sol = hs.simulate(loaded, (0, 7), integrator=integrator)
        assert [(e.source, e.target) for e in sol.events] == [("stick", f"slip{'+' if sign > 0 else '-'}")]
        assert sol.events[0].t == pytest.approx(own * N, rel=1e-12)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_stribeck_exponential(integrator: str) -> None:
    mu_s, mu_k, v_s, v = 0.6, 0.4, 0.5, 2.0
    model = sliding("stribeck-exponential", {"mu_s": mu_s, "mu_k": mu_k, "v_s": v_s}, v)
    t, _ = stop(model, 1.0, integrator)
    expected = v_s / (mu_k * N) * log((mu_k * 2.718281828459045 ** (v / v_s) + mu_s - mu_k) / mu_s)
    assert t == pytest.approx(expected, rel=WITHIN.get(integrator, 1e-7))


@pytest.mark.parametrize("integrator", SMOOTH)
@pytest.mark.parametrize("exponent", [0.7, 1.0, 2.0])
def test_stribeck_with_an_exponent(exponent: float, integrator: str) -> None:
    """Against the law as it is written, and against the one without its blunt corner as far as that changes it."""
    mu_s, mu_k, v_s, c, v, blunt = 0.6, 0.4, 0.5, 0.3, 2.0, 1e-2
    arguments = {"mu_s": mu_s, "mu_k": mu_k, "v_s": v_s, "exponent": exponent, "c": c, "blunt": blunt}
    t, _ = stop(sliding("stribeck-exponent", arguments, v), 1.0, integrator)

    def force(u: mpmath.mpf, r: float) -> mpmath.mpf:
        falling = mpmath.exp(r**exponent - ((u / v_s) ** 2 + r**2) ** (exponent / 2))
        return N * (mu_k + (mu_s - mu_k) * falling) + c * u

    knots = (1e-3, 1e-2, 0.1)
    blunted = by_quadrature(lambda u: force(u, blunt), v, *knots)
    assert t == pytest.approx(blunted, rel=WITHIN.get(integrator, 1e-7))
    sharp = by_quadrature(lambda u: force(u, 0.0), v, *knots)
    assert abs(blunted - sharp) < N * (mu_s - mu_k) * blunt**exponent * sharp / (mu_k * N)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_hyperbolic(integrator: str) -> None:
    """v + delta v**2/2 falls at the rate mu N."""
    mu, delta, v = 0.5, 3.0, 2.0
    t, _ = stop(sliding("hyperbolic", {"mu": mu, "delta": delta}, v), 3.0, integrator)
    assert t == pytest.approx((v + delta * v**2 / 2) / (mu * N), rel=WITHIN.get(integrator, 1e-7))


POINTS = ([0.0, 0.1, 0.3, 0.8, 1.5, 2.5], [0.6, 0.45, 0.4, 0.38, 0.42, 0.5])
TABLE = hs.FrictionLaw("measured", slip="mu*N", stick="mu*N", tables=[hs.LawTable("mu", *POINTS)])


@pytest.mark.parametrize("integrator", SMOOTH)
@pytest.mark.parametrize("v", [2.0, -2.0, 4.0])
def test_a_table_of_points(v: float, integrator: str) -> None:
    """Against SciPy's monotone cubic; beyond the last point the last value holds."""
    t, _ = stop(sliding(TABLE, {}, v), 2.0, integrator)
    points = PchipInterpolator(*POINTS)
    knots = [k for k in POINTS[0][1:] if k < abs(v)]
    expected = by_quadrature(lambda u: N * float(points(min(float(u), 2.5))), abs(v), *knots)
    assert t == pytest.approx(expected, rel=WITHIN.get(integrator, 1e-7))


@pytest.mark.parametrize("integrator", LINEAR)
def test_a_coefficient_that_depends_on_place(integrator: str) -> None:
    """mu = mu_0 (1 + x/L): a harmonic motion about x = -L until it stops."""
    mu, length, v = 0.3, 2.0, 4.0
    t, x = stop(sliding("coulomb", {"mu": f"{mu}*(1 + x/{length})"}, v), 3.0, integrator)
    omega = sqrt(mu * N / length)
    radius = sqrt(length**2 + (v / omega) ** 2)
    assert x == pytest.approx(radius - length, rel=WITHIN.get(integrator, 1e-7))
    assert t == pytest.approx(acos(length / radius) / omega, rel=WITHIN.get(integrator, 1e-7))


@pytest.mark.parametrize("integrator", SMOOTH)
def test_a_load_that_vanishes(integrator: str) -> None:
    """v' = -mu max(N, 0) with N = 1 + 2 sin t: from 7 pi/6 to 11 pi/6 the contact is open and v is constant."""
    mu = 0.5
    contact = hs.Contact("f", "v", "1 + 2*sin(t)", "coulomb", {"mu": mu}, opens=True)
    model = hs.Model("lifting", [hs.State("v", 5, "-f")], contacts=[contact], outputs={"f": "f"})
    sol = hs.simulate(model, (0, 2 * pi), integrator=integrator, rtol=1e-9)
    assert sol.success, sol.message
    assert [(e.component, e.source, e.target) for e in sol.events] == [
        ("f_N", "closed", "open"),
        ("f_N", "open", "closed"),
    ]
    assert [e.t for e in sol.events] == pytest.approx([7 * pi / 6, 11 * pi / 6], rel=1e-9)
    # 2 (1 - cos) over both parts with contact: 2 sqrt(3) in sum
    lost = mu * (2 * pi - 2 * pi / 3 + 2 * sqrt(3))
    assert sol(2 * pi)[0] == pytest.approx(5 - lost, rel=WITHIN.get(integrator, 1e-8))
    assert sol.output("f", 1.5 * pi) == 0.0


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_a_body_at_rest_is_let_go_as_its_contact_opens(integrator: str) -> None:
    """A force of 0.1 is held as long as mu N >= 0.1, N = 2 cos t: until t_1 = acos(0.1/(2 mu))."""
    mu, push = 0.5, 0.1
    contact = hs.Contact("f", "v", "2*cos(t)", "coulomb", {"mu": mu}, opens=True)
    model = hs.Model("let-go", [hs.State("v", 0, f"{push} - f")], contacts=[contact])
    sol = hs.simulate(model, (0, pi), integrator=integrator, rtol=1e-10)
    first = acos(push / (2 * mu))
    assert [e.t for e in sol.events] == pytest.approx([first, pi / 2], rel=1e-10)
    lost = 2 * mu * (1 - sin(first))
    assert sol(pi)[0] == pytest.approx(push * (pi - first) - lost, rel=1e-8)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_tanh(integrator: str) -> None:
    """sinh(v/v0) = sinh(v(0)/v0) exp(-mu N t/v0)."""
    mu, v0, v = 0.5, 0.1, 0.4
    model = sliding("tanh", {"mu": mu, "v0": v0}, v)
    sol = hs.simulate(model, (0, 0.2), integrator=integrator, rtol=1e-9)
    with mpmath.workdps(30):
        expected = [
            v0 * mpmath.asinh(mpmath.sinh(v / v0) * mpmath.exp(-mu * N * t / v0)) for t in (0.05, 0.2)
        ]
    assert [sol(0.05)[1], sol(0.2)[1]] == pytest.approx([float(e) for e in expected], rel=1e-5, abs=1e-8)


@pytest.mark.parametrize(("law", "creep"), [("tanh", "atanh(0.6)"), ("arctan", "tan(pi*0.3)")])
@pytest.mark.parametrize("integrator", SMOOTH)
def test_a_loaded_body_creeps(law: str, creep: str, integrator: str) -> None:
    """Under 60 % of mu N: the speed at which the law gives that force."""
    contact = hs.Contact("f", "v", 10, law, {"mu": 0.5, "v0": 1e-3})
    model = hs.Model("loaded", [hs.State("v", 0, "3 - f", nominal=1e-3)], contacts=[contact])
    sol = hs.simulate(model, (0, 1), integrator=integrator, rtol=1e-8)
    expected = {"tanh": mpmath.atanh(0.6), "arctan": mpmath.tan(mpmath.pi * 0.3)}[law] * 1e-3
    assert sol(1.0)[0] == pytest.approx(float(expected), rel=1e-6), creep


def test_tanh_as_a_law_is_the_regularised_coulomb_contact() -> None:
    found = hs.load("dfcs").regularized("tanh", v0=1e-2)
    contact = hs.load("dfcs").contacts[0]
    declared = hs.Contact("f", contact.velocity, contact.normal, "tanh", {"mu": "mu", "v0": 1e-2})
    by_law = hs.load("dfcs").regularized("tanh", v0=1e-2)
    replaced = hs.Model(
        "declared", states=hs.load("dfcs").states, parameters=hs.load("dfcs").parameters, contacts=[declared]
    )
    first, second = (hs.simulate(m, (0, 0.02), integrator="dop853", rtol=1e-10) for m in (found, replaced))
    assert first(0.02) == pytest.approx(second(0.02), rel=1e-12)
    assert by_law.contacts == ()


def test_the_cubic_of_a_table_is_scipys() -> None:
    points, table = PchipInterpolator(*POINTS), hs.LawTable("mu", *POINTS)
    for k in range(251):
        assert table.value(k / 100) == pytest.approx(float(points(k / 100)), rel=1e-14)
    assert (table.value(-1), table.value(9)) == (0.6, 0.5)


def test_a_table_over_a_parameter_of_the_law() -> None:
    """mu over the place, by points on a straight line: as test_a_coefficient_that_depends_on_place."""
    law = hs.FrictionLaw(
        "worn", "mu*N", "mu*N", ["x"], tables=[hs.LawTable("mu", [0, 1, 4], [0.3, 0.45, 0.9], over="x")]
    )
    _, x = stop(sliding(law, {"x": "x"}, 4.0), 3.0, "dop853")
    assert x == pytest.approx(sqrt(4 + 16 * 2 / 3) - 2, rel=1e-8)
