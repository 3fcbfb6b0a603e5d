"""Corners, steps in time and loads take their sides first: at a start, after a jump, in the modes that are tried."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

SLIPS = hs.load_law("static-kinetic")
HEAVY = {"mu_s": 0.8, "mu_k": 0.3}


def guarded(guard: str, x: float, rate: float, **parts: object) -> hs.Model:
    modes = [hs.Mode("before", [hs.Guard("g", guard, "after")]), hs.Mode("after")]
    component = hs.Component("c", modes, initial="before")
    return hs.Model("guarded", [hs.State("x", x, der=rate)], components=[component], **parts)


def rubbing(force: str, normal: str = "1", v: float = 0.0, opens: bool = False, **parts: object) -> hs.Model:
    states = [hs.State("y", -1, der=0), hs.State("v", v, der=f"{force} - f")]
    contact = hs.Contact("f", "v", normal, SLIPS, HEAVY, opens=opens)
    return hs.Model("rubbing", states, contacts=[contact], **parts)


def moved(value: float, t: float = 1.0) -> dict[str, object]:
    return {"schedules": [hs.Schedule("jump", times=[t], reset={"y": value})]}


@pytest.mark.parametrize("integrator", ["exact", "taylor", "moreau"])
@pytest.mark.parametrize(
    ("guard", "x", "rate", "times"),
    [
        ("max(x - 2, 0.5*x)", 1, -1, [1.0]),
        ("max(0.5*x, x - 2)", 1, -1, [1.0]),
        ("min(x + 5, max(x - 2, 0.5*x))", 1, -1, [1.0]),
        ("abs(x) - 0.25", -1, -1, []),
        ("abs(x) - 1", -3, 1, [2.0]),
        ("abs(x) + abs(x - 1) - 2", -3, 1, [2.5]),
        ("abs(abs(x) - 2) - 0.5", -3, 1, [0.5]),
        ("abs(abs(abs(x) - 4) - 2) - 0.5", -4.25, -1, [1.25]),
        ("(x - 1 if x > 1 else 1 - x) - 0.5", -1, 1, [1.5]),
    ],
)
def test_guards_at_a_start(guard: str, x: float, rate: float, times: list[float], integrator: str) -> None:
    options = {"step": 1e-3} if integrator == "moreau" else {}
    sol = hs.simulate(guarded(guard, x, rate), (0, 4), integrator=integrator, **options)
    assert [event.t for event in sol.events] == pytest.approx(times, abs=2e-3 if options else 1e-9)


def test_a_guard_after_a_jump() -> None:
    jump = hs.Schedule("jump", times=[1], reset={"x": -1})
    sol = hs.simulate(guarded("abs(x) - 0.25", 1, 0.125, schedules=[jump]), (0, 9))
    assert [event.t for event in sol.events if event.component == "c"] == pytest.approx([7.0])


def test_a_condition_reads_the_side_of_a_definition() -> None:
    """The size of x is 1 after the first reset; on the old side it would be -1."""
    jump = hs.Guard("due", "1 - t", hs.Choice("next", reset={"x": -1}))
    choices = [hs.Choice("large", "size > 0.5", {"x": "-size"}), hs.Choice("small")]
    modes = [
        hs.Mode("first", [jump]),
        hs.Mode("next", [hs.Guard("at_once", "x", choices)]),
        hs.Mode("large"),
        hs.Mode("small"),
    ]
    states = [hs.State("x", 3, der=0), hs.State("z", 0, der="size")]
    model = hs.Model(
        "read",
        states,
        components=[hs.Component("c", modes, initial="first")],
        definitions={"size": "abs(x)"},
    )
    sol = hs.simulate(model, (0, 2))
    assert [event.target for event in sol.events] == ["next", "large"]
    assert sol(2.0) == pytest.approx([-1.0, 4.0])


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "moreau"])
@pytest.mark.parametrize(
    ("force", "normal", "t", "v"),
    [
        ("0.5 - 2*max(y, 0)", "1", None, 0.0),
        ("0.5 + 2*max(y, 0)", "1", None, 0.0),
        ("-2*min(y, -0.25) - 1.5", "1", None, 0.0),
        ("(0.5 if t < 2 else 2)", "1", 2.0, 1.7 * 2),
        ("(2 if t > 2 else 0.5)", "1", 2.0, 1.7 * 2),
        ("0.5", "0.5 + abs(y)", None, 0.0),
        ("0.5", "0.5 + abs(abs(y) - 2)", None, 0.0),
    ],
)
def test_a_body_at_rest(force: str, normal: str, t: float | None, v: float, integrator: str) -> None:
    options = {"step": 1e-3} if integrator == "moreau" else {}
    sol = hs.simulate(rubbing(force, normal), (0, 4), integrator=integrator, **options)
    assert [event.t for event in sol.events] == pytest.approx([] if t is None else [t], abs=2e-3)
    assert sol.output("v", 4.0) == pytest.approx(v, abs=4e-3)


def test_a_body_at_rest_beside_a_spring_that_jumps() -> None:
    """On the old side the force after the jump would be 3.5, beyond the limit of 0.8."""
    sol = hs.simulate(rubbing("0.5 + 2*max(y, 0) + 3*min(y, 0)", **moved(-0.25)).with_start(y=0.125), (0, 3))
    assert [event.component for event in sol.events] == ["jump"]
    assert sol.output("v", 3.0) == 0.0


@pytest.mark.parametrize("integrator", ["taylor", "moreau", "reference"])
@pytest.mark.parametrize(
    ("guard", "w", "rate"),
    [("y", 0, "0"), ("w", 0, "-1"), ("w", 0, "-t"), ("-w**2", 0, "1"), ("2 - w", 2, "t")],
)
def test_a_contact_is_decided_in_the_mode_that_lasts(
    guard: str, w: float, rate: str, integrator: str
) -> None:
    """The first mode of the automaton would let the body go, and ends as it begins."""
    pull = hs.Mode("pull", [hs.Guard("below", guard, "rest")], set={"pulled": "2"})
    component = hs.Component("c", [pull, hs.Mode("rest", set={"pulled": "0.5"})], initial="pull")
    model = rubbing("pulled", components=[component])
    model = replace(model, states=(*model.states, hs.State("w", w, der=rate)))
    if integrator == "reference":
        truth = multiple_precision_trajectory(model, (0, 2))
        assert [event.target for event in truth.events] == ["rest"]
        assert truth.states(np.array([2.0]), "+").ravel()[1] == 0.0
        return
    sol = hs.simulate(
        model, (0, 2), integrator=integrator, **({"step": 1e-3} if integrator == "moreau" else {})
    )
    assert [event.target for event in sol.events] == ["rest"]
    assert sol.output("v", 2.0) == 0.0


@pytest.mark.parametrize("v", [0.0, 0.5, -0.5])
@pytest.mark.parametrize("integrator", ["exact", "taylor", "moreau"])
def test_a_contact_that_is_open_at_the_start(v: float, integrator: str) -> None:
    options = {"step": 1e-3} if integrator == "moreau" else {}
    model = rubbing("0.5", "y", v, opens=True)
    sol = hs.simulate(model, (0, 1), integrator=integrator, **options)
    assert sol.output("v", 1.0) == pytest.approx(v + 0.5)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "moreau"])
@pytest.mark.parametrize(("v", "force"), [(-0.7, -0.3), (0.4, 0.3), (0.1, -0.0625)])
def test_a_clock_at_the_start_reads_what_is_given(v: float, force: float, integrator: str) -> None:
    options = {"step": 2.0**-10} if integrator == "moreau" else {}
    contact = hs.Contact("f", "v - 0.1", 1, SLIPS, HEAVY)
    model = hs.Model(
        "sampled",
        [hs.State("v", v, der="-0.0625 - f")],
        contacts=[contact],
        discrete=[hs.Discrete("speed", 9), hs.Discrete("read", 9)],
        schedules=[hs.Schedule("clock", period=2, reset={"speed": "v", "read": "f"})],
    )
    sol = hs.simulate(model, (0, 1), integrator=integrator, **options)
    assert (sol.output("speed", 0.5), sol.output("read", 0.5)) == pytest.approx((v, force))


@pytest.mark.parametrize("fillers", [0, 1, 3])
@pytest.mark.parametrize("names", list(itertools.permutations(["one", "two", "three"], 2)))
def test_the_order_of_guards_in_their_mode_decides(names: tuple[str, str], fillers: int) -> None:
    """Both guards of the second mode are negative as it begins, whatever the first mode had."""
    never = [hs.Guard(f"never{k}", "5 - a", "other") for k in range(fillers)]
    modes = [
        hs.Mode("first", [*never, hs.Guard("due", "a", "second")]),
        hs.Mode("second", [hs.Guard(names[0], "a - 1", "third"), hs.Guard(names[1], "b", "other")]),
        hs.Mode("third"),
        hs.Mode("other"),
    ]
    component = hs.Component("c", modes, initial="first")
    states = [hs.State("a", 1, der=-1), hs.State("b", -2, der=-1)]
    model = hs.Model("two", states, components=[component])
    assert [event.target for event in hs.simulate(model, (0, 2)).events] == ["second", "third"]
    truth = multiple_precision_trajectory(model, (0, 2))
    assert [event.target for event in truth.events] == ["second", "third"]


def test_the_reference_takes_sides_first() -> None:
    """A comparison measures against it, so that it must not share the mistake."""
    for model, v in (
        (rubbing("0.5 - 2*max(y, 0)"), 0.0),
        (rubbing("(0.5 if t < 2 else 2)"), 3.4),
        (rubbing("0.5", "y", opens=True), 2.0),
    ):
        truth = multiple_precision_trajectory(model, (0, 4))
        assert truth.states(np.array([4.0]), "+").ravel() == pytest.approx([-1.0, v])


@pytest.mark.parametrize("integrator", ["cvode-bdf", "cvode-adams"])
@pytest.mark.parametrize(
    ("rate", "end"), [("t", 1.0), ("-t", 1.0), ("t**2", 1.5 ** (1 / 3)), ("-sin(t)", math.pi / 3)]
)
@pytest.mark.parametrize("start", [0, 3, 10, -40])
def test_a_corner_that_begins_at_zero_without_a_rate(
    start: float, rate: str, end: float, integrator: str
) -> None:
    """Its argument is below the rounding of the state at first, and root finding sees zeros of noise."""
    sol = hs.simulate(
        guarded(f"0.5 - abs(x - ({start}))", start, rate), (0, 2), integrator=integrator, rtol=1e-9
    )
    assert sol.status == "finished"
    assert [event.t for event in sol.events] == pytest.approx([end], abs=1e-6)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "cvode-bdf", "moreau", "reference"])
def test_a_step_in_time_and_a_schedule_at_one_instant(integrator: str) -> None:
    """The pull of 2 that the step begins is taken back to 0.5 by the schedule: the body rests at all times."""
    model = rubbing("(0.5 if t < 1 else 2) - 1.5*max(y, 0)", **moved(1.0))
    if integrator == "reference":
        assert not float(multiple_precision_trajectory(model, (0, 2)).states.state(2)[1])
        return
    sol = hs.simulate(
        model, (0, 2), integrator=integrator, **({"step": 1e-3} if integrator == "moreau" else {})
    )
    assert [event.component for event in sol.events] == ["jump"]
    assert sol.output("v", 2.0) == 0.0
