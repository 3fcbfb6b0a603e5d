"""Impacts in compiled loops: closed forms, no segment of the general loop, and runs through the general loop alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import hybridsim as hs
from hybridsim.engine.run import mode_loop
from hybridsim.integrators.registry import integrator_class

METHODS = ("exact", "taylor", "dop853", "tsit5")
G = 9.81
FALL = math.sqrt(2 / G)  # time of a fall from a height of 1


@pytest.fixture
def no_general_segments(monkeypatch: pytest.MonkeyPatch):
    """Let a segment of the general loop fail the test."""

    def refuse(*_, **__):
        raise AssertionError("the general loop took a segment")

    monkeypatch.setattr(mode_loop, "SegmentRun", refuse)


def assert_same_both_ways(model, span, method, monkeypatch, **options):
    """A compiled loop and the general loop have the same events, warnings and states to within the tolerance."""
    compiled = hs.simulate(model, span, integrator=method, rtol=1e-11, **options)
    segments = []
    segment_run = mode_loop.SegmentRun
    with monkeypatch.context() as patch:
        patch.setattr(integrator_class(method), "has_compiled_loop", False)
        patch.setattr(mode_loop, "SegmentRun", lambda *args: segments.append(args) or segment_run(*args))
        # a copy, because a known model keeps its compiled loop
        general = hs.simulate(replace(model), span, integrator=method, rtol=1e-11, **options)
    assert 2 * len(segments) > sum(event.guard == "gap" for event in general.events)
    kinds = [
        [(e.kind, e.component, e.guard, e.source, e.target, e.direction) for e in sol.events]
        for sol in (compiled, general)
    ]
    assert kinds[0] == kinds[1]
    assert (compiled.status, compiled.warnings) == (general.status, general.warnings)
    assert [e.t for e in compiled.events] == pytest.approx([e.t for e in general.events], rel=1e-9, abs=1e-9)
    for side in ("x_minus", "x_plus"):
        a, b = (np.array([getattr(e, side) for e in sol.events]) for sol in (compiled, general))
        assert a == pytest.approx(b, rel=1e-8, abs=1e-8)
    assert compiled.y[:, -1] == pytest.approx(general.y[:, -1], rel=1e-8, abs=1e-8)
    assert compiled.stats["events"] == general.stats["events"]


def ball(restitution, gap="h", **parameters):
    return hs.Model(
        "ball",
        states=[hs.State("h", 1, der="w", nominal=1), hs.State("w", 0, der="-g + p/m", nominal=1)],
        parameters={"g": G, "m": 2} | parameters,
        impacts=[hs.Impact("p", gap=gap, restitution=restitution)],
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_that_loses_nothing_bounces_at_equal_intervals(method, no_general_segments):
    solution = hs.simulate(ball(1), (0, 50), integrator=method, rtol=1e-11)
    count = int((50 / FALL - 1) // 2) + 1
    assert [(e.component, e.guard, e.source, e.target) for e in solution.events] == [
        ("p", "gap", "open", "open")
    ] * count
    assert [e.t for e in solution.events] == pytest.approx(
        [FALL * (1 + 2 * k) for k in range(count)], rel=1e-9
    )
    for event in solution.events:
        assert event.x_plus[0] == 0.0
        assert event.x_plus[1] == pytest.approx(math.sqrt(2 * G), rel=1e-9)
        assert event.x_minus[1] == pytest.approx(-math.sqrt(2 * G), rel=1e-9)
    apex = solution(2 * FALL * np.arange(1, 20))
    assert apex[0] == pytest.approx(np.ones(19), rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_the_first_rebounds_from_a_raised_floor(method, no_general_segments):
    e, d = 0.7, 0.36
    fall = math.sqrt(2 * (1 - d) / G)
    ends = [fall, fall * (1 + 2 * e), fall * (1 + 2 * e + 2 * e * e)]
    solution = hs.simulate(ball("e", "h - d", e=e, d=d), (0, ends[-1] + 0.01), integrator=method, rtol=1e-12)
    assert [event.t for event in solution.events] == pytest.approx(ends, rel=1e-10)
    assert [event.x_plus[0] for event in solution.events] == [d] * 3
    assert [event.x_plus[1] for event in solution.events] == pytest.approx(
        [e**k * G * fall for k in (1, 2, 3)], rel=1e-10
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_restitution_that_depends_on_the_speed(method, no_general_segments):
    solution = hs.simulate(ball("0.9*exp(-speed/10)"), (0, 1.4), integrator=method, rtol=1e-12)
    speed, t, found = G * FALL, FALL, []
    while t < 1.4:
        speed *= 0.9 * math.exp(-speed / 10)
        found.append((t, speed))
        t += 2 * speed / G
    assert len(found) > 1
    assert [e.t for e in solution.events] == pytest.approx([t for t, _ in found], rel=1e-10)
    assert [e.x_plus[1] for e in solution.events] == pytest.approx([v for _, v in found], rel=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_a_body_between_two_walls(method, no_general_segments):
    e = 0.8
    rattle = hs.Model(
        "rattle",
        states=[hs.State("x", 0, der="v", nominal=1), hs.State("v", 1, der="p - q", nominal=1)],
        impacts=[hs.Impact("p", "x + 1", restitution=e), hs.Impact("q", "1 - x", restitution=e)],
    )
    solution = hs.simulate(rattle, (0, 200), integrator=method, rtol=1e-11)
    times = [1.0]
    while times[-1] + 2 / e ** len(times) < 200:
        times.append(times[-1] + 2 / e ** len(times))
    assert len(times) > 12
    assert [event.component for event in solution.events] == ["qp"[k % 2] for k in range(len(times))]
    assert [event.t for event in solution.events] == pytest.approx(times, rel=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_equal_balls_exchange_their_velocities(method, no_general_segments):
    """Two equal masses one above the other move at e = 1 like two balls that pass through each other."""
    column = hs.Model(
        "column",
        states=[
            hs.State("x", 1, der="u"), hs.State("u", 0, der="-g + (p - q)/m"),
            hs.State("y", 1.7, der="v"), hs.State("v", 0, der="-g + q/m"),
        ],
        parameters={"m": 1.7, "g": G},
        impacts=[hs.Impact("p", "x", restitution=1), hs.Impact("q", "y - x", restitution=1)],
    )  # fmt: skip
    solution = hs.simulate(column, (0, 20), integrator=method, rtol=1e-11)

    def alone(h, t):
        fall = math.sqrt(2 * h / G)
        return h - G * ((t + fall) % (2 * fall) - fall) ** 2 / 2

    times = np.linspace(0.05, 20, 601)
    free = np.sort([alone(1, times), alone(1.7, times)], axis=0)
    assert solution(times)[[0, 2]] == pytest.approx(free, abs=1e-7)
    assert len(solution.events) > 50


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_on_a_vibrating_table(method, no_general_segments):
    """Each flight ends where the parabola meets the table, and the relative velocity turns over with e = 0.8."""
    A, omega, e = 0.3, 8.0, 0.8
    solution = hs.simulate(
        ball("e", "h - A*sin(omega*t)", A=A, omega=omega, e=e), (0, 6), integrator=method, rtol=1e-12
    )
    t, h, w, found = 0.0, 1.0, 0.0, []
    while True:

        def gap(s, t=t, h=h, w=w):
            return h + w * s - G * s * s / 2 - A * math.sin(omega * (t + s))

        grid = np.linspace(1e-4, 3, 20001)
        first = next((i for i in range(20000) if gap(grid[i]) > 0 >= gap(grid[i + 1])), None)
        assert first is not None
        s = brentq(gap, grid[first], grid[first + 1], xtol=1e-15)
        t, w = t + s, w - G * s
        if t > 6:
            break
        h, table = A * math.sin(omega * t), A * omega * math.cos(omega * t)
        w = table - e * (w - table)
        found.append((t, w))
    assert len(found) > 6
    assert [event.t for event in solution.events] == pytest.approx([t for t, _ in found], abs=1e-8)
    assert [event.x_plus[1] for event in solution.events] == pytest.approx([w for _, w in found], abs=1e-7)


def train(e):
    """Three masses on springs beside a wall, driven, with clearances between them."""
    return hs.Model(
        "train",
        states=[
            hs.State("x", 0.0, der="u"), hs.State("u", 0, der="-4*x - 0.05*u + sin(1.7*t) + p - q"),
            hs.State("y", 0.5, der="v"), hs.State("v", 0, der="-2*(y - 0.5) - 0.02*v + (q - r)/2"),
            hs.State("z", 1.1, der="w"), hs.State("w", 0, der="-3*(z - 1.1) + 0.8*cos(2.3*t) + r"),
        ],
        impacts=[
            hs.Impact("p", "x + 0.4", restitution=e), hs.Impact("q", "y - x - 0.1", restitution=e),
            hs.Impact("r", "z - y - 0.2", restitution="0.9 - 0.1*speed"),
        ],
    )  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("e", [1, 0.7])
def test_masses_in_a_row_both_ways(method, e, monkeypatch):
    assert_same_both_ways(train(e), (0, 8), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("e", [0.3, 0.8])
def test_rest_at_the_end_of_bounces_both_ways(method, e, monkeypatch):
    model = ball("e", "h - A*sin(omega*t)", A=0.02, omega=25.0, e=e)
    assert_same_both_ways(model, (0, 1.5), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
def test_two_balls_that_bounce_at_their_own_pace_both_ways(method, monkeypatch):
    model = hs.Model(
        "two",
        states=[
            hs.State("a", 1, "va"), hs.State("va", 0, "p - 10"),
            hs.State("b", 1.3, "vb"), hs.State("vb", 0, "q - 10"),
        ],
        impacts=[hs.Impact("p", "a", restitution=0.6), hs.Impact("q", "b", restitution=0.5)],
    )  # fmt: skip
    assert_same_both_ways(model, (0, 3), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS[1:])
def test_a_ball_in_a_round_table(method, no_general_segments):
    """All chords of a path without loss subtend one angle, and the speed stays."""
    drum = hs.Model(
        "drum",
        states=[
            hs.State("x", 0.3, der="u"), hs.State("u", 0.4, der="-p*x/R"),
            hs.State("y", 0.0, der="v"), hs.State("v", 0.9, der="-p*y/R"),
        ],
        parameters={"R": 1.0},
        impacts=[hs.Impact("p", "R - sqrt(x**2 + y**2)", restitution=1)],
    )  # fmt: skip
    solution = hs.simulate(drum, (0, 60), integrator=method, rtol=1e-11)
    speed = math.hypot(0.4, 0.9)
    distance = 0.3 * 0.9 / speed  # of the chord from the centre
    chord, angle = 2 * math.sqrt(1 - distance**2), 2 * math.acos(distance)
    first = (-0.3 * 0.4 / speed + chord / 2) / speed
    place = math.atan2(0.9 * first, 0.3 + 0.4 * first)
    count = len(solution.events)
    assert count == int((60 - first) / (chord / speed)) + 1 > 30
    assert [e.t for e in solution.events] == pytest.approx(first + chord / speed * np.arange(count), rel=1e-9)
    for k, event in enumerate(solution.events):
        at = place + k * angle
        assert event.x_plus[[0, 2]] == pytest.approx([math.cos(at), math.sin(at)], abs=1e-8)
        assert math.hypot(event.x_plus[1], event.x_plus[3]) == pytest.approx(speed, rel=1e-9)


@pytest.mark.parametrize("method", METHODS[1:])
def test_a_pendulum_that_strikes_a_floor(method, no_general_segments):
    """The speeds at the floor follow from energy, and each is e times the one before."""
    e, d = 0.9, 0.1
    pendulum = hs.Model(
        "pendulum",
        states=[hs.State("th", 1.0, der="om"), hs.State("om", 0, der="-g/l*sin(th) + p*sin(th)/(m*l)")],
        parameters={"g": G, "l": 1, "m": 2, "d": d},
        impacts=[hs.Impact("p", gap="l*(1 - cos(th)) - d", restitution=e)],
    )
    solution = hs.simulate(pendulum, (0, 4), integrator=method, rtol=1e-11)
    speed = math.sqrt(2 * G * (1 - d - math.cos(1.0)))
    assert len(solution.events) > 4
    for k, event in enumerate(solution.events):
        assert event.x_minus == pytest.approx([math.acos(1 - d), -(e**k) * speed], rel=1e-8)
        assert event.x_plus == pytest.approx([math.acos(1 - d), e ** (k + 1) * speed], rel=1e-8)


def rubbed(mu):
    """A driven mass with dry friction and a stop."""
    return hs.Model(
        "rubbed",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="1.5*cos(0.7*t) - x - f + p")],
        parameters={"mu": mu},
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": "mu"})],
        impacts=[hs.Impact("p", "x + 1", restitution=0.8)],
    )


@pytest.mark.parametrize("method", METHODS)
def test_friction_beside_an_open_stop(method, no_general_segments):
    """The stop is out of reach: the motion is the one without it, all of it in the compiled loop."""
    beside = hs.simulate(rubbed(0.4), (0, 0.9 * math.pi / 0.7), integrator=method, rtol=1e-11)
    alone = hs.Model(
        "alone",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="1.5*cos(0.7*t) - x - f")],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": 0.4})],
    )
    free = hs.simulate(alone, (0, 0.9 * math.pi / 0.7), integrator=method, rtol=1e-11)
    assert len(free.events) > 0
    assert [(e.component, e.source, e.target) for e in beside.events] == [
        (e.component, e.source, e.target) for e in free.events
    ]
    assert [e.t for e in beside.events] == pytest.approx([e.t for e in free.events], rel=1e-9)
    assert beside.y[:, -1] == pytest.approx(free.y[:, -1], rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.05, 0.4])
def test_friction_and_a_stop_both_ways(method, mu, monkeypatch):
    assert_same_both_ways(rubbed(mu), (0, 40), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
def test_a_block_that_slides_between_two_walls_until_it_sticks(method, no_general_segments):
    """Friction takes a v^2 of 2 a L on each way, and a wall turns the friction over."""
    a, e, start = 0.7, 0.9, 4.0
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, der="v"), hs.State("v", start, der="p - q - f")],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": a})],
        impacts=[hs.Impact("p", "x + 1", restitution=e), hs.Impact("q", "1 - x", restitution=e)],
    )
    solution = hs.simulate(block, (0, 30), integrator=method, rtol=1e-12)
    t, v, way, times = 0.0, start, 1.0, []
    while v * v > 2 * a * way:
        arrival = math.sqrt(v * v - 2 * a * way)
        t, v, way = t + (v - arrival) / a, e * arrival, 2.0
        times.append(t)
    assert len(times) > 3
    turns = [
        ("gap", "open", "open"),
        ("reset", "slip+", "slip-"),
        ("gap", "open", "open"),
        ("reset", "slip-", "slip+"),
    ]
    expected = (turns * len(times))[: 2 * len(times)]
    expected.append(("velocity", "slip+" if len(times) % 2 == 0 else "slip-", "stick"))
    assert [(event.guard, event.source, event.target) for event in solution.events] == expected
    assert [event.component for event in solution.events[:4]] == ["q", "f", "p", "f"]
    assert solution.event_times("f")[:-1] == pytest.approx(times, rel=1e-10)
    assert solution.events[-1].t == pytest.approx(t + v / a, rel=1e-10)
    assert abs(solution.y[0, -1]) == pytest.approx(abs(v * v / (2 * a) - 1), rel=1e-9)


@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_drag_whose_side_turns_over_at_an_impact(method, monkeypatch):
    dragged = hs.Model(
        "dragged",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="1.5*cos(0.7*t) - x - 0.1*v*abs(v) + p - f")],
        impacts=[hs.Impact("p", "x + 1", restitution=0.8)],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": 0.05})],
    )
    assert_same_both_ways(dragged, (0, 20), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
def test_monitors_that_an_impact_carries_over_zero(method, no_general_segments):
    """The velocity jumps up at each blow and falls through zero at each apex; one monitor records only the blows."""
    model = replace(
        ball(1),
        monitors=(
            hs.Monitor("apex", "w", direction="down"),
            hs.Monitor("blow", "w + 0.25", direction="up"),
            hs.Monitor("both", "w - 1"),
        ),
    )
    solution = hs.simulate(model, (0, 9.9 * FALL), integrator=method, rtol=1e-11)
    blows = FALL * np.arange(1, 10, 2)
    assert solution.event_times("blow") == pytest.approx(blows, rel=1e-9)
    assert solution.event_times("p") == pytest.approx(blows, rel=1e-9)
    assert solution.event_times("apex") == pytest.approx(FALL * np.arange(2, 10, 2), rel=1e-9)
    slower = FALL * np.arange(2, 10, 2) - 1 / G
    assert solution.event_times("both") == pytest.approx(
        np.sort([*blows, *slower, 10 * FALL - 1 / G]), rel=1e-9
    )
    first = [(e.kind, e.component, e.direction) for e in solution.events if e.t < 1.5 * FALL]
    assert first == [("transition", "p", -1), ("monitor", "blow", 1), ("monitor", "both", 1)]
    assert {e.direction for e in solution.events if e.component == "apex"} == {-1}


@pytest.mark.parametrize("method", METHODS)
def test_monitors_and_impacts_both_ways(method, monkeypatch):
    monitors = (
        hs.Monitor("way", "v", direction="up"), hs.Monitor("fast", "v - 0.5"),
        hs.Monitor("place", "x - 0.2", direction="down"), hs.Monitor("power", "2*v + x"),
    )  # fmt: skip
    assert_same_both_ways(replace(rubbed(0.05), monitors=monitors), (0, 20), method, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
def test_a_monitor_ends_the_run_at_an_impact(method):
    model = replace(ball(1), monitors=(hs.Monitor("blow", "w", direction="up", action="terminate"),))
    solution = hs.simulate(model, (0, 5), integrator=method, rtol=1e-11)
    assert solution.status == "terminated"
    assert solution.t_end == pytest.approx(FALL, rel=1e-10)
    assert [e.component for e in solution.events] == ["p", "blow"]
