"""Segments of more steps than a compiled loop has room for: it goes on in pieces, and nothing else changes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.run import compiled_loop
from hybridsim.engine.run.segment_run import SegmentRun

OSCILLATOR = hs.Model("free", states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="-x")])


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for the least number of steps."""
    monkeypatch.setattr(compiled_loop, "_CALL_DOUBLES", 0)


@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "taylor"])
def test_a_segment_in_parts(integrator: str, little_memory: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """No step is taken in Python, times go up, and the motion is the cosine."""
    model = hs.Model(f"free-{integrator}", states=OSCILLATOR.states)  # whose sheets are of another size

    def never(*_: Any) -> None:
        raise AssertionError("a step in Python")

    monkeypatch.setattr(SegmentRun, "run", never)
    sol = hs.simulate(model, (0, 600), integrator=integrator, rtol=1e-9)
    assert sol.status == "finished" and sol.stats["restarts"] > 3
    assert (np.diff(sol.t) >= 0.0).all()
    times = np.linspace(0.0, 600.0, 2001)
    assert sol(times)[0] == pytest.approx(np.cos(times), abs=1e-5)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_an_event_after_many_parts(integrator: str, little_memory: None) -> None:
    """A guard that is looked at in each piece, and zero in the last one: exp(-t/100) falls to 1e-2."""
    modes = [hs.Mode("above", guards=[hs.Guard("g", "e - 0.01", "below")]), hs.Mode("below")]
    states = [*OSCILLATOR.states, hs.State("e", 1, der="-e/100")]
    model = hs.Model(
        f"late-{integrator}", states=states, components=[hs.Component("c", modes, initial="above")]
    )
    sol = hs.simulate(model, (0, 500), integrator=integrator, rtol=1e-10)
    (event,) = sol.events
    assert event.t == pytest.approx(100 * math.log(100), abs=1e-6)
    assert [piece.mode for piece in sol.modes["c"]] == ["above", "below"]


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_a_limit_in_the_middle_and_on(integrator: str, little_memory: None) -> None:
    """A run that is stopped among the pieces goes on to the same digits."""
    model = hs.Model(f"on-{integrator}", states=OSCILLATOR.states)
    whole = hs.simulate(model, (0, 900), integrator=integrator)
    part = hs.simulate(model, (0, 900), integrator=integrator, limits={"steps": 150})
    assert part.status == "limit" and 0.0 < part.t_end < 900.0
    assert part.resume(limits={}).y[:, -1].tolist() == whole.y[:, -1].tolist()


def fast_forcing(name: str, **further: Any) -> hs.Model:
    """x' = -x + sin(400 t) from 0: in twenty units of time the forcing goes through 1273 turns."""
    return hs.Model(name, states=[hs.State("x", 0, der="-x + sin(400*t)")], **further)


def forced(t: Any) -> Any:
    """Its motion in closed form."""
    return (np.sin(400 * t) - 400 * np.cos(400 * t) + 400 * np.exp(-t)) / (1 + 400**2)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
def test_more_turns_than_a_segment_may_have(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A segment ends after a hundred turns of the forcing; the next one begins in compiled code as well."""
    steps, run = [0], SegmentRun.run

    def counted(segment: SegmentRun, *args: Any) -> Any:
        arrival = run(segment, *args)
        steps[0] += len(segment.knots) - 1
        return arrival

    monkeypatch.setattr(SegmentRun, "run", counted)
    sol = hs.simulate(fast_forcing("fast"), (0, 20), integrator=integrator, rtol=1e-10)
    assert sol.status == "finished" and sol.stats["restarts"] >= 12
    assert steps[0] == 0  # none of them in Python
    assert (np.diff(sol.t) >= 0.0).all()
    times = np.linspace(0.0, 20.0, 2003)
    assert np.abs(sol(times)[0] - forced(times)).max() <= 1e-9


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_an_event_and_a_clock_after_many_turns(integrator: str) -> None:
    """The guard 10 - y, where y counts time from the last tick of a clock at 9, is zero at 19."""
    model = fast_forcing("fast-and-late")
    model = hs.Model(
        "fast-and-late",
        states=[*model.states, hs.State("y", 0, der="1")],
        components=[
            hs.Component(
                "c",
                [hs.Mode("below", guards=[hs.Guard("g", "10 - y", "above")]), hs.Mode("above")],
                initial="below",
            )
        ],
        schedules=[hs.Schedule("s", times=[9.0], reset={"y": "0"})],
    )
    sol = hs.simulate(model, (0, 25), integrator=integrator, rtol=1e-10)
    tick, event = sol.events
    assert tick.t == 9.0 and event.t == pytest.approx(19.0, abs=1e-12) and event.target == "above"
    times = np.linspace(0.0, 25.0, 2003)
    assert np.abs(sol(times)[0] - forced(times)).max() <= 1e-9


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_limit_between_the_turns_and_on(integrator: str) -> None:
    """A run that is stopped among segments of a hundred turns goes on to the same digits."""
    model = fast_forcing(f"fast-{integrator}")
    whole = hs.simulate(model, (0, 20), integrator=integrator)
    part = hs.simulate(model, (0, 20), integrator=integrator, limits={"steps": 5})
    assert part.status == "limit" and 0.0 < part.t_end < 20.0
    assert part.resume(limits={}).y[:, -1].tolist() == whole.y[:, -1].tolist()
