"""Compiled loops pass monitors that are polynomials of the states: times of closed forms, and no work in Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

import hybridsim as hs
from hybridsim.engine.run.mode_loop import ModeLoop

METHODS = ["exact", "taylor", "dop853", "tsit5"]
SWING = """
schema = 1
name = "swing"
[states]
x = { start = 0.25, der = "y" }
y = { start = 0.5, der = "-x" }
n = { start = 0, der = "0" }
"""
PHASE, SIZE = math.atan2(0.25, 0.5), math.hypot(0.25, 0.5)  # x = SIZE sin(t + PHASE), y = SIZE cos(t + PHASE)


def swing(*monitors: hs.Monitor, more: str = "") -> hs.Model:
    """The oscillator x'' = -x with monitors and further tables."""
    return replace(hs.Model.from_toml(SWING + more), monitors=monitors)


def zeros(guard: Callable[[float], float], until: float) -> list[tuple[float, int]]:
    """Times and directions of the simple zeros of a function after 0; they are more than 0.001 apart."""
    t = np.linspace(0.0, until, int(until / 0.0007))
    values = np.array([guard(float(s)) for s in t])
    found = []
    for k in np.flatnonzero(values[:-1] * values[1:] < 0.0):
        at = optimize.brentq(guard, t[k], t[k + 1], xtol=1e-15, rtol=4.0 * np.finfo(float).eps)
        found.append((at, 1 if values[k] < 0.0 else -1))
    return found


def x_of(t: float) -> float:
    return SIZE * math.sin(t + PHASE)


def y_of(t: float) -> float:
    return SIZE * math.cos(t + PHASE)


GUARDS: dict[str, Callable[[float], float]] = {
    "x*y - 0.05": lambda t: x_of(t) * y_of(t) - 0.05,
    "0.3 - x**2": lambda t: 0.3 - x_of(t) ** 2,
    "x**3 - 0.02 + 0.1*y": lambda t: x_of(t) ** 3 - 0.02 + 0.1 * y_of(t),
    "x*x*y*y*y - x/100": lambda t: x_of(t) ** 2 * y_of(t) ** 3 - x_of(t) / 100.0,
    "(x + 2*y)*(x - y) - y**2/3": lambda t: (
        (x_of(t) + 2.0 * y_of(t)) * (x_of(t) - y_of(t)) - y_of(t) ** 2 / 3.0
    ),
    "x*sin(2*t) - 0.1": lambda t: x_of(t) * math.sin(2.0 * t) - 0.1,
    "t*y - 1": lambda t: t * y_of(t) - 1.0,
    "exp(-0.1*t)*x*x - 0.02": lambda t: math.exp(-0.1 * t) * x_of(t) ** 2 - 0.02,
}


@pytest.fixture
def in_compiled_code(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Fail if a run of the method `exact` leaves the compiled loop."""
    if request.node.callspec.params["integrator"] == "exact":
        never_in_python(monkeypatch)


def never_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a segment that Python code follows fail."""

    def never(*_: object) -> None:
        raise AssertionError("the general loop follows a segment")

    monkeypatch.setattr(ModeLoop, "_segment_run", never)


def fired(solution: hs.Solution) -> list[tuple[str, int, float]]:
    return [(e.component, e.direction, e.t) for e in solution.events if e.kind == "monitor"]


def agree(found: list[tuple[str, int, float]], due: list[tuple[str, int, float]], within: float) -> None:
    due = sorted(due, key=lambda event: event[2])
    assert [event[:2] for event in found] == [event[:2] for event in due]
    assert due
    assert max(abs(f[2] - d[2]) for f, d in zip(found, due, strict=True)) < within


@pytest.mark.usefixtures("in_compiled_code")
@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("expr", GUARDS)
def test_times_and_directions_are_those_of_the_closed_form(integrator: str, expr: str) -> None:
    for direction, ways in (("both", (1, -1)), ("up", (1,)), ("down", (-1,))):
        model = swing(hs.Monitor("m", expr, direction=direction))
        solution = hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-12, atol=1e-13)
        due = [("m", way, t) for t, way in zeros(GUARDS[expr], 20.0) if way in ways]
        agree(fired(solution), due, 2e-13 if integrator == "exact" else 1e-10)
        assert abs(solution["x"][-1] - x_of(20.0)) < 1e-10


@pytest.mark.usefixtures("in_compiled_code")
@pytest.mark.parametrize("integrator", METHODS)
def test_an_energy_that_is_conserved_never_reaches_another_level(integrator: str) -> None:
    energy = 0.5 * SIZE**2
    levels = [energy * (1.0 + change) for change in (0.01, -0.01, 1e-6, -1e-6)]
    monitors = [hs.Monitor(f"m{k}", f"x**2/2 + y**2/2 - {level!r}") for k, level in enumerate(levels)]
    solution = hs.simulate(swing(*monitors), (0, 200), integrator=integrator, rtol=1e-12, atol=1e-13)
    assert not solution.events and not solution.warnings
    assert abs(solution["x"][-1] - x_of(200.0)) < 1e-9


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("depth", [1e-2, 1e-5, 1e-9])
def test_a_dip_has_two_zeros_or_none(integrator: str, depth: float) -> None:
    """x y = SIZE**2/2 sin(2 (t + PHASE)) has its minima between two zeros, or above zero."""
    half = 0.5 * SIZE**2
    into, above = (f"x*y + {half * (1.0 + change)!r}" for change in (-depth, depth))
    model = swing(hs.Monitor("in", into), hs.Monitor("out", above))
    solution = hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-12, atol=1e-13)
    angle = math.acos(1.0 - depth)
    minima = [0.75 * math.pi - PHASE + math.pi * k for k in range(7)]
    due = [("in", way, t + way * 0.5 * angle) for t in minima if t < 20.0 for way in (-1, 1)]
    agree(fired(solution), due, 1e-13 / angle + (0.0 if integrator == "exact" else 1e-10 / angle))


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_ends_the_run_and_others_count(integrator: str) -> None:
    model = swing(
        hs.Monitor("count", "x*y - 0.1", action="reset", reset={"n": "n + 1"}),
        hs.Monitor("end", "x**3 + y", direction="up", action="terminate"),
    )
    end = next(t for t, way in zeros(lambda t: x_of(t) ** 3 + y_of(t), 20.0) if way > 0)
    due = [t for t, _ in zeros(lambda t: x_of(t) * y_of(t) - 0.1, end)]
    solution = hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-12, atol=1e-13)
    assert solution.status == "terminated" and abs(solution.t_end - end) < 1e-10
    assert solution["n"][-1] == len(due) > 1


@pytest.mark.parametrize("integrator", METHODS)
def test_a_start_on_the_zero_is_left_without_an_event(integrator: str) -> None:
    """x y - 1/8 is zero at the start and rises; (x - 1/4)**2 touches zero there and at each return."""
    model = swing(hs.Monitor("product", "x*y - 0.125"), hs.Monitor("square", "(x - 0.25)**2"))
    solution = hs.simulate(model, (0, 7), integrator=integrator, rtol=1e-12, atol=1e-13)
    due = [("product", way, t) for t, way in zeros(lambda t: x_of(t) * y_of(t) - 0.125, 7.0) if t > 1e-6]
    agree([event for event in fired(solution) if event[2] > 1e-6], due, 1e-10)


@pytest.mark.usefixtures("in_compiled_code")
@pytest.mark.parametrize("integrator", METHODS)
def test_a_decaying_energy_passes_each_level_once(integrator: str) -> None:
    """x'' = -x - x'/5 from (1, 0)."""
    text = 'schema = 1\nname = "decay"\n[states]\nx = {start = 1, der = "y"}\ny = {start = 0, der = "-x - y/5"}\n'
    w = math.sqrt(0.99)

    def energy(t: float) -> float:
        decay = math.exp(-0.1 * t)
        x = decay * (math.cos(w * t) + 0.1 / w * math.sin(w * t))
        y = -decay / w * math.sin(w * t)
        return 0.5 * (x * x + y * y)

    levels = [0.4, 0.1, 0.01, 1e-3]
    monitors = [hs.Monitor(f"m{k}", f"y**2/2 + x**2/2 - {level}") for k, level in enumerate(levels)]
    model = replace(hs.Model.from_toml(text), monitors=tuple(monitors))
    solution = hs.simulate(model, (0, 50), integrator=integrator, rtol=1e-12, atol=1e-14)
    due = []
    for k, level in enumerate(levels):
        due += [(f"m{k}", way, t) for t, way in zeros(lambda t, at=level: energy(t) - at, 50.0)]
    assert len(due) == len(levels)
    agree(fired(solution), due, 1e-12 if integrator == "exact" else 1e-9)


@pytest.mark.parametrize("integrator", METHODS)
def test_products_of_a_bouncing_ball(integrator: str) -> None:
    """h = 1 - 5 t**2 and w = -10 t up to the first blow at 1/sqrt(5); each blow turns w."""
    text = """
schema = 1
name = "ball"
[states]
h = { start = 1, der = "w" }
w = { start = 0, der = "p - 10" }
[impacts.p]
gap = "h"
restitution = 1
"""
    monitors = (hs.Monitor("height", "h**2 - 0.25"), hs.Monitor("power", "h*w + 1", direction="down"))
    model = replace(hs.Model.from_toml(text), monitors=monitors)
    solution = hs.simulate(model, (0, 4), integrator=integrator, rtol=1e-12, atol=1e-13)
    period, down = 2.0 / math.sqrt(5.0), math.sqrt(0.1)
    due = [("height", way, k * period - way * down) for k in range(6) for way in (-1, 1)]
    # h w = -1 on the way down: 50 s**3 - 10 s + 1 = 0 at a time s after the top
    roots = sorted(r.real for r in np.roots([50.0, 0.0, -10.0, 1.0]) if 0.0 < r.real < 0.5 * period)
    due += [("power", -1, k * period + roots[0]) for k in range(6)]
    agree(
        fired(solution),
        [event for event in due if 0.0 < event[2] <= 4.0],
        1e-11 if integrator == "exact" else 1e-9,
    )


@pytest.mark.usefixtures("in_compiled_code")
@pytest.mark.parametrize("integrator", METHODS)
def test_a_product_with_a_value_that_a_clock_holds_and_with_an_input(integrator: str) -> None:
    """`held` is the number of the last tick, and u = 0.3 t."""
    more = """
[discrete]
held = 0
[clocks.tick]
period = 1.1
offset = 0.2
set = { held = "held + 1" }
[inputs.u]
kind = "table"
times = [0, 10]
values = [0, 3]
"""
    model = swing(hs.Monitor("sampled", "held*x*y - 0.2"), hs.Monitor("input", "u*x - 0.3"), more=more)
    solution = hs.simulate(model, (0, 9), integrator=integrator, rtol=1e-12, atol=1e-13)
    ticks = [0.2 + 1.1 * k for k in range(9)]

    def held(t: float) -> float:
        return sum(tick <= t for tick in ticks) * x_of(t) * y_of(t) - 0.2

    due = [("input", way, t) for t, way in zeros(lambda t: 0.3 * t * x_of(t) - 0.3, 9.0)]
    due += [("sampled", way, t) for t, way in zeros(held, 9.0)]
    agree(fired(solution), due, 1e-10)


def test_a_friction_oscillator_with_a_near_miss_runs_in_one_compiled_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The square of the largest displacement is 1 % away from the level."""
    plain = hs.load("dfcs")
    span = (0.0, 30 * 2.0 * math.pi / (0.6 * math.sqrt(1e5 / 0.2)))
    bare = hs.simulate(plain, span, integrator="exact")
    largest = float(abs(bare.output("x", np.linspace(*span, 30001))).max())
    model = replace(plain, monitors=(hs.Monitor("square", f"x*x - {1.01 * largest**2!r}"),))
    never_in_python(monkeypatch)
    solution = hs.simulate(model, span, integrator="exact")
    assert [e.t for e in solution.events] == pytest.approx([e.t for e in bare.events], rel=1e-13)
    assert solution.events and np.allclose(solution.y[:, -1], bare.y[:, -1], rtol=1e-12, atol=0.0)


def test_more_products_than_tables_hold_run_in_the_general_loop() -> None:
    states = [hs.State(f"x{i}", 1.0 + 0.1 * i, f"-{1 + i}*x{i}") for i in range(12)]
    expr = " + ".join(f"x{i}*x{k}" for i in range(12) for k in range(i + 1))
    model = hs.Model("many", states, monitors=[hs.Monitor("sum", f"{expr} - 1")])
    solution = hs.simulate(model, (0, 3), integrator="exact", rtol=1e-12, atol=1e-14)

    def guard(t: float) -> float:
        x = [(1.0 + 0.1 * i) * math.exp(-(1 + i) * t) for i in range(12)]
        return sum(x[i] * x[k] for i in range(12) for k in range(i + 1)) - 1.0

    agree(fired(solution), [("sum", way, t) for t, way in zeros(guard, 3.0)], 1e-11)
