"""Unilateral contacts with restitution against closed forms: bounces and their limit, lift-off, stacks, friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import hybridsim as hs

LOCATING = ("exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853", "cvode-adams")
G = 9.81


def ball(**parameters):
    return hs.Model(
        "ball",
        states=[hs.State("h", 1, der="w", nominal=1), hs.State("w", 0, der="-g + p/m", nominal=1)],
        parameters={"g": G, "m": 2, "e": 0.7} | parameters,
        impacts=[hs.Impact("p", gap="h", restitution="e")],
    )


def of(solution, component):
    return [event for event in solution.events if event.component == component]


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "scipy-dop853"])
@pytest.mark.parametrize("e", [0.3, 0.7, 0.9])
def test_a_bouncing_ball_comes_to_rest_where_its_bounces_accumulate(integrator, e):
    solution = hs.simulate(ball(e=e), (0, 12), integrator=integrator, rtol=1e-12)
    first = math.sqrt(2 / G)
    bounces = of(solution, "p")
    assert solution.success
    # the k-th bounce: t0 + 2 t0 (e + ... + e^k)
    for k, event in enumerate(bounces[:12]):
        assert event.t == pytest.approx(first * (1 + 2 * e * (1 - e**k) / (1 - e)), rel=1e-11)
    limit = first * (1 + e) / (1 - e)
    assert bounces[-1].target == "closed"
    assert bounces[-1].t == pytest.approx(limit, rel=1e-9)
    assert len(bounces) < 3 + math.log(1e-15) / math.log(e)  # work is bounded
    assert solution.y[:, -1].tolist() == [0.0, 0.0]
    assert solution.output("p", 12.0) == pytest.approx(2 * G, rel=1e-15)


@pytest.mark.parametrize("integrator", LOCATING)
def test_each_bounce_by_its_closed_form(integrator):
    solution = hs.simulate(ball(e=0.8), (0, 1.5), integrator=integrator, rtol=1e-10)
    first = math.sqrt(2 / G)
    bounces = of(solution, "p")
    assert [event.t for event in bounces] == pytest.approx([first, first * 2.6], rel=1e-8)
    speed = 0.8 * math.sqrt(2 * G)
    assert bounces[0].x_plus == pytest.approx([0, speed], abs=1e-7)
    assert bounces[0].x_plus[0] == 0.0


def test_a_dead_impact_closes_at_once():
    solution = hs.simulate(ball(e=0), (0, 1))
    (event,) = solution.events
    assert (event.source, event.target) == ("open", "closed")
    assert event.x_plus.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "exact"])
@pytest.mark.parametrize("e", [0.02, 0.07, 0.13])
def test_bounces_lower_than_the_rounding_of_the_gap_are_rest(e, integrator):
    """After a few impacts with little restitution the ball is up by less than an ulp of its height."""
    model = hs.Model(
        "shelf",
        states=[hs.State("h", 1.3, der="w"), hs.State("w", 0, der="-g + p/m + a*sin(t)")],
        parameters={"g": G, "m": 2, "e": e, "d": 0.3, "a": 1e-3},
        impacts=[hs.Impact("p", gap="h - d", restitution="e")],
    )
    solution = hs.simulate(model, (0, 4), integrator=integrator, limits={"events": 60})
    assert solution.success
    bounces = of(solution, "p")
    limit = math.sqrt(2 / G) * (1 + e) / (1 - e)  # without the small force, which is 1e-4 of the weight
    assert bounces[-1].target == "closed"
    assert bounces[-1].t == pytest.approx(limit, rel=2e-4)
    assert solution.y[:, -1].tolist() == [0.3, 0.0]


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "exact"])
def test_a_body_that_slides_on_a_switching_line_is_struck_where_it_is(integrator):
    """x + v = 0 is held by a relay until another body strikes; the velocities jump and the positions do not."""
    e, m0, m1 = 0.4, 1.0, 3.0
    model = hs.Model(
        "struck",
        states=[
            hs.State("x", 1, der="v"),
            hs.State("v", -1, der="(-2*u + p)/m0"),
            hs.State("y", -1, der="w"),
            hs.State("w", 2, der="-p/m1"),
        ],
        parameters={"m0": m0, "m1": m1, "e": e},
        surfaces=[hs.SwitchingSurface("u", "x + v")],
        impacts=[hs.Impact("p", gap="x - y", restitution="e")],
    )
    solution = hs.simulate(model, (0, 1), integrator=integrator, rtol=1e-12)
    t = brentq(lambda t: math.exp(-t) - (2 * t - 1), 0, 1, xtol=1e-15)
    before = np.array([math.exp(-t), -math.exp(-t), math.exp(-t), 2])
    impulse = (1 + e) * (2 + math.exp(-t)) * m0 * m1 / (m0 + m1)
    after = before + impulse * np.array([0, 1 / m0, 0, -1 / m1])
    event = of(solution, "p")[0]
    assert event.t == pytest.approx(t, rel=1e-11)
    assert event.x_minus == pytest.approx(before, rel=1e-11)
    assert event.x_plus == pytest.approx(after, rel=1e-11)


def test_what_starts_on_the_ground_rests_rises_or_hits_it():
    assert not hs.simulate(ball(), (0, 1), x0={"h": 0, "w": 0}).events
    rises = hs.simulate(ball(), (0, 0.1), x0={"h": 0, "w": 1})
    assert rises.y[0, -1] == pytest.approx(0.1 - G * 0.005, rel=1e-14) and not rises.events
    hits = hs.simulate(ball(), (0, 0.1), x0={"h": 0, "w": -1})
    assert hits.events[0].t == 0.0 and hits.events[0].x_plus[1] == pytest.approx(0.7, rel=1e-15)


def test_a_start_below_the_ground_is_named():
    solution = hs.simulate(ball(), (0, 1), x0={"h": -0.1})
    assert solution.status == "inconsistent"
    assert "the gap of p is -0.1, below zero" in solution.message


def test_backward_in_time_an_impact_has_no_unique_past():
    solution = hs.simulate(ball(), (0, -1), x0={"h": 0.1, "w": 1})
    assert solution.status == "backward-nonunique"


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "scipy-dop853", "exact"])
def test_a_table_throws_its_load_off_where_it_falls_away_faster(integrator):
    A, omega = 0.05, 20.0
    table = hs.Model(
        "table",
        states=[hs.State("h", 0, der="w", nominal=0.05), hs.State("w", "A*omega", der="-g + p/m", nominal=1)],
        parameters={"g": G, "m": 2, "A": A, "omega": omega, "e": 0.2},
        impacts=[hs.Impact("p", gap="h - A*sin(omega*t)", restitution="e")],
    )
    solution = hs.simulate(table, (0, 3), integrator=integrator, rtol=1e-10)
    assert solution.success
    # it starts with the speed of the table and rests on it until g = A omega^2 sin(omega t)
    opens = [event for event in of(solution, "p") if event.source == "closed"]
    phase = math.asin(G / (A * omega**2))
    assert opens[0].t == pytest.approx(phase / omega, rel=1e-12)
    for event in opens:  # and so it is whenever it lies on the table again
        turns = (event.t * omega - phase) / (2 * math.pi)
        assert turns == pytest.approx(round(turns), abs=1e-10)
    # the flight after it: a parabola from there, until it meets the table again
    t0, h0, w0 = opens[0].t, A * math.sin(phase), A * omega * math.cos(phase)
    s = of(solution, "p")[1].t - t0
    assert h0 + w0 * s - G * s * s / 2 == pytest.approx(A * math.sin(omega * (t0 + s)), abs=1e-10)
    closed = [i for i in solution.modes["p"] if i.mode == "closed"]
    middle = 0.5 * (closed[0].t0 + closed[0].t1)
    assert solution(middle)[0] == pytest.approx(A * math.sin(omega * middle), rel=1e-15)


def stack(**values):
    return hs.Model(
        "stack",
        states=[
            hs.State("x", 1, der="u", nominal=1), hs.State("u", 0, der="-g + (p - q)/M", nominal=1),
            hs.State("y", 1, der="v", nominal=1), hs.State("v", 0, der="-g + q/m", nominal=1),
        ],
        parameters={"g": G, "M": 3, "m": 1, "e": 1} | values,
        impacts=[hs.Impact("p", gap="x", restitution="e"), hs.Impact("q", gap="y - x", restitution="e")],
    )  # fmt: skip


def test_two_balls_that_fall_together_hit_the_ground_as_one_problem():
    solution = hs.simulate(stack(), (0, 0.6), integrator="taylor")
    (event,) = of(solution, "p")
    fall = math.sqrt(2 * G)
    # 0 <= P, u+ >= e max(-u-, 0): the ground sends the lower back, and the upper, which lies on it, goes along
    assert event.x_plus == pytest.approx([0, fall, 0, fall], abs=1e-13)


def test_a_small_gap_between_them_gives_the_high_jump_of_the_upper_one():
    # to just after it: the lower one is left with next to no speed, and with e = 1 it bounces on for ever
    solution = hs.simulate(stack(), (0, 0.4517), integrator="taylor", x0={"y": 1 + 1e-9})
    # successive impacts, each of two bodies: v = (3 M - m)/(M + m) times the speed of the fall
    last = of(solution, "q")[0]
    assert last.x_plus[3] == pytest.approx((3 * 3 - 1) / 4 * math.sqrt(2 * G), rel=1e-8)


def test_the_order_of_declaration_does_not_matter():
    one = hs.simulate(stack(e=0.5), (0, 1.5), integrator="taylor", x0={"y": 1.3, "v": -1})
    model = stack(e=0.5)
    turned = hs.Model(
        "turned", model.states[2:] + model.states[:2], model.parameters, impacts=model.impacts[::-1]
    )
    other = hs.simulate(turned, (0, 1.5), integrator="taylor", x0={"y": 1.3, "v": -1})
    assert [e.t for e in of(one, "q")] == pytest.approx([e.t for e in of(other, "q")], rel=1e-12)
    assert one.y[:, -1] == pytest.approx(other.y[[2, 3, 0, 1], -1], abs=1e-12)


def block(u0):
    return hs.Model(
        "block",
        states=[
            hs.State("x", 0, der="u", nominal=1), hs.State("u", u0, der="-f/m", nominal=1),
            hs.State("h", 0.2, der="w", nominal=1), hs.State("w", 0, der="-g + p/m", nominal=1),
        ],
        parameters={"g": G, "m": 2, "mu": 0.3, "e": 0.5},
        impacts=[hs.Impact("p", gap="h", restitution="e")],
        contacts=[hs.Contact("f", "u", "p", "coulomb", {"mu": "mu"})],
    )  # fmt: skip


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "exact"])
def test_a_block_thrown_on_a_rough_floor_loses_speed_at_each_bounce_until_it_sticks(integrator):
    solution = hs.simulate(block(1.0), (0, 2), integrator=integrator, rtol=1e-11)
    assert solution.success
    fall = math.sqrt(2 * G * 0.2)
    bounces = of(solution, "p")
    first = 1.0 - 0.3 * 1.5 * fall  # a friction impulse of mu m (1 + e) w
    assert bounces[0].x_plus[1] == pytest.approx(first, rel=1e-9)
    assert 0.3 * 1.5 * 0.5 * fall > first  # so that the next one stops it
    assert bounces[1].x_plus[1] == 0.0
    landed = fall / G * (1 + 2 * 0.5 / 0.5)
    assert bounces[-1].t == pytest.approx(landed, rel=1e-9)
    way = fall / G + first * 2 * 0.5 * fall / G
    assert solution.y[0, -1] == pytest.approx(way, rel=1e-9)
    assert dict(solution.modes)["f"][-1].mode == "stick"


def test_what_still_slides_after_the_landing_is_slowed_by_its_weight():
    solution = hs.simulate(block(4.0), (0, 3), integrator="taylor")
    fall = math.sqrt(2 * G * 0.2)
    # all impulses together: mu m (1 + e) w (1 + e + ...) = mu m (1 + e)/(1 - e) w, then mu g a second
    landed = 3 * fall / G
    slow = 4.0 - 0.3 * 3 * fall
    assert solution(landed + 0.1)[1] == pytest.approx(slow - 0.3 * G * 0.1, rel=1e-9)
    (stop,) = [e for e in of(solution, "f") if e.target == "stick"]
    assert stop.t == pytest.approx(landed + slow / (0.3 * G), rel=1e-9)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "exact"])
def test_a_body_that_sticks_by_its_own_weight_is_set_off_by_a_blow(integrator):
    model = hs.Model(
        "shove",
        states=[
            hs.State("x", -1, der="v", nominal=1), hs.State("v", 1, der="-p", nominal=1),
            hs.State("y", 0, der="w", nominal=1), hs.State("w", 0, der="p - f", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="y - x", restitution=0.6)],
        contacts=[hs.Contact("f", "w", 1, "coulomb", {"mu": 0.3})],
    )  # fmt: skip
    solution = hs.simulate(model, (0, 2), integrator=integrator, rtol=1e-11)
    assert solution.success
    # equal masses: (1 + e)/2 for the one that was at rest, (1 - e)/2 for the other; friction has no impulse of its own
    blow = solution.events[0]
    assert blow.t == pytest.approx(1, rel=1e-12)
    assert blow.x_plus == pytest.approx([0, 0.2, 0, 0.8], abs=1e-12)
    assert solution(2.0)[[2, 3]] == pytest.approx([0.8 - 0.15, 0.8 - 0.3], rel=1e-11)


def rattle():
    return hs.Model(
        "rattle",
        states=[hs.State("x", 0, der="v", nominal=1), hs.State("v", 1, der="p - q", nominal=1)],
        parameters={"d": 1, "e": 0.8},
        impacts=[hs.Impact("p", gap="x + d", restitution="e"), hs.Impact("q", gap="d - x", restitution="e")],
    )


def test_a_body_between_two_stops_hits_them_in_turn():
    solution = hs.simulate(rattle(), (0, 20), integrator="exact")
    names = [event.component for event in solution.events]
    assert names == ["qp"[k % 2] for k in range(len(names))] and len(names) == 5
    times = [1 + 2 * sum(0.8**-j for j in range(1, k + 1)) for k in range(len(names))]
    assert [event.t for event in solution.events] == pytest.approx(times, rel=1e-13)


def test_restitution_that_depends_on_the_speed_of_approach():
    model = hs.Model(
        "soft",
        states=[hs.State("h", 1, der="w"), hs.State("w", 0, der="-g + p")],
        parameters={"g": G},
        impacts=[hs.Impact("p", gap="h", restitution="0.9*exp(-speed/10)")],
    )
    solution = hs.simulate(model, (0, 1.5), integrator="taylor")
    speed = math.sqrt(2 * G)
    for event in of(solution, "p"):
        assert -event.x_minus[1] == pytest.approx(speed, rel=1e-12)
        speed *= 0.9 * math.exp(-speed / 10)
        assert event.x_plus[1] == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("integrator", ["dop853", "exact", "moreau"])
@pytest.mark.parametrize(("e", "exactly"), [("(a + b)/c", 1.0), ("c - (a + b)", 0.0)])
def test_a_restitution_that_rounding_carries_beyond_its_bounds_is_on_them(integrator, e, exactly):
    values = {"g": G, "a": 0.1, "b": 0.2, "c": 0.3}
    by_hand = (0.1 + 0.2) / 0.3 if exactly else 0.3 - (0.1 + 0.2)
    assert abs(by_hand - exactly) < 3e-16 and not 0 <= by_hand <= 1
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1, der="w", nominal=1), hs.State("w", 0, der="-g + p", nominal=1)],
        parameters=values,
        impacts=[hs.Impact("p", gap="h", restitution=e)],
    )
    options = {"step": 1e-3} if integrator == "moreau" else {}
    fall = math.sqrt(2 / G)
    solution = hs.simulate(ball, (0, 1.5 * fall), integrator=integrator, **options)
    assert solution.success, solution.message
    # up again to 3/4 of the height at half of the time, or at rest
    assert solution.y[0, -1] == pytest.approx(0.75 * exactly, abs=5e-3 if integrator == "moreau" else 1e-8)


@pytest.mark.parametrize("integrator", ["dop853", "moreau"])
def test_a_restitution_beyond_its_bounds_is_named_with_its_value(integrator):
    bodies = hs.Model(
        "two",
        states=[
            hs.State("x", 1, der="u", nominal=1), hs.State("u", -1, der="p", nominal=1),
            hs.State("y", 2, der="v", nominal=1), hs.State("v", -4, der="q", nominal=1),
        ],
        impacts=[
            hs.Impact("p", gap="x", restitution=0.5),
            hs.Impact("q", gap="y", restitution="0.4 + 0.2*speed"),
        ],
    )  # fmt: skip
    options = {"step": 1e-3} if integrator == "moreau" else {}
    solution = hs.simulate(bodies, (0, 3), integrator=integrator, **options)
    assert solution.status == "inconsistent"
    assert "restitution of q is 1.2" in solution.message and "approach of 4" in solution.message
    assert solution.t_end == pytest.approx(0.5, abs=2e-3)


def test_a_gap_that_no_state_is_linear_in_is_kept_by_projection():
    # a pendulum whose bob comes down on a floor: it rests where l (1 - cos th) = d
    pendulum = hs.Model(
        "pendulum",
        states=[hs.State("th", 1.0, der="om", nominal=1), hs.State("om", 0, der="-g/l*sin(th) + p*sin(th)/(m*l)")],
        parameters={"g": G, "l": 1, "m": 2, "d": 0.1},
        impacts=[hs.Impact("p", gap="l*(1 - cos(th)) - d", restitution=0.5)],
    )  # fmt: skip
    solution = hs.simulate(pendulum, (0, 4), integrator="taylor")
    assert solution.success
    angle = math.acos(0.9)
    (first, *_, last) = of(solution, "p")
    speed = math.sqrt(2 * G * (math.cos(angle) - math.cos(1.0)))
    assert first.x_minus == pytest.approx([angle, -speed], rel=1e-11)
    assert first.x_plus[1] == pytest.approx(speed / 2, rel=1e-11)
    assert last.target == "closed"
    assert solution.y[:, -1] == pytest.approx([angle, 0.0], abs=1e-14)
    assert np.asarray(solution.output("p", 4.0)) == pytest.approx(2 * G, rel=1e-12)


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
def test_methods_with_rules_of_their_own_refuse(integrator):
    with pytest.raises(hs.UsageError, match="impulses"):
        hs.simulate(ball(), (0, 1), integrator=integrator)


def test_analyses_that_know_no_impacts_refuse():
    with pytest.raises(hs.UsageError, match="impacts, for which"):
        hs.steady_state("vibrating-table")


def test_an_impact_is_explained_by_its_impulses():
    solution = hs.simulate(block(1.0), (0, 0.3), integrator="taylor")
    fall = math.sqrt(2 * G * 0.2)
    assert f"its impulses change u from 1 to {1 - 0.45 * fall:.6g}" in str(solution.explain(0))


def test_a_run_in_parts_goes_on_in_contact():
    whole = hs.simulate("vibrating-table", (0, 1))
    part = hs.simulate("vibrating-table", (0, 0.15))
    assert part.modes["p"][-1].mode == "closed"
    assert part.resume(1.0).y[:, -1] == pytest.approx(whole.y[:, -1], rel=1e-12)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-rk45"])
def test_a_ball_that_comes_to_rest_leaves_another_in_the_air(integrator: str) -> None:
    """From 1 m and 1.1 m: the first rests at once (e = 1e-5), the second falls on and bounces with e = 1/2."""
    model = hs.Model(
        "two",
        states=[
            hs.State("a", 1, "va"),
            hs.State("va", 0, "p - 10"),
            hs.State("b", 1.1, "vb"),
            hs.State("vb", 0, "q - 10"),
        ],
        impacts=[hs.Impact("p", "a", restitution=1e-5), hs.Impact("q", "b", restitution=0.5)],
    )
    sol = hs.simulate(model, (0, 0.6), integrator=integrator, rtol=1e-10)
    first, second = math.sqrt(0.2), math.sqrt(0.22)
    assert [e.t for e in sol.events if e.component == "q"] == pytest.approx([second], abs=1e-9)
    assert [e.t for e in sol.events if e.target == "closed"] == pytest.approx([first], abs=2e-5)
    s = 0.6 - second
    assert sol(0.6) == pytest.approx([0, 0, 5 * second * s - 5 * s**2, 5 * second - 10 * s], abs=1e-8)
    for event in sol.events:
        assert "closed" in sol.explain(event).reason or event.target == "open"


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize("end", [2.0, 1e3, 1e5])
def test_the_limit_of_bounces_does_not_move_with_the_end_of_the_run(integrator: str, end: float) -> None:
    sol = hs.simulate(ball(e=0.5, g=10), (0, end), integrator=integrator)
    closed = next(e.t for e in sol.events if e.target == "closed")
    assert closed == pytest.approx(3 * math.sqrt(0.2), rel=1e-9)
