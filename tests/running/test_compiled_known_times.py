"""Knots of inputs and ticks of clocks in compiled loops: closed forms, and runs through the general loop alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import hybridsim as hs
from hybridsim.engine.run import mode_loop
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.known_times import TimesAhead
from hybridsim.engine.system.system import System
from hybridsim.engine.system.timetable import Timetable
from hybridsim.integrators.registry import integrator_class

METHODS = ("exact", "taylor", "dop853")


@pytest.fixture
def no_general_segments(monkeypatch: pytest.MonkeyPatch):
    """Let a segment of the general loop fail the test."""

    def refuse(*_, **__):
        raise AssertionError("the general loop took a segment")

    monkeypatch.setattr(mode_loop, "SegmentRun", refuse)


def both_ways(model, span, method, monkeypatch, **options):
    """Return the solutions of a compiled loop and of the general loop."""
    options = {"rtol": 1e-11, **options}
    compiled = hs.simulate(model, span, integrator=method, **options)
    with monkeypatch.context() as patch:
        patch.setattr(integrator_class(method), "has_compiled_loop", False)
        # a copy, because a known model keeps its compiled loop
        general = hs.simulate(replace(model), span, integrator=method, **options)
    return compiled, general


def assert_same(compiled, general, rtol=1e-9):
    """The same events and warnings, with times and states to within the tolerance."""
    kinds = [
        [(e.kind, e.component, e.guard, e.source, e.target) for e in sol.events]
        for sol in (compiled, general)
    ]
    assert kinds[0] == kinds[1]
    assert (compiled.status, compiled.warnings) == (general.status, general.warnings)
    assert [e.t for e in compiled.events] == pytest.approx(
        [e.t for e in general.events], rel=1e-10, abs=1e-11
    )
    for side in ("x_minus", "x_plus"):
        a, b = (np.array([getattr(e, side) for e in sol.events]) for sol in (compiled, general))
        assert a == pytest.approx(b, rel=rtol, abs=1e-9)
    assert compiled.y[:, -1] == pytest.approx(general.y[:, -1], rel=rtol, abs=1e-9)


def oscillator(times, values, damping=0.3):
    return hs.Model(
        "oscillator",
        states=[hs.State("x", 0.5, "v"), hs.State("v", 0, f"-4*x - {damping}*v + u")],
        inputs=[hs.Input("u", "table", times=tuple(times), values=tuple(values))],
    )


def driven(times, values, end, damping=0.3):
    """The states at the end by one matrix exponential for each piece of the force, constant beyond the table."""
    A = np.zeros((4, 4))
    A[0, 1], A[1] = 1.0, (-4.0, -damping, 1.0, 0.0)
    A[2, 3] = 1.0  # the force and its slope
    y, t = np.array([0.5, 0.0, 0.0, 0.0]), 0.0
    knots = [k for k in range(len(times)) if 0.0 <= times[k] < end]
    for k in knots:
        if times[k] > t:
            y, t = expm(A * (times[k] - t)) @ y, times[k]
        width = times[k + 1] - times[k] if k + 1 < len(times) else 0.0
        y[2], y[3] = values[k], (values[k + 1] - values[k]) / width if width > 0.0 else 0.0
    return (expm(A * (end - t)) @ y)[:2]


@pytest.mark.parametrize("method", METHODS)
def test_a_piecewise_linear_force(method, no_general_segments) -> None:
    """Also with jumps, a start on a knot, and an end on a knot."""
    draw = np.random.default_rng(1)
    times, values = np.linspace(0.0, 6.0, 41), draw.normal(size=41)
    jumping = np.sort(np.concatenate([times, times[5:35:3]]))
    for knots, forces, end in (
        (times, values, 7.0),
        (times, values, 6.0),
        (times, values, float(times[20])),
        (jumping, draw.normal(size=len(jumping)), 5.9),
    ):
        sol = hs.simulate(oscillator(knots, forces), (0, end), integrator=method, rtol=1e-11)
        assert sol.success and not len(sol.events)
        assert sol.y[:, -1] == pytest.approx(driven(knots, forces, end), rel=1e-9, abs=1e-10)
        if knots is times:
            inside = np.linspace(0.0, end, 23)
            assert sol.output("u", inside) == pytest.approx(np.interp(inside, knots, forces))


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_controller(method, no_general_segments) -> None:
    """x' = -x + u, and each tick sets u = -2 x + 0.5 u and s = s + x, from the values before."""
    model = hs.Model(
        "sampled",
        states=[hs.State("x", 1, "-x + u")],
        discrete={"u": 0.25, "s": 0.0},
        schedules=[hs.Schedule("tick", start=0.01, period=0.01, reset={"u": "-2*x + 0.5*u", "s": "s + x"})],
    )
    sol = hs.simulate(model, (0, 10.005), integrator=method, rtol=1e-12)
    x, u, s, decay = 1.0, 0.25, 0.0, math.exp(-0.01)
    for k in range(1000):
        x = decay * x + (1.0 - decay) * u
        event = sol.events[k] if k % 97 == 0 else None
        if event is not None:
            assert (event.kind, event.component, event.t) == (
                "scheduled",
                "tick",
                pytest.approx(0.01 * (k + 1)),
            )
            assert event.x_minus[0] == pytest.approx(x, rel=1e-10, abs=1e-13) == event.x_plus[0]
        u, s = -2.0 * x + 0.5 * u, s + x
    assert len(sol.events) == 1000
    assert sol.stats["events"] == 0  # changes of mode
    assert sol.output("s", [10.0])[0] == pytest.approx(s, rel=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_a_clock_that_adds(method, no_general_segments, monkeypatch) -> None:
    """x' = -x + u; each tick adds -0.4 x to u, and x to s, from the values before. No tick leaves the compiled loop."""

    def refuse(*_, **__):
        raise AssertionError("the general loop took a tick")

    monkeypatch.setattr(mode_loop.ModeLoop, "_resolve_appointment", refuse)
    model = hs.Model(
        "adding",
        states=[hs.State("x", 1, "-x + u")],
        discrete={"u": 0.25, "s": 0.0},
        schedules=[hs.Schedule("tick", start=0.25, period=0.25, reset={"u": "+= -0.4*x", "s": "+= x"})],
    )
    sol = hs.simulate(model, (0, 50.1), integrator=method, rtol=1e-12)
    x, u, s, decay = 1.0, 0.25, 0.0, math.exp(-0.25)
    for _ in range(200):
        x = decay * x + (1.0 - decay) * u
        u, s = u - 0.4 * x, s + x
    assert len(sol.events) == 200
    assert sol.output("s", [50.0])[0] == pytest.approx(s, rel=1e-9, abs=1e-9)
    assert sol.output("u", [50.0])[0] == pytest.approx(u, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_two_clocks_that_add_to_one_value_at_one_instant(method) -> None:
    """Both amounts count, with the values before; so do those of a clock that is declared twice."""
    for second in ("+= 0.5*n", "+= 1"):
        model = hs.Model(
            "two",
            states=[hs.State("x", 0, "n")],
            discrete={"n": 1.0},
            schedules=[
                hs.Schedule("a", start=0.5, period=0.5, reset={"n": "+= 1"}),
                hs.Schedule("b", start=1.0, period=1.0, reset={"n": second}),
            ],
        )
        sol = hs.simulate(model, (0, 4.25), integrator=method, rtol=1e-12)
        n, x = 1.0, 0.0
        for k in range(1, 9):
            x += 0.5 * n
            n += 1.0 + ((0.5 * n if "n" in second else 1.0) if k % 2 == 0 else 0.0)
        assert sol.output("n", [4.1])[0] == n
        assert sol.y[0, -1] == pytest.approx(x + 0.25 * n, rel=1e-12)


def friction(**parts):
    return hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "u + w + d - 9*x - 0.1*v - f")],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": 0.6})],
        discrete={"d": 0.0, "e": 1.0},
        **parts,
    )


def random_parts(seed):
    """Inputs and schedules with coinciding times: steps of 1/8 for all, some moved by an ulp."""
    draw = np.random.default_rng(seed)
    times = np.sort(draw.choice(np.arange(1, 64) / 8, 12, replace=False))
    moved = draw.random(12) < 0.3
    times[moved] = np.nextafter(times[moved], 9.0)
    if seed % 2:
        times = np.sort(np.append(times, times[3]))
    return {
        "inputs": [
            hs.Input("u", "table", times=(0.0, *times), values=tuple(1.5 * draw.normal(size=len(times) + 1))),
            hs.Input(
                "w", "wave", shape=("square", "triangle", "sawtooth")[seed % 3], amplitude=0.7, period=1.5
            ),
        ],
        "schedules": [
            hs.Schedule("a", start=0.25, period=0.375, reset={"d": "0.3*d - x"}),
            hs.Schedule("b", start=0, period=0.1, reset={"e": "e + v*d"}),
            hs.Schedule("c", times=(1.0, 1.0, 2.25, 4.0)),
        ],
    }


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_friction_under_inputs_and_clocks_both_ways(method, seed, monkeypatch) -> None:
    assert_same(*both_ways(friction(**random_parts(seed)), (0, 8), method, monkeypatch))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shift", [-1e-9, -1e-15, 0.0, 1e-15, 1e-9])
def test_a_release_beside_a_knot(method, shift, monkeypatch) -> None:
    """The force u = t reaches the limit 0.6 beside the knot at 0.6, where it begins to fall or to rise faster."""
    for slope in (-1.0, 3.0):
        parts = {
            "inputs": [
                hs.Input("u", "table", times=(0, 0.6 + shift, 2), values=(0, 0.6 + shift, 0.6 + slope)),
                hs.Input("w", "table", times=(0, 9), values=(0, 0)),
            ]
        }
        compiled, general = both_ways(friction(**parts), (0, 3), method, monkeypatch)
        assert_same(compiled, general)
        goes = slope > 0.0 or shift > 1e-12
        assert (len(compiled.events) > 0) == goes or abs(shift) < 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_the_known_times_are_those_of_the_timetable(seed) -> None:
    """Instants, schedules that are due, and pieces of the inputs, bit for bit."""
    draw = np.random.default_rng(seed)
    parts = random_parts(seed)
    period, origin = float(draw.uniform(0.01, 1.0)), float(draw.uniform(0.0, 5.0))
    if seed > 5:
        parts["schedules"].append(hs.Schedule("g", start=origin, period=period))
        parts["inputs"].append(hs.Input("q", "wave", shape="square", period=period, duty=0.3, phase=origin))
    system = System(friction(**parts))
    end = Instant(50.0)
    timetable = Timetable(system, end)
    ahead, at, count = TimesAhead(system, timetable, end), Instant(0.0), 0
    timetable.mark_done(at)
    while True:
        known = ahead.after(at)
        for i in range(len(known.kinds)):
            appointment = timetable.next(at, True)
            assert known.instant(i) == appointment.instant
            assert known.due[known.kinds[i]] == appointment.schedules
            at, count = appointment.instant, count + 1
            timetable.mark_done(at)
            for piece, signal in zip(known.polynomials[i + 1], system.signals, strict=True):
                start = 0.0 if math.isnan(piece[4]) else Instant(*piece[4:].tolist()).minus(at)
                assert (*piece[:4].tolist(), start) == signal.piece(at, True)
        appointment = timetable.next(at, True)
        assert known.appointment == appointment
        if appointment is None:
            break
        at = appointment.instant
        timetable.mark_done(at)
    assert count > 400


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p"])
@pytest.mark.parametrize("knots", [255, 256, 257, 300])
def test_more_known_times_than_one_block_holds(integrator: str, knots: int) -> None:
    """Ticks of a clock lie between the knots of a table; x is the integral of the table, and y of the count."""
    h, values = 1 / 64, np.sin(np.arange(knots + 1.0))
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, "F"), hs.State("y", 0, "n")],
        discrete=[hs.Discrete("n", 0)],
        inputs=[hs.Input("F", "table", times=h * np.arange(knots + 1), values=values)],
        schedules=[hs.Schedule("tick", period=h, start=h / 2, reset={"n": "n + 1"})],
    )
    end = knots * h
    sol = hs.simulate(model, (0, end), integrator=integrator)
    assert sol.status == "finished"
    counted = sum(end - (i + 0.5) * h for i in range(knots))
    assert sol(end) == pytest.approx([h * (values[:-1] + values[1:]).sum() / 2, counted], rel=1e-8, abs=1e-8)
