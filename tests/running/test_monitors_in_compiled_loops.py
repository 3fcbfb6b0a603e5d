"""Compiled loops pass monitors: right times, the motion of the model without them, and no work in Python."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize

import hybridsim as hs
from hybridsim.engine.run import single_call
from hybridsim.engine.run.setup import RunSetup

METHODS = ["exact", "taylor", "dop853", "tsit5"]
SWING = """
schema = 1
name = "swing"
[states]
x = { start = 0.25, der = "y" }
y = { start = 0.5, der = "-x" }
n = { start = 0, der = "0" }
"""
PHASE, SIZE = math.atan2(0.25, 0.5), math.hypot(0.25, 0.5)  # x = SIZE sin(t + PHASE)


def swing(*monitors: hs.Monitor, more: str = "") -> hs.Model:
    """The oscillator x'' = -x with monitors and further tables."""
    return replace(hs.Model.from_toml(SWING + more), monitors=monitors)


def crossings(level: float, rising: bool, until: float) -> list[float]:
    """Times at which x = SIZE sin(t + PHASE) crosses a level in one direction."""
    first = math.asin(level / SIZE)
    at = (first if rising else math.pi - first) - PHASE
    return [at + math.tau * k for k in range(-2, 50) if 0.0 < at + math.tau * k <= until]


def events_of(solution: hs.Solution) -> list[tuple[str, str, int, float]]:
    return [(e.component, e.kind, e.direction, e.t) for e in solution.events]


def in_python(monkeypatch: pytest.MonkeyPatch, run: Any) -> Any:
    """The result of a run for which no compiled loop is made."""
    with monkeypatch.context() as patch:
        patch.setattr(RunSetup, "_compiled_loop", lambda *_: None)
        return run()


@pytest.mark.parametrize("integrator", METHODS)
def test_times_and_directions_are_those_of_the_sine(integrator: str) -> None:
    model = swing(
        hs.Monitor("any", "x - 0.3"),
        hs.Monitor("rising", "x + 0.4", direction="up"),
        hs.Monitor("falling", "2*x - 0.2", direction="down"),
        hs.Monitor("far", "x - 5"),
    )
    solution = hs.simulate(model, (0, 40), integrator=integrator, rtol=1e-12, atol=1e-13)
    due = [("any", way, t) for way in (1, -1) for t in crossings(0.3, way > 0, 40)]
    due += [("rising", 1, t) for t in crossings(-0.4, True, 40)]
    due += [("falling", -1, t) for t in crossings(0.1, False, 40)]
    due.sort(key=lambda event: event[2])
    found = [(name, way, t) for name, kind, way, t in events_of(solution) if kind == "monitor"]
    assert [event[:2] for event in found] == [event[:2] for event in due]
    assert max(abs(f[2] - d[2]) for f, d in zip(found, due, strict=True)) < 1e-10
    assert abs(solution["x"][-1] - SIZE * math.sin(40 + PHASE)) < 1e-10


@pytest.mark.parametrize("integrator", METHODS)
def test_the_whole_run_is_one_compiled_call(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> None:
        raise AssertionError("the mode loop was entered")

    model = swing(hs.Monitor("any", "x - 0.3"), hs.Monitor("far", "y - 5", action="terminate"))
    monkeypatch.setattr(single_call, "ModeLoop", never)
    solution = hs.simulate(model, (0, 40), integrator=integrator)
    assert len(solution.events) == len(crossings(0.3, True, 40)) + len(crossings(0.3, False, 40))


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_ends_the_run_and_others_count(integrator: str) -> None:
    model = swing(
        hs.Monitor("count", "x - 0.3", action="reset", reset={"n": "n + 1"}),
        hs.Monitor("end", "x + 0.5", direction="up", action="terminate"),
    )
    end = crossings(-0.5, True, 40)[0]
    solution = hs.simulate(model, (0, 40), integrator=integrator, rtol=1e-12, atol=1e-13)
    assert solution.status == "terminated" and abs(solution.t_end - end) < 1e-10
    assert solution["n"][-1] == len(crossings(0.3, True, end)) + len(crossings(0.3, False, end))


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("action", ["record", "terminate"])
def test_a_reset_at_a_known_time_carries_a_monitor_over_zero(integrator: str, action: str) -> None:
    more = '[schedules.jump]\ntimes = [1.5]\nreset = { n = "3" }\n'
    model = swing(hs.Monitor("over", "n - 2", action=action), more=more)
    solution = hs.simulate(model, (0, 4), integrator=integrator)
    assert [e.t for e in solution.events if e.kind == "monitor"] == [1.5]
    assert (solution.status, solution.t_end) == (
        ("finished", 4.0) if action == "record" else ("terminated", 1.5)
    )


@pytest.mark.parametrize("integrator", METHODS)
def test_resets_of_clocks_keep_their_own_values_beside_resets_of_monitors(integrator: str) -> None:
    more = (
        '[discrete]\nheld = { start = 0 }\n[clocks.tick]\nperiod = 0.5\noffset = 0.25\nset = { held = "t" }\n'
    )
    model = swing(hs.Monitor("count", "x - 0.3", action="reset", reset={"n": "n + 1"}), more=more)
    solution = hs.simulate(model, (0, 4), integrator=integrator)
    assert solution.status == "finished"
    assert solution.output("held", [0.1, 0.3, 0.8, 3.9]).tolist() == [0.0, 0.25, 0.75, 3.75]


@pytest.mark.parametrize("integrator", METHODS)
def test_frequencies_of_resets_and_schedules_keep_their_places(integrator: str) -> None:
    """Each frequency occurs once: in a rate, a monitor, a reset of a monitor, a schedule."""
    more = '[schedules.jump]\ntimes = [1.5]\nreset = { n = "n + 8*cos(0.9*t)" }\n'
    monitors = (
        hs.Monitor("early", "t - 1", action="reset", reset={"n": "n + sin(0.3*t)"}),
        hs.Monitor("wave", "x - 0.5*sin(2*t)"),
    )
    model = replace(
        swing(*monitors, more=more), states=(hs.State("x", 0, "0.7*cos(0.7*t)"), hs.State("n", 0, "0"))
    )
    solution = hs.simulate(model, (0, 2), integrator=integrator, rtol=1e-12, atol=1e-13)
    assert abs(solution["x"][-1] - math.sin(1.4)) < 1e-10
    assert abs(solution["n"][-1] - math.sin(0.3) - 8.0 * math.cos(1.35)) < 1e-10
    crossing = optimize.brentq(lambda t: math.sin(0.7 * t) - 0.5 * math.sin(2.0 * t), 0.3, 1.4, xtol=1e-14)
    assert [e.t for e in solution.events if e.component == "wave"] == [pytest.approx(crossing, abs=1e-10)]


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    "monitors",
    [
        (hs.Monitor("half", "x - 1e-4"), hs.Monitor("speed", "v", direction="down")),
        (hs.Monitor("power", "v*sin(omega*t)"), hs.Monitor("size", "x*x + v*v/4e5 - 1e-8")),
        (hs.Monitor("force", "F0*sin(omega*t) - k*x"), hs.Monitor("root", "sqrt(x)")),
    ],
)
def test_a_model_with_friction_has_the_events_of_the_general_loop(
    integrator: str, monitors: tuple[hs.Monitor, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = hs.load("dfcs")
    model = replace(plain, monitors=monitors)

    def run(of: hs.Model = model) -> hs.Solution:
        return hs.simulate(of, (0, 0.035), integrator=integrator, rtol=1e-12, atol=1e-13)

    # the general loop takes a copy, because a known model keeps its compiled loop
    fast, slow, bare = run(), in_python(monkeypatch, lambda: run(replace(model))), run(plain)
    assert [e[:3] for e in events_of(fast)] == [e[:3] for e in events_of(slow)]
    assert np.allclose([e[3] for e in events_of(fast)], [e[3] for e in events_of(slow)], rtol=0, atol=1e-10)
    motion = [e for e in events_of(fast) if e[1] == "transition"]
    assert [e[0] for e in motion] == [e[0] for e in events_of(bare)]
    assert np.allclose([e[3] for e in motion], [e[3] for e in events_of(bare)], rtol=0, atol=1e-10)


SPEEDS = (
    hs.Monitor("any", "v"),
    hs.Monitor("opposite", "-2*v"),
    hs.Monitor("rising", "0.3*v", direction="up"),
    hs.Monitor("falling", "v", direction="down"),
)
# directions of these monitors at the turning points pi, 2 pi, ... of the model free-decay, which stops at 5 pi
TURNS = [
    (name, way, k * math.pi)
    for k in range(1, 6)
    for name, way in (("any", 1), ("opposite", -1), ("rising", 1), ("falling", -1))
    for way in [way if k % 2 == 1 or name in ("rising", "falling") else -way]
    if name in ("any", "opposite") or (way > 0) == (k % 2 == 1)
]


def fired(events: Iterable[Any]) -> list[tuple[str, int, Any]]:
    """Names, directions and times of the monitors that fired."""
    return [(e.component, e.direction, pytest.approx(e.t, abs=1e-11)) for e in events if e.kind == "monitor"]


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_of_the_sliding_speed_fires_at_the_turning_points_in_one_compiled_call(
    integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any) -> None:
        raise AssertionError("the mode loop was entered")

    model = replace(hs.load("free-decay"), monitors=SPEEDS)
    monkeypatch.setattr(single_call, "ModeLoop", never)
    solution = hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-12, atol=1e-13)
    assert fired(solution.events) == TURNS
    assert abs(solution["x"][-1] + 0.5) < 1e-10 and solution["v"][-1] == 0.0


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_of_the_sliding_speed_keeps_its_side_between_calls(integrator: str) -> None:
    model = replace(hs.load("free-decay"), monitors=SPEEDS)
    sim = hs.Simulator(model, integrator=integrator, rtol=1e-12, atol=1e-13)
    sim.start(0.0)
    events = [event for k in range(1, 41) for event in sim.advance(0.5 * k)]
    assert fired(events) == TURNS


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_of_the_sliding_speed_that_acts_ends_the_run(integrator: str) -> None:
    monitors = (hs.Monitor("turn", "-v", direction="up", action="terminate"), hs.Monitor("half", "v"))
    solution = hs.simulate(replace(hs.load("free-decay"), monitors=monitors), (0, 20), integrator=integrator)
    assert solution.status == "terminated" and abs(solution.t_end - 2.0 * math.pi) < 1e-4


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_of_the_sliding_speed_has_the_events_of_the_general_loop(
    integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = replace(
        hs.load("dfcs"), monitors=(*SPEEDS, hs.Monitor("half", "x - 1e-4"), hs.Monitor("late", "v"))
    )

    def run(of: hs.Model) -> hs.Solution:
        return hs.simulate(of, (0, 0.1), integrator=integrator, rtol=1e-12, atol=1e-13)

    fast, slow = run(model), in_python(monkeypatch, lambda: run(replace(model)))
    assert [e[:3] for e in events_of(fast)] == [e[:3] for e in events_of(slow)]
    assert np.allclose([e[3] for e in events_of(fast)], [e[3] for e in events_of(slow)], rtol=0, atol=1e-11)
    assert np.allclose(fast.y[:, -1], slow.y[:, -1], rtol=1e-9, atol=1e-12)
