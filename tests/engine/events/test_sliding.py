"""Sliding along switching surfaces: exact, without drift, left at the right instant, refused where it is not unique."""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import hybridsim as hs
from hybridsim.errors import ModelError

ALONG_A_CIRCLE = """
[states]
x = { start = 2, der = "rx - y" }
y = { start = 0, der = "ry + x" }

[surfaces.u]
expr = "x**2 + y**2 - 1"
above = { rx = "-x", ry = "-y" }
below = { rx = "x", ry = "y" }
"""
FORCED = """
[parameters]
A = 1.2

[states]
x = { start = 0, der = "A*sin(t) - u" }

[surfaces]
u = "x"
"""
HELPING = """
[states]
x = { start = 0, der = "-u - 2*w" }
y = { start = 0, der = "-2*u - w" }

[surfaces]
u = "x"
w = "y"
"""


def model(text: str) -> hs.Model:
    return hs.Model.from_toml(f'name = "m"\n{text}')


def run(text: str, t_end: float, **options: Any) -> hs.Solution:
    return hs.simulate(model(text), (0.0, t_end), **options)


def crossings(amplitude: float) -> tuple[float, float]:
    """Exit and entry of x' = A sin(t) - u in the first half period, from the closed form of the excursion between."""
    leaves = math.asin(1 / amplitude)
    back = brentq(
        lambda t: amplitude * (math.cos(leaves) - math.cos(t)) - (t - leaves),
        leaves + 0.1,
        leaves + 3,
        xtol=1e-15,
    )
    return leaves, back


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_entries_and_exits_of_a_forced_relay(integrator: str) -> None:
    leaves, back = crossings(1.2)
    count = 200
    solution = run(FORCED, count * math.pi, integrator=integrator)
    times = np.array([event.t for event in solution.events])
    expected = np.array([t + k * math.pi for k in range(count) for t in (leaves, back)])
    assert [event.target for event in solution.events][:4] == ["above", "sliding", "below", "sliding"]
    assert np.abs(times - expected).max() < 1e-9
    resting = np.array([back + 0.05 + k * math.pi for k in range(count - 1)])
    assert (solution(resting)[0] == 0.0).all()


@pytest.mark.slow
def test_a_hundred_thousand_periods_of_a_forced_relay() -> None:
    leaves, back = crossings(1.2)
    count = 200_000  # half periods
    solution = run(FORCED, count * math.pi, integrator="exact", keep="events")
    times = np.array([event.t for event in solution.events])
    expected = np.array([t + k * math.pi for k in range(count) for t in (leaves, back)])
    assert len(times) == len(expected)
    assert np.abs(times - expected).max() < 1e-9
    assert all(event.x_plus[0] == 0.0 for event in solution.events)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "scipy-dop853"])
def test_no_drift_off_a_circle(integrator: str) -> None:
    solution = run(ALONG_A_CIRCLE, 200 * math.pi, integrator=integrator, rtol=1e-10)
    x, y = solution(np.linspace(1.0, 200 * math.pi, 5001))
    assert np.abs(x**2 + y**2 - 1).max() <= 4.5e-16
    assert solution.events[0].t == pytest.approx(math.log(2), abs=1e-9)
    assert np.abs(np.angle(x[-1] + 1j * y[-1])) < 1e-7


@pytest.mark.slow
def test_no_drift_in_a_hundred_thousand_turns() -> None:
    end = 2e5 * math.pi
    solution = run(ALONG_A_CIRCLE, end, integrator="taylor", rtol=1e-10, keep=20 * math.pi)
    x, y = solution(np.linspace(end - 20 * math.pi, end, 5001))
    assert np.abs(x**2 + y**2 - 1).max() <= 4.5e-16


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_a_surface_that_moves(integrator: str) -> None:
    """r = 1 + sin(t)/10 while it slides, at angular speed 1."""
    text = """
    [states]
    x = { start = 1, der = "-2*u*x - y" }
    y = { start = 0, der = "-2*u*y + x" }

    [surfaces]
    u = "x**2 + y**2 - (1 + sin(t)/10)**2"
    """
    solution = run(text, 20.0, integrator=integrator, rtol=1e-10)
    t = np.linspace(0.0, 20.0, 401)
    x, y = solution(t)
    r = 1 + np.sin(t) / 10
    assert np.abs(np.hypot(x, y) - r).max() < 1e-15
    assert np.abs(x - r * np.cos(t)).max() < 1e-8
    assert solution.output("u", t) == pytest.approx(-np.cos(t) / 10 / r / 2, abs=1e-7)


def test_two_surfaces_that_share_states_and_are_not_linear() -> None:
    """Along the circle until the hyperbola x y = 1/4 is met, and at rest at their corner, to rounding."""
    text = """
    [states]
    x = { start = 1, der = "-2*u*x - y - 3*w*y" }
    y = { start = 0, der = "-2*u*y + x - 3*w*x" }

    [surfaces]
    u = "x**2 + y**2 - 1"
    w = "x*y - 1/4"
    """
    solution = run(text, 3.0, integrator="dop853", rtol=1e-10)
    x, y = solution(3.0)
    assert solution.modes["u"][-1].mode == solution.modes["w"][-1].mode == "sliding"
    assert abs(x**2 + y**2 - 1) < 1e-15
    assert abs(x * y - 0.25) < 1e-15
    assert (x, y) == pytest.approx((math.cos(math.pi / 12), math.sin(math.pi / 12)), abs=1e-12)


def test_the_weight_of_two_fields_is_that_of_filippov() -> None:
    """Above (1, -1), below (2, 3): u weighs them so that y stays, x' = (3*1 + 1*2)/4."""
    text = """
    [states]
    x = { start = 0, der = "vx" }
    y = { start = 0.5, der = "vy" }

    [surfaces.side]
    expr = "y"
    above = { vx = 1, vy = -1 }
    below = { vx = 2, vy = 3 }
    """
    solution = run(text, 1.5, integrator="exact")
    assert solution.events[0].t == 0.5
    assert solution.output("side", 1.0) == pytest.approx(0.5, abs=1e-15)
    assert solution(1.5) == pytest.approx((0.5 + 1.25, 0.0), abs=1e-15)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_the_order_of_declaration_does_not_matter(integrator: str) -> None:
    states = {"x": (1.0, "t - 2*u + w"), "y": (-0.5, "u - 2*w + v/10"), "z": (0.3, "-v + u/5")}
    surfaces = {"u": "x", "w": "y", "v": "z"}
    found = []
    for order in permutations("uwv"):
        declared = hs.Model(
            "m",
            states=[hs.State(name, start, der) for name, (start, der) in states.items()],
            surfaces=[hs.SwitchingSurface(name, surfaces[name]) for name in order],
        )
        solution = hs.simulate(declared, (0.0, 2.5), integrator=integrator)
        events = sorted((round(event.t, 12), event.component, event.target) for event in solution.events)
        found.append((events, solution(2.5)))
    for events, state in found[1:]:
        assert events == found[0][0]
        assert state == pytest.approx(found[0][1], abs=1e-14)


def test_what_helps_another_is_refused_where_they_meet() -> None:
    solution = run(HELPING, 1.0, integrator="dop853")
    assert solution.status == "nonunique"
    assert "at t = 0: " in solution.message
    for words in ("x = 0, y = 0", "u: above, w: below", "u: below, w: above", "u: sliding, w: sliding"):
        assert words in solution.message


def test_a_corner_that_repels_in_spirals_is_refused() -> None:
    """No motion leaves along a straight line, and the one that stays is one of many."""
    text = HELPING.replace("-u - 2*w", "u + 9*w").replace("-2*u - w", "-9*u + w")
    solution = run(text, 1.0, integrator="dop853")
    assert solution.status == "nonunique"
    assert "u, w drives the motion away" in solution.message


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_dependent_relays_have_one_motion(integrator: str) -> None:
    """Both pull x + y alone: where both surfaces meet their weights are not determined, and yet nothing moves."""
    text = HELPING.replace("-u - 2*w", "-u - w").replace("-2*u - w", "-u - w")
    solution = run(text, 1.0, integrator=integrator)
    assert solution.status == "finished"
    assert solution(1.0) == pytest.approx((0.0, 0.0), abs=0.0)
    assert run(text, 1.0, x0={"x": 0.5, "y": 0.5}, integrator=integrator)(1.0) == pytest.approx(
        (0.0, 0.0), abs=1e-15
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p", "cvode-bdf"])
def test_a_two_fold_is_left_where_the_surface_stops_attracting(integrator: str) -> None:
    """x' = -1 above and 1 below times (1 - t): it attracts up to t = 1, where both motions away are admissible."""
    solution = run(
        '[states]\nx = { start = 0, der = "-(1 - t)*u" }\n[surfaces]\nu = "x"\n', 2.0, integrator=integrator
    )
    assert solution.status == "nonunique"
    assert solution.t_end == pytest.approx(1.0, abs=1e-12)
    assert "u: above" in solution.message and "u: below" in solution.message


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize("start", [-1.0, 0.0])
def test_a_relay_that_is_just_strong_enough(start: float, integrator: str) -> None:
    """x' = 1 - u: at x = 0 it stays, whether it slides with u = 1 or is above, where nothing moves: one motion."""
    text = '[states]\nx = { start = 0, der = "1 - u" }\n[surfaces]\nu = "x"\n'
    solution = run(text, 2.0, x0={"x": start}, integrator=integrator)
    assert solution.status == "finished"
    assert solution(2.0)[0] == 0.0


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "scipy-dop853"])
def test_a_jump_of_the_load_and_a_reset_end_sliding(integrator: str) -> None:
    """x' = p - u with p = 0 up to 1, 3 up to 2, 0 again; at t = 5 x is set to -1/2."""
    text = """
    [states]
    x = { start = 0, der = "p - u" }

    [inputs.p]
    kind = "table"
    times = [0, 1, 1, 2, 2, 9]
    values = [0, 0, 3, 3, 0, 0]

    [surfaces]
    u = "x"

    [schedules.kick]
    times = [5]
    reset = { x = "-0.5" }
    """
    solution = run(text, 6.0, integrator=integrator)
    found = [(event.t, event.target) for event in solution.events if event.component == "u"]
    assert found == [(1.0, "above"), (4.0, "sliding"), (5.0, "below"), (5.5, "sliding")]
    assert solution([0.5, 1.5, 2.0, 3.0, 4.5, 5.25, 6.0])[0] == pytest.approx(
        [0, 1, 2, 1, 0, -0.25, 0], abs=1e-14
    )


def test_a_reset_off_a_circle_ends_sliding() -> None:
    text = ALONG_A_CIRCLE + '[schedules.kick]\ntimes = [2]\nreset = { x = "2*x", y = "2*y" }\n'
    solution = run(text, 4.0, integrator="dop853")
    found = [(event.t, event.target) for event in solution.events if event.component == "u"]
    assert [target for _, target in found] == ["sliding", "above", "sliding"]
    assert [t for t, _ in found] == pytest.approx([math.log(2), 2.0, 2.0 + math.log(2)], abs=1e-9)


def test_a_relay_on_the_second_derivative_is_crossed_and_not_slid_along() -> None:
    """x'' = -u: parabolas; from x = 0, v = 0 no motion of the first order goes on."""
    text = '[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-u" }\n[surfaces]\nu = "x"\n'
    solution = run(text, 8.5, integrator="exact")
    assert [event.t for event in solution.events] == pytest.approx([2.0, 4.0, 6.0, 8.0], abs=1e-13)
    assert {event.target for event in solution.events} == {"above", "below"}
    stopped = run(text, 1.0, x0={"v": 0.0})
    assert stopped.status == "inconsistent"
    assert "u acts only on higher derivatives of its switching function" in stopped.message


def test_modes_that_push_against_each_other_are_told_of_surfaces() -> None:
    text = """
    [states]
    x = { start = 1, der = "-s" }

    [modes.right]
    initial = true
    set = { s = "1" }
    guards.edge = { expr = "x", then = "left" }

    [modes.left]
    set = { s = "-1" }
    guards.edge = { expr = "-x", then = "right" }
    """
    solution = run(text, 2.0)
    assert solution.status == "cascade"
    assert "[surfaces.NAME]" in solution.message


def test_a_power_of_an_unknown_is_refused_by_name() -> None:
    with pytest.raises(ModelError, match="u enters the rate of the switching function 'x' nonlinearly"):
        run(HELPING.replace("-u - 2*w", "-u**3"), 1.0)


def test_unknowns_that_multiply() -> None:
    """x' = -u w and y' = -2 u - w from (0, 0): of all sides and slidings only u = 1, w = -1 leads where it holds."""
    solution = run(HELPING.replace("-u - 2*w", "-u*w"), 1.0)
    assert solution.success and solution(1.0) == pytest.approx([1.0, -1.0], abs=1e-14)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_sliding_on_a_surface_whose_effect_another_switches(integrator: str) -> None:
    """x' = -u w, y' = 1 for y < 3, then -1: x is drawn to zero while w = 1 alone, and leaves when y comes back."""
    text = """
    [states]
    x = { start = -1, der = "-u*w" }
    y = { start = -1, der = "1 if t < 4 else -1" }

    [surfaces]
    u = "x"
    w = "y"
    """
    solution = run(text, 10.0, integrator=integrator)
    # away from zero up to t = 1, back at t = 3, held up to y = 0 at t = 7; then both sides lead away
    assert solution(1.0)[0] == pytest.approx(-2.0, abs=1e-9)
    assert [solution(t)[0] for t in (3.0, 5.0, 6.9)] == pytest.approx([0.0] * 3, abs=1e-9)
    assert solution.status == "nonunique" and solution.t[-1] == pytest.approx(7.0, abs=1e-9)


def test_where_factors_meet_the_motion_is_not_unique() -> None:
    """x' = -u w, y' = -w u: once both are at zero, and both are drawn there, no sides and no single sliding go on."""
    text = '[states]\nx = { start = 1, der = "-u*w" }\ny = { start = 1, der = "-u*w" }\n[surfaces]\nu = "x"\nw = "y"\n'
    solution = run(text, 3.0)
    assert solution.t[-1] == pytest.approx(1.0, abs=1e-12)
    assert solution.status in ("inconsistent", "nonunique")


def test_a_contact_and_a_relay_in_one_cluster() -> None:
    """A block that a relay pulls back to x + v = 0 against friction; in stick the relay has nothing to hold."""
    text = """
    [states]
    x = { start = 1, der = "v" }
    v = { start = 0, der = "-3*u - f" }

    [surfaces]
    u = "x + v"

    [contacts.f]
    velocity = "v"
    normal = 1
    law = { name = "coulomb", mu = 0.5 }
    """
    solution = run(text, 4.0, integrator="exact")
    onto = math.sqrt(1 + 2 / 2.5) - 1  # 1 - 2.5 t^2/2 - 2.5 t = 0
    assert solution.events[0].t == pytest.approx(onto, abs=1e-12)
    assert solution.modes["u"][-1].mode == "sliding"
    x, v = solution(4.0)
    assert x + v == 0.0
    assert x == pytest.approx((1 - 1.25 * onto**2) * math.exp(onto - 4), abs=1e-12)


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
def test_the_published_methods_refuse_surfaces_by_name(integrator: str) -> None:
    with pytest.raises(hs.UsageError, match="its rule near zero velocity applies to friction only"):
        run(FORCED, 1.0, integrator=integrator, step=0.01)


def test_backward_out_of_sliding_has_no_unique_past() -> None:
    solution = hs.simulate(model(FORCED), (0.5, 0.0), integrator="dop853")
    assert solution.status == "backward-nonunique"
    assert "u: above" in solution.message


@pytest.mark.parametrize("change", ['x = "v + 0.5"', 'v = "-2*u + 0.5*sin(t)"'])
def test_a_mode_that_changes_the_rate_of_a_surface_is_refused(change: str) -> None:
    """What the relay gives while it slides would be that of the other rate: v = -x and x' = v would not both hold."""
    text = f"""
[states]
x = {{ start = 1, der = "v" }}
v = {{ start = 0, der = "-2*u" }}

[surfaces]
u = "x + v"

[components.c.modes.a]
initial = true
guards.due = {{ expr = "2 - t", then = "b" }}
[components.c.modes.b]
der = {{ {change} }}
"""
    with pytest.raises(hs.ModelError, match=r"depends on \w, but modes of \w+ change the derivative of \w"):
        run(text, 6.0, integrator="exact")
    through_a_variable = text.replace('"-2*u"', '"-2*u + w"').replace(
        "initial = true", 'initial = true\nset = { w = "0" }'
    )
    through_a_variable = through_a_variable.replace(f"der = {{ {change} }}", 'set = { w = "0.5*sin(t)" }')
    solution = run(through_a_variable, 6.0, integrator="exact")
    onto = solution.events[0].t
    x = solution(onto)[0] * math.exp(onto - 6.0)
    assert solution(6.0) == pytest.approx((x, -x), abs=1e-12)
