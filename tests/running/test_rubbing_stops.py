"""Friction in the direction of a stop: who carries what, when it lets go, and where a belt rubs on at rest."""

from __future__ import annotations

import pytest
from mpmath import cos, findroot, mp, mpf, sin

import hybridsim as hs
from hybridsim.engine.roots.roots import Crossing
from hybridsim.engine.run.locate import polish

METHODS = ["exact", "taylor", "dop853", "scipy-dop853"]


def block(drive: str, law: str = "coulomb", start: float = 0.0, **arguments: float) -> hs.Model:
    """A block of mass 1 and weight 10 with a stop at x = 0."""
    return hs.Model(
        "block",
        states=[hs.State("x", start, "v"), hs.State("v", 0, f"{drive} - f + p")],
        contacts=[hs.Contact("f", velocity="v", law=law, arguments=arguments, normal="10")],
        impacts=[hs.Impact("p", gap="x", restitution=0)],
    )


@pytest.mark.parametrize("integrator", METHODS)
def test_the_stop_carries_what_presses_and_friction_what_pulls(integrator: str) -> None:
    """A drive of t - 5; static friction holds up to 3, after it 1 is left: v' = t - 6 from 8 on."""
    sol = hs.simulate(
        block("t - 5", "static-kinetic", mu_s=0.3, mu_k=0.1), (0, 9), integrator=integrator, rtol=1e-10
    )
    assert [(e.t, e.component, e.target) for e in sol.events] == [
        (pytest.approx(8, rel=1e-13), "f", "slip+"),
        (pytest.approx(8, rel=1e-13), "p", "open"),
    ]
    assert sol.output("p", [1, 3, 5, 6, 7.5]) == pytest.approx([4, 2, 0, 0, 0], abs=1e-12)
    assert sol.output("f", [1, 3, 5, 6, 7.5]) == pytest.approx([0, 0, 0, 1, 2.5], abs=1e-12)
    assert sol(7.9).tolist() == [0.0, 0.0]
    assert sol(9.0) == pytest.approx([1 + 1 / 6, 2.5], rel=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
def test_a_block_that_friction_holds_does_not_reach_the_stop(integrator: str) -> None:
    sol = hs.simulate(block("-1", mu=0.2, start=0.5), (0, 5), integrator=integrator)
    assert sol(5.0).tolist() == [0.5, 0.0]
    assert [stretch.mode for stretch in sol.modes["p"]] == ["open"]


@pytest.mark.parametrize("integrator", METHODS)
def test_a_belt_rubs_on_under_a_block_at_a_stop(integrator: str) -> None:
    """It pulls with 2 towards the stop at 1, a spring with 1 back: 1 is left, and friction goes on slipping."""
    model = hs.Model(
        "belt",
        states=[hs.State("x", 0.5, "v"), hs.State("v", 0, "-x - f - q")],
        contacts=[hs.Contact("f", velocity="v - 0.5", law="coulomb", arguments={"mu": 0.2}, normal="10")],
        impacts=[hs.Impact("q", gap="1 - x", restitution=0.5)],
    )
    sol = hs.simulate(model, (0, 9), integrator=integrator)
    assert sol.status == "finished", sol.message
    assert sol(9.0).tolist() == [1.0, 0.0]
    assert (sol.modes["f"][-1].mode, sol.modes["q"][-1].mode) == ("slip-", "closed")
    assert sol.output("q", 9.0) == pytest.approx(1, rel=1e-13)
    assert sol.output("f", 9.0) == pytest.approx(-2, rel=1e-13)


@pytest.mark.parametrize("integrator", METHODS)
def test_two_bodies_that_rub_on_each_other_and_strike(integrator: str) -> None:
    """Masses 2 and 1; sin(t) on the first is all that acts from outside: 2 v1 + v2 = 3 - cos(t)."""
    model = hs.Model(
        "pair",
        states=[
            hs.State("x1", 0, "v1"), hs.State("v1", 1, "(f - p + sin(t))/2"),
            hs.State("x2", 0.5, "v2"), hs.State("v2", 0, "-f + p"),
        ],
        contacts=[hs.Contact("f", velocity="v2 - v1", law="coulomb", arguments={"mu": 0.02}, normal="10")],
        impacts=[hs.Impact("p", gap="x2 - x1", restitution=0.3)],
    )  # fmt: skip
    sol = hs.simulate(model, (0, 6), integrator=integrator, rtol=1e-11)
    assert sol.status == "finished", sol.message
    for t in (1.0, 2.0, 4.0, 6.0):
        _, v1, _, v2 = sol(t)
        assert 2 * v1 + v2 == pytest.approx(3 - cos(t), rel=1e-10)
    x1, v1, x2, v2 = sol(3.0)
    assert (x1, v1) == pytest.approx((x2, v2), abs=1e-13)


def test_the_normal_force_of_such_a_stop_loads_no_friction_along_it() -> None:
    model = hs.Model(
        "wedge",
        states=[hs.State("x", 1, "v"), hs.State("v", 0, "-1 - f + p")],
        contacts=[hs.Contact("f", velocity="v", law="coulomb", arguments={"mu": 0.2}, normal="1 + p")],
        impacts=[hs.Impact("p", gap="x", restitution=0)],
    )
    with pytest.raises(hs.ModelError, match="acts along the gap of p"):
        hs.simulate(model, (0, 1))


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize(
    ("e", "w", "a", "start", "end", "g"),
    [
        (0.2932010598323955, 2.1581985495959763, 0.02661768173695638, 0.44790139428532294, 17.416, 2.6923),
        (0.14642507325926463, 3.0372522733787033, 0.0488987157046506, 0.3853179873828366, 11.504, 1.4479),
        (0.34154476511801, 2.1260005205416297, 0.2943313796470051, 0.5789155576883843, 7.5441, 2.3352),
    ],
)
def test_each_bounce_on_a_moving_floor_is_where_its_flight_ends(
    integrator: str, e: float, w: float, a: float, start: float, end: float, g: float
) -> None:
    """From each event by the flight's own formula, in 40 digits; the bracket of a root may be off by a little."""
    falls = [hs.State("x", start, "v"), hs.State("v", 0, f"-{g} + p")]
    floor = hs.Impact("p", gap=f"x - {a}*sin({w}*t)", restitution=e)
    sol = hs.simulate(hs.Model("floor", states=falls, impacts=[floor]), (0, end), integrator=integrator)
    with mp.workdps(40):
        t, x, v = mpf(0), mpf(start), mpf(0)
        for event in sol.events[:7]:
            landed = findroot(lambda s: x + v * (s - t) - g * (s - t) ** 2 / 2 - a * sin(w * s), mpf(event.t))  # noqa: B023  # called at once
            rate = w * a * cos(w * landed)
            speed = abs(v - g * (landed - t) - rate)  # it hides a rounding of the place for so much longer
            assert abs(event.t - landed) < 1e-13 + 2e-16 / speed
            t, x, v = landed, a * sin(w * landed), rate - e * (v - g * (landed - t) - rate)


@pytest.mark.parametrize("shift", [-3e-9, 0.0, 3e-9])
def test_a_root_just_outside_of_its_bracket_is_found(shift: float) -> None:
    root = 4.3790042400361e-4
    place = polish(lambda theta: 1.0 - theta / root, Crossing(root - 7e-9 + shift, root + shift, -1))
    assert place == pytest.approx(root, rel=1e-15)
