"""Segments of more steps than a compiled loop has room for: it goes on in pieces, and nothing else changes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine import leaper
from hybridsim.engine.segment import SegmentRun

OSCILLATOR = hs.Model("free", states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="-x")])


@pytest.fixture
def little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for the least number of steps."""
    monkeypatch.setattr(leaper, "_ROOM", 0)


@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "taylor"])
def test_a_segment_in_pieces(integrator: str, little_room: None, monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_an_event_after_many_pieces(integrator: str, little_room: None) -> None:
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
def test_a_limit_in_the_middle_and_on(integrator: str, little_room: None) -> None:
    """A run that is stopped among the pieces goes on to the same digits."""
    model = hs.Model(f"on-{integrator}", states=OSCILLATOR.states)
    whole = hs.simulate(model, (0, 900), integrator=integrator)
    part = hs.simulate(model, (0, 900), integrator=integrator, limits={"steps": 150})
    assert part.status == "limit" and 0.0 < part.t_end < 900.0
    assert part.resume(limits={}).y[:, -1].tolist() == whole.y[:, -1].tolist()
