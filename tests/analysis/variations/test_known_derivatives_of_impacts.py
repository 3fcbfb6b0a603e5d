"""Derivatives through impacts of one and of several contacts, with friction and without, against closed forms."""

from __future__ import annotations

import math

import mpmath as mp
import pytest
from known_slopes import EXACT, check

import hybridsim as hs
from hybridsim.errors import UsageError


def skidding(u0: float, e: float) -> hs.Model:
    """A body falls from h0, and rubs in the impact and afterwards."""
    return hs.Model(
        "skid",
        parameters={"h0": 0.2, "u0": u0, "mu": 0.3, "e": e, "g": 9.81},
        states=[
            hs.State("x", 0, "u", nominal=1),
            hs.State("u", "u0", "-f", nominal=1),
            hs.State("h", "h0", "w", nominal=1),
            hs.State("w", 0, "-g + p", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="h", restitution="e")],
        contacts=[hs.Contact("f", "u", "p", "coulomb", {"mu": "mu"})],
    )


def test_an_impact_with_slip() -> None:
    """The impact takes mu (1 + e) sqrt(2 g h0) of the speed."""
    values = {"h0": 0.2, "u0": 3.0, "mu": 0.3, "e": 0.5, "g": 9.81}

    def x(t: mp.mpf, h0: mp.mpf, u0: mp.mpf, mu: mp.mpf, e: mp.mpf, g: mp.mpf) -> mp.mpf:
        fall = mp.sqrt(2 * h0 / g)
        return u0 * t - (mu * (1 + e) * g * fall * (t - fall) if t > fall else 0)

    def h(t: mp.mpf, h0: mp.mpf, u0: mp.mpf, mu: mp.mpf, e: mp.mpf, g: mp.mpf) -> mp.mpf:
        fall = mp.sqrt(2 * h0 / g)
        since = t - fall
        return h0 - g * t * t / 2 if since < 0 else e * g * fall * since - g * since**2 / 2

    solution = hs.simulate(skidding(3.0, 0.5), (0, 0.38), integrator="exact")
    check(solution, {"x": x, "h": h}, values, [0.1, 0.25, 0.38])


def test_an_impact_without_rebound_then_slip_to_rest() -> None:
    """u1 = u0 - mu g T after the fall of T = sqrt(2 h0/g); it stops after u1/(mu g)."""
    values = {"h0": 0.2, "u0": 1.5, "mu": 0.3, "g": 9.81}

    def x(t: mp.mpf, h0: mp.mpf, u0: mp.mpf, mu: mp.mpf, g: mp.mpf) -> mp.mpf:
        fall = mp.sqrt(2 * h0 / g)
        if t < fall:
            return u0 * t
        u1 = u0 - mu * g * fall
        since = min(t - fall, u1 / (mu * g))
        return u0 * fall + u1 * since - mu * g * since**2 / 2

    solution = hs.simulate(skidding(1.5, 0.0), (0, 1.0), integrator="exact")
    assert solution.modes["f"][-1].mode == "stick"
    check(solution, {"x": x}, values, [0.1, 0.3, 1.0])


def test_an_impact_that_stops_the_slip() -> None:
    """Within the friction cone the impact leaves no speed: x stays u0 sqrt(2 h0/g)."""
    values = {"h0": 0.2, "u0": 0.4, "mu": 0.3, "g": 9.81}

    def x(t: mp.mpf, h0: mp.mpf, u0: mp.mpf, mu: mp.mpf, g: mp.mpf) -> mp.mpf:
        return u0 * min(t, mp.sqrt(2 * h0 / g)) + 0 * mu

    solution = hs.simulate(skidding(0.4, 0.0), (0, 0.5), integrator="exact")
    check(solution, {"x": x}, values, [0.1, 0.3, 0.5])


def test_bodies_that_strike_each_other() -> None:
    """Masses m and M approach at u: afterwards v = u (m - e M)/(m + M) and w = u m (1 + e)/(m + M)."""
    values = {"m": 1.0, "M": 2.5, "e": 0.6, "u": 1.4, "d": 0.7}
    model = hs.Model(
        "pair",
        parameters=values,
        states=[
            hs.State("x", 0, "v", nominal=1),
            hs.State("v", "u", "-p/m", nominal=1),
            hs.State("y", "d", "w", nominal=1),
            hs.State("w", 0, "p/M", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="y - x", restitution="e")],
    )

    def x(t: mp.mpf, m: mp.mpf, M: mp.mpf, e: mp.mpf, u: mp.mpf, d: mp.mpf) -> mp.mpf:
        return u * t if t < d / u else d + u * (m - e * M) / (m + M) * (t - d / u)

    def y(t: mp.mpf, m: mp.mpf, M: mp.mpf, e: mp.mpf, u: mp.mpf, d: mp.mpf) -> mp.mpf:
        return d + (u * m * (1 + e) / (m + M) * (t - d / u) if t > d / u else 0)

    solution = hs.simulate(model, (0, 1), integrator="exact")
    check(solution, {"x": x, "y": y}, values, [0.3, 0.7, 1.0])


def test_a_floor_that_moves() -> None:
    """The floor rises at a speed V: the ball leaves it with V + e (V + g T), at V T = h0 - g T^2/2."""
    values = {"h0": 1.0, "e": 0.7, "g": 9.81, "V": 0.8}
    model = hs.Model(
        "lift",
        parameters=values,
        states=[hs.State("h", "h0", "w", nominal=1), hs.State("w", 0, "-g + p", nominal=1)],
        impacts=[hs.Impact("p", gap="h - V*t", restitution="e")],
    )

    def h(t: mp.mpf, h0: mp.mpf, e: mp.mpf, g: mp.mpf, V: mp.mpf) -> mp.mpf:
        hit = (-V + mp.sqrt(V * V + 2 * g * h0)) / g
        since = t - hit
        if since < 0:
            return h0 - g * t * t / 2
        return V * hit + (V + e * (V + g * hit)) * since - g * since**2 / 2

    check(hs.simulate(model, (0, 0.9), integrator="exact"), {"h": h}, values, [0.2, 0.5, 0.9])


def test_a_restitution_that_depends_on_the_speed() -> None:
    """e = 1 - a c at the speed of approach c = sqrt(2 g h0)."""
    values = {"h0": 0.5, "a": 0.1, "g": 9.81}
    model = hs.Model(
        "ball",
        parameters=values,
        states=[hs.State("h", "h0", "w", nominal=1), hs.State("w", 0, "-g + p", nominal=1)],
        impacts=[hs.Impact("p", gap="h", restitution="1 - a*speed")],
    )

    def w(t: mp.mpf, h0: mp.mpf, a: mp.mpf, g: mp.mpf) -> mp.mpf:
        fall = mp.sqrt(2 * h0 / g)
        return -g * t if t < fall else (1 - a * g * fall) * g * fall - g * (t - fall)

    check(hs.simulate(model, (0, 0.6), integrator="exact"), {"w": w}, values, [0.2, 0.4, 0.6])


def test_two_bodies_that_reach_their_floors_together_are_refused() -> None:
    """They fall from the heights a and b, and a change of one of them parts the two impacts in time."""
    model = hs.Model(
        "two",
        parameters={"a": 0.5, "b": 0.5},
        states=[
            hs.State("h", "a", "w", nominal=1),
            hs.State("w", 0, "-10 + p", nominal=1),
            hs.State("y", "b", "z", nominal=1),
            hs.State("z", 0, "-10 + q", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="h", restitution=0.5), hs.Impact("q", gap="y", restitution=0.5)],
    )
    solution = hs.simulate(model, (0, 0.4), integrator="exact")
    with pytest.raises(UsageError, match="several events coincide at t = 0"):
        hs.sensitivities(solution)


def test_accumulating_bounces_end_in_contact() -> None:
    """The bounces end at T = sqrt(2 h0/g) (1 + e)/(1 - e); x' = e is integrated beside them."""
    values = {"h0": 0.3, "e": 0.4, "g": 9.81}
    model = hs.Model(
        "ball",
        parameters=values,
        states=[
            hs.State("h", "h0", "w", nominal=1),
            hs.State("w", 0, "-g + p", nominal=1),
            hs.State("y", 0, "p", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="h", restitution="e")],
    )
    solution = hs.simulate(model, (0, 1.0), integrator="exact")
    found = hs.sensitivities(solution, list(values))
    # the impulses of y sum up to those of w: y = g t at rest
    assert found.at(1.0, "y").by_parameter[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert math.isclose(float(solution.output("y", 1.0)), 9.81, rel_tol=1e-9)
    assert found.at(1.0, ["h", "w"]).by_parameter == pytest.approx(0.0, abs=1e-12)
    fall = math.sqrt(2 * 0.3 / 9.81)
    end = fall * 1.4 / 0.6
    by_e = fall * 2 / 0.6**2
    assert found.times[-1] == pytest.approx(end, rel=EXACT)
    assert found.times_by_parameter[-1] == pytest.approx([0.5 * end / 0.3, by_e, -0.5 * end / 9.81], rel=1e-8)
