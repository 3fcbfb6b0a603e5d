"""Derivatives of runs that start, or are put by a reset, exactly on a guard or surface. All are closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


def guarded(guard: str, rate: str, x0: float, then: hs.Choice, **rest: object) -> hs.Solution:
    """x from x0 with a guard, and y' = q beside it."""
    model = hs.Model(
        "guarded",
        states=[hs.State("x", "x0", rate), hs.State("y", 0, "q")],
        parameters={"x0": x0, "q": 2.0},
        components=[
            hs.Component("g", [hs.Mode("a", hs.Guard("end", guard, then)), hs.Mode("b", **rest)], initial="a")
        ],
    )
    return hs.simulate(model, (0, 1), rtol=1e-11)


HALVED = hs.Choice("b", reset={"x": "0.5*x"})


def differ(found: hs.Sensitivities, name: str, what: str) -> np.ndarray:
    """What the end's derivatives by a parameter are, a warning saying what it moves the run off."""
    assert any(what in warning and name in warning for warning in found.warnings)
    return found.by_parameter[:, found.parameters.index(name)]


@pytest.mark.parametrize(
    ("guard", "rate", "has_y"),
    [("1 - x", "1", True), ("x - 1", "1", False), ("x - 1", "0", False)],
    ids=["falls and fires", "rises and does not", "stays"],
)
def test_a_start_on_a_guard_has_no_derivative_by_what_moves_it_off(
    guard: str, rate: str, has_y: bool
) -> None:
    """Beyond the guard x is halved at once, before it x grows by 1 until it is halved, or is never halved.

    Where it is halved on both sides y goes on alike, and that is known.
    """
    solution = guarded(guard, rate, 1.0, HALVED)
    found = hs.sensitivities(solution)
    by_x0 = differ(found, "x0", "t = 0 guard end of g is exactly at its zero")
    assert np.isnan(by_x0[0])
    assert by_x0[1] == 0.0 if has_y else np.isnan(by_x0[1])
    assert found.by_parameter[:, 1] == pytest.approx([0.0, 1.0], abs=1e-14)
    assert found.by_start[:, 0].tolist() == pytest.approx(by_x0.tolist(), nan_ok=True)
    assert found.by_start[:, 1].tolist() == [0.0, 1.0]
    kept = hs.sensitivities(solution, ["x0", "q"], starts_follow=False)
    assert kept.by_parameter == pytest.approx(np.array([[0.0, 0.0], [0.0, 1.0]]), abs=1e-14)


def test_both_sides_of_a_guard_may_agree() -> None:
    """Where x has grown to 1, x is added to y: 1 + h from x0 = 1 + h, and 1 from below. With 1 added they agree."""
    for reset, expected in (("y + x", [1.0, math.nan]), ("y + 1", [1.0, 0.0])):
        solution = guarded("1 - x", "1", 1.0, hs.Choice("b", reset={"y": reset}))
        found = hs.sensitivities(solution, ["x0"])
        assert found.by_parameter[:, 0] == pytest.approx(expected, abs=1e-12, nan_ok=True)
        assert bool(found.warnings) == math.isnan(expected[1])


def test_a_start_beyond_a_guard_has_a_derivative() -> None:
    found = hs.sensitivities(guarded("1 - x", "1", 1.5, HALVED))
    assert found.by_parameter[0, 0] == pytest.approx(0.5)
    assert not found.warnings


def test_a_guard_at_zero_that_changes_nothing_leaves_the_derivative() -> None:
    found = hs.sensitivities(guarded("1 - x", "1", 1.0, hs.Choice("b")))
    assert found.by_parameter[0, 0] == pytest.approx(1.0)
    assert hs.sensitivities(guarded("x - 1", "1", 1.0, hs.Choice("b"))).by_parameter[0, 0] == 1.0
    # from x = 1 on x' = 3: on one side 3 x0, on the other x0
    found = hs.sensitivities(guarded("1 - x", "1", 1.0, hs.Choice("b"), der={"x": 3}))
    assert np.isnan(differ(found, "x0", "guard end of g"))[0]


def test_a_mode_that_parts_later_is_another_run() -> None:
    """Below x = 1 the run is in b for good: y' = q + t there, the same as in a at t = 0 only."""
    found = hs.sensitivities(guarded("x - 1", "1", 1.0, hs.Choice("b"), der={"y": "q + t"}))
    assert np.isnan(differ(found, "x0", "guard end of g")).all()


def test_two_modes_that_hand_over_at_the_start() -> None:
    """x' = 1 above 1 and 3 below, from 1: x(1) = 2 + h above, and 2 + h/3 below, where y' = q in both: 0."""
    back = hs.Guard("back", "1 - x", hs.Choice("a"))
    model = hs.Model(
        "two",
        states=[hs.State("x", "x0", "1"), hs.State("y", 0, "q")],
        parameters={"x0": 1.0, "q": 2.0},
        components=[
            hs.Component(
                "g",
                [hs.Mode("a", hs.Guard("end", "x - 1", hs.Choice("b"))), hs.Mode("b", back, der={"x": 3})],
                initial="a",
            )
        ],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1)))
    by_x0 = differ(found, "x0", "guard end of g")
    assert np.isnan(by_x0[0])
    assert by_x0[1] == 0.0
    for x0, expected in ((1.25, 1.0), (0.75, 1 / 3)):
        beside = hs.sensitivities(hs.simulate(model, (0, 1), params={"x0": x0}))
        assert beside.by_parameter[0, 0] == pytest.approx(expected, rel=1e-12)


def test_corners_at_the_start() -> None:
    """x' = 1 + |x| from 0 passes the corner: dx/dx0 = exp(t). x' = |x| stays: exp(t) above, exp(-t) below."""

    def ran(rate: str) -> hs.Sensitivities:
        model = hs.Model("corner", states=[hs.State("x", "x0", rate)], parameters={"x0": 0.0})
        return hs.sensitivities(hs.simulate(model, (0, 1), rtol=1e-11))

    assert ran("1 + abs(x)").by_parameter[0, 0] == pytest.approx(math.e, rel=1e-9)
    assert np.isnan(ran("abs(x)").by_parameter[0, 0])
    # no corner to first order: x' = -x - x |x| has x(1) = x0 exp(-1) near 0
    assert ran("-x - x*abs(x)").by_parameter[0, 0] == pytest.approx(math.exp(-1), rel=1e-9)


def rubbing(law: str, push: str, rest: str = "", v0: float = 2.0) -> hs.Model:
    return hs.Model.from_toml(
        f"""schema = 1
name = "rubbing"
parameters = {{ m = 1.0, M = 3.0, v0 = {v0}, w0 = 2.0, F = 3.0, q = 0.0 }}
states.v = {{ start = "v0", der = "({push} - f)/m" }}
states.w = {{ start = "w0", der = "f/M" }}
contacts.f = {{ velocity = "v - w", normal = 10, law = {{ {law} }} }}
{rest}
"""
    )


COULOMB = 'name = "coulomb", mu = 1'


def test_bodies_that_stick_at_the_start_share_their_momentum() -> None:
    """From velocities that differ a little both come at once to that of their common centre of mass."""
    found = hs.sensitivities(hs.simulate(rubbing(COULOMB, "F"), (0, 1)), ["v0", "w0", "F", "m"])
    shared = [1 / 4, 3 / 4, 1 / 4, -3 / 16]
    assert found.by_parameter == pytest.approx(np.array([shared, shared]), rel=1e-12)
    assert found.by_start == pytest.approx(np.array([shared[:2], shared[:2]]), rel=1e-12)


def test_bodies_that_a_reset_makes_stick_share_their_momentum() -> None:
    """At 1/2 v becomes w + q, from 2 + w0 - 2: momentum m (w + q) + M w is kept from there on."""
    rest = '[schedules.s]\ntimes = [0.5]\nreset.v = "w + q"'
    found = hs.sensitivities(hs.simulate(rubbing(COULOMB, "0", rest), (0, 1)), ["q"])
    assert found.by_parameter[:, 0] == pytest.approx([1 / 4, 1 / 4], rel=1e-12)
    assert found.by_start == pytest.approx(np.array([[1 / 4, 3 / 4]] * 2), rel=1e-12)


def test_a_reset_at_the_end_leaves_no_time_to_stick() -> None:
    """At the end v becomes w + q, with q = 0: from a little more it would come back to w, but later."""
    rest = '[schedules.s]\ntimes = [1.0]\nreset.v = "w + q"'
    found = hs.sensitivities(hs.simulate(rubbing(COULOMB, "0", rest), (0, 1)), ["q"])
    assert found.by_parameter[:, 0].tolist() == [1.0, 0.0]


def test_a_guard_that_a_reset_meets_at_the_end() -> None:
    """y becomes q = 1 and z counts it, where 1 or less; from more it would be counted, but later."""
    counts = hs.Guard("end", "y - 1", hs.Choice("b", reset={"z": "z + 1"}))
    model = hs.Model(
        "meets",
        states=[hs.State("y", 5, -1), hs.State("z", 0, 0)],
        parameters={"q": 1.0, "r": 1.0},
        schedules=[hs.Schedule("s", times=[1.0], reset={"y": "q"})],
        components=[hs.Component("g", [hs.Mode("a", counts), hs.Mode("b")], initial="a")],
    )
    solution = hs.simulate(model, (0, 1))
    assert solution.y[:, -1].tolist() == [1.0, 1.0]
    assert np.isnan(differ(hs.sensitivities(solution), "q", "guard end of g")).all()
    assert hs.sensitivities(hs.simulate(model, (0, 2)), ["q"]).by_parameter.tolist() == [[1.0], [0.0]]


def test_what_slips_from_its_start_on_has_no_derivative_by_its_velocity() -> None:
    """Pushed by 30 against 10: a little behind, friction turns and adds 20/1, and 20/3 the other way.

    v comes back within h/(40 + 10/3): both then differ, but not the momentum.
    """
    solution = hs.simulate(rubbing(COULOMB, "10*F"), (0, 1))
    found = hs.sensitivities(solution, ["v0", "F"])
    assert np.isnan(differ(found, "v0", "f is exactly at its zero")).all()
    assert found.by_parameter[:, 1] == pytest.approx([10.0, 0.0], rel=1e-12)
    assert np.isnan(found.by_start).all()


def test_stick_that_does_not_come_back_has_no_derivative_by_its_velocity() -> None:
    """Static friction holds 9 of 10; kinetic friction of 5 lets go whatever moves."""
    law = 'name = "static-kinetic", mu_s = 1, mu_k = 0.5'
    solution = hs.simulate(rubbing(law, "3*F"), (0, 1))
    assert [i.mode for i in solution.modes["f"]] == ["stick"]
    found = hs.sensitivities(solution, ["w0", "F"])
    assert np.isnan(differ(found, "w0", "f is exactly at its zero")).all()
    assert found.by_parameter[:, 1] == pytest.approx([3 / 4, 3 / 4], rel=1e-12)


def block(push: str, F: float, law: str = COULOMB) -> hs.Solution:
    model = hs.Model.from_toml(
        f"""schema = 1
name = "block"
parameters = {{ F = {F}, v0 = 0.0 }}
states.v = {{ start = "v0", der = "{push} - f" }}
contacts.f = {{ velocity = "v", normal = 10, law = {{ {law} }} }}
"""
    )
    return hs.simulate(model, (0, 1))


def test_a_push_exactly_at_the_limit() -> None:
    """v(1) is 0 for F <= 10 and F - 10 above. A push F + t: 1/2 + h above, (1 - h)^2/2 below: 1 on both sides.

    A push F - t slips for a time and at a speed of first order: 0 on both sides.
    """
    assert np.isnan(differ(hs.sensitivities(block("F", 10.0)), "F", "of f is exactly at its zero")).all()
    rising = hs.sensitivities(block("F + t", 10.0), ["F"])
    assert rising.by_parameter[0, 0] == pytest.approx(1.0, rel=1e-9)
    falling = hs.sensitivities(block("F - t", 10.0), ["F"])
    assert falling.by_parameter[0, 0] == 0.0
    for found in (rising, falling):  # v0 is another matter
        assert all("start of v" in warning and " F " not in warning for warning in found.warnings)
    law = 'name = "static-kinetic", mu_s = 1, mu_k = 0.5'  # h above: 5 (1) at once; below: 5 (1 - h)
    kinetic = hs.sensitivities(block("F + t", 10.0, law), ["F"])
    assert np.isnan(differ(kinetic, "F", "of f is exactly at its zero")).all()


def test_a_reset_exactly_onto_a_guard() -> None:
    """At 1/2 y becomes q = 1 and falls: z grows by q where q is less, and by 1 a little later where it is more."""
    model = hs.Model(
        "onto",
        states=[hs.State("y", 5, -1), hs.State("z", 0, 0)],
        parameters={"q": 1.0, "r": 1.0},
        schedules=[hs.Schedule("s", times=[0.5], reset={"y": "q"})],
        components=[
            hs.Component(
                "g",
                [
                    hs.Mode("a", hs.Guard("end", "y - 1", hs.Choice("b", reset={"z": "z + r*y"}))),
                    hs.Mode("b"),
                ],
                initial="a",
            )
        ],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1)))
    by_q = differ(found, "q", "t = 0.5 guard end of g is exactly at its zero")
    assert by_q == pytest.approx([1.0, math.nan], nan_ok=True)
    assert found.by_parameter[:, 1].tolist() == [0.0, 1.0]
    for q, expected in ((0.75, 0.75), (1.25, 1.0)):
        found = hs.sensitivities(hs.simulate(model, (0, 1), params={"q": q}))
        assert found.by_parameter[1] == pytest.approx([float(q < 1.0), expected], rel=1e-12)


@pytest.mark.parametrize(
    ("then", "rest", "expected"),
    [
        (HALVED, {}, [math.nan, math.nan]),
        (hs.Choice("b"), {"der": {"x": 3}}, [math.nan, 0.0]),
        (hs.Choice("b"), {"der": {"x": 1}}, [1.0, 0.0]),
    ],
    ids=["jumps", "turns", "goes on"],
)
def test_an_event_exactly_at_the_end(then: hs.Choice, rest: dict, expected: list[float]) -> None:
    """x = x0 + t is 2 at the end: from x0 - h on it is not halved, or goes on by 1 instead of 3."""
    found = hs.sensitivities(guarded("2 - x", "1", 1.0, then, **rest), ["x0", "q"])
    assert found.by_parameter[:, 0] == pytest.approx(expected, nan_ok=True)
    assert found.by_parameter[:, 1] == pytest.approx([0.0, 1.0])
    assert bool(found.warnings) == math.isnan(expected[0])
    assert all("t = 1 the event of g" in warning for warning in found.warnings)
    assert found.times_by_parameter == pytest.approx(np.array([[-1.0, 0.0]]))


@pytest.mark.parametrize("sevenths", [1, 2, 28, 29, 38])
def test_an_event_at_the_end_but_for_rounding(sevenths: int) -> None:
    """x' = r from 1/10 is 1/10 + r at the end, or an ulp before it: from then on x' = 3."""
    r = sevenths / 7
    model = hs.Model(
        "near",
        states=[hs.State("x", "x0", "r"), hs.State("y", 0, "q")],
        parameters={"x0": 0.1, "q": 2.0, "r": r, "c": 0.1 + r},
        components=[
            hs.Component(
                "g",
                [hs.Mode("a", hs.Guard("end", "c - x", hs.Choice("b"))), hs.Mode("b", der={"x": 3})],
                initial="a",
            )
        ],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1)), ["x0"])
    assert found.by_parameter[:, 0] == pytest.approx([math.nan, 0.0], nan_ok=True)
    assert "x0" in found.warnings[0]


def test_a_monitor_that_passes_at_no_rate_leaves_the_derivatives_of_the_state() -> None:
    """The cube of x - 1 passes zero without a rate: its time has no derivative. All else has one."""
    model = hs.Model(
        "cube",
        states=[hs.State("x", "x0", 1), hs.State("y", 1, "x0*y")],
        parameters={"x0": -1.0},
        monitors=[hs.Monitor("cube", "(x - 1)**3"), hs.Monitor("half", "x - 0.5")],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 3), integrator="taylor"), ["x0"])
    assert found.by_parameter[:, 0] == pytest.approx([1.0, 3.0 * math.exp(-3.0)], rel=1e-9)
    assert found.times == pytest.approx([1.5, 2.0], rel=1e-5)
    assert found.times_by_parameter[:, 0] == pytest.approx([-1.0, math.nan], nan_ok=True)


def stacked(start: str, pushes: str, law: str) -> hs.Sensitivities:
    """v rubs on w with a limit of 10, and w on the floor with one of 5; masses are 1."""
    model = hs.Model.from_toml(
        f"""schema = 1
name = "stacked"
parameters = {{ {start}, {pushes} }}
states.v = {{ start = "v0", der = "F - f" }}
states.w = {{ start = "w0", der = "G + f - h" }}
contacts.f = {{ velocity = "v - w", normal = 10, law = {{ {COULOMB} }} }}
contacts.h = {{ velocity = "w", normal = 5, law = {{ {law} }} }}
"""
    )
    return hs.sensitivities(hs.simulate(model, (0, 1)), ["v0", "G"])


STATIC = 'name = "static-kinetic", mu_s = 1, mu_k = 0.5'


def test_an_impulse_of_one_contact_onto_another_that_slips() -> None:
    """Both are pushed along by 9 against 5. A change of v0 moves w by half of it; backward h turns and adds to that."""
    found = stacked("v0 = 0.0, w0 = 0.0", "F = 9.0, G = 0.0", COULOMB)
    assert np.isnan(differ(found, "v0", "h is exactly at its zero")).all()
    assert found.by_parameter[:, 1] == pytest.approx([0.5, 0.5])


def test_an_impulse_of_one_contact_that_sets_another_free() -> None:
    """Pushed by 4, held by up to 5: forward f adds 10, w is free and kinetic friction of 2.5 does not stop it again."""
    found = stacked("v0 = 0.0, w0 = 0.0", "F = 0.0, G = 4.0", STATIC)
    assert np.isnan(differ(found, "v0", "h is exactly at its zero")).all()
    assert found.by_parameter[:, 1].tolist() == [0.0, 0.0]


def test_an_impulse_that_another_contact_withstands() -> None:
    """With 2 against kinetic friction of 2.5 w comes back, and all rests again."""
    found = stacked("v0 = 0.0, w0 = 0.0", "F = 0.0, G = 2.0", STATIC)
    assert found.by_parameter.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert found.by_start.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert not found.warnings


def test_a_stop_exactly_at_the_limit() -> None:
    """v = -1 stops at 1/20, pushed by 10 against 10: it rests if pushed by less, and slips on if by more."""
    model = hs.Model.from_toml(
        f"""schema = 1
name = "stop"
parameters = {{ F = 10.0, q = 1.0 }}
states.v = {{ start = -1, der = "F - f" }}
states.y = {{ start = 0, der = "q" }}
contacts.f = {{ velocity = "v", normal = 10, law = {{ {COULOMB} }} }}
"""
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1)))
    assert np.isnan(differ(found, "F", "of f is exactly at its zero")[0])
    assert found.by_parameter[:, 1] == pytest.approx([0.0, 1.0])


def test_two_guards_at_the_start() -> None:
    """From 1 - h on x is slow, x' = 1/2, up to 1, and z = x + t is set where that is 1: x(1) = 2 - 2 h, z(1) = 1.

    From 1 + h on it is set at once: x(1) = 2 + h, z(1) = 1 + h.
    """
    slow = hs.Mode("slow", hs.Guard("up", "1 - x", hs.Choice("fast")), der={"x": 0.5})
    model = hs.Model(
        "two-guards",
        states=[hs.State("x", "x0", 1), hs.State("z", 0, 0)],
        parameters={"x0": 1.0, "q": 1.0},
        components=[
            hs.Component(
                "g", [hs.Mode("fast", hs.Guard("down", "x - 1", hs.Choice("slow"))), slow], initial="fast"
            ),
            hs.Component(
                "h",
                [
                    hs.Mode("a", hs.Guard("on", "1 - x - t", hs.Choice("b", reset={"z": "q*(x + t)"}))),
                    hs.Mode("b"),
                ],
                initial="a",
            ),
        ],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1)))
    assert np.isnan(differ(found, "x0", "is exactly at its zero")).all()
    assert found.by_parameter[:, 1] == pytest.approx([0.0, 1.0])
    for x0, expected in ((0.75, [2.0, 0.0]), (1.25, [1.0, 1.0])):
        beside = hs.sensitivities(hs.simulate(model, (0, 1), params={"x0": x0}))
        assert beside.by_parameter[:, 0] == pytest.approx(expected)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
def test_a_monitor_that_only_touches_zero_leaves_the_derivatives_of_the_state(integrator: str) -> None:
    """x = a - (t - 1)^2 touches 1 at t = 1, where a is 1, and y = exp(a t)."""
    model = hs.Model(
        "touch",
        states=[hs.State("x", "a - 1", "v"), hs.State("v", 2, -2), hs.State("y", 1, "a*y")],
        parameters={"a": 1.0},
        monitors=[hs.Monitor("top", "x - 1"), hs.Monitor("half", "x - 0.75", direction="up")],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 2), integrator=integrator, rtol=1e-10))
    assert found.by_parameter[:, 0] == pytest.approx([1.0, 0.0, 2.0 * math.exp(2.0)], rel=1e-9)
    assert found.times_by_parameter[0, 0] == pytest.approx(-1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("rate", "expr", "direction", "is_lost"),
    [
        ("1", "x", "both", True),
        ("1", "-x", "down", True),
        ("-1", "x", "down", True),
        ("2*t", "x", "up", True),  # x = x0 + t^2: from below it passes at sqrt(-x0)
        ("1", "x", "down", False),
        ("0*t", "x", "both", False),
        ("1", "y", "both", False),  # y = q t, whatever x0 is
    ],
)
@pytest.mark.parametrize("then", [{"action": "terminate"}, {"action": "reset", "reset": {"x": "5"}}])
def test_a_start_on_a_monitor_that_one_side_would_pass(
    rate: str, expr: str, direction: str, is_lost: bool, then: dict
) -> None:
    """From one side the run passes the zero after a moment, and ends or is reset; from the other it never does."""
    model = hs.Model(
        "watched",
        states=[hs.State("x", "x0", rate), hs.State("y", 0, "q")],
        parameters={"x0": 0.0, "q": 2.0},
        monitors=[hs.Monitor("m", expr, direction=direction, **then)],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1), integrator="dop853"))
    if is_lost:
        assert np.isnan(differ(found, "x0", "t = 0 monitor m is exactly at its zero")).all()
    else:
        assert found.by_parameter[:, 0] == pytest.approx([1.0, 0.0], abs=1e-12)
        assert not any("x0" in warning for warning in found.warnings)
    assert found.by_parameter[:, 1] == pytest.approx([0.0, 1.0], abs=1e-12)
