"""Runs with ordinary events only have their derivatives from one compiled pass, and all other runs event by event."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.variations.carried import Carrier

METHODS = ["exact", "taylor", "dop853"]


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    """The ends of the segments whose events are followed one by one."""
    found: list[float] = []
    through = Carrier._through

    def counted(self: Carrier, segment_events: Any, *arguments: Any) -> Any:
        found.append(float(segment_events.segment.end))
        return through(self, segment_events, *arguments)

    monkeypatch.setattr(Carrier, "_through", counted)
    yield found


@pytest.mark.parametrize("method", METHODS)
def test_a_block_that_comes_to_rest(method: str) -> None:
    """The k-th turning point is x0 - 2 k mu N/k on alternating sides, at the time k pi sqrt(m/k)."""
    names = ["m", "k", "mu", "N", "x0"]
    found = hs.sensitivities(hs.simulate("free-decay", (0, 20), integrator=method, rtol=1e-12), names)
    assert found.by_parameter[0] == pytest.approx([0.0, -10.0, 100.0, 1.0, -1.0], abs=1e-8)
    assert found.by_parameter[1].tolist() == [0.0] * 5
    turns = math.pi * np.arange(1, 6)
    assert found.times == pytest.approx(turns, abs=1e-9)
    assert found.times_by_parameter[:, 0] == pytest.approx(0.5 * turns, abs=1e-8)
    assert found.times_by_parameter[:, 1] == pytest.approx(-0.5 * turns, abs=1e-8)
    assert found.times_by_parameter[:, 2:] == pytest.approx(np.zeros((5, 3)), abs=1e-8)


def thrown(reset: bool) -> hs.Model:
    """v' = -a - b sign(v) with a > b, and a clock that sets w if `reset`."""
    return hs.Model(
        "thrown",
        parameters={"a": 3.0, "b": 1.0, "v0": 2.0},
        states=[hs.State("v", "v0", "-a - f", nominal=1), hs.State("w", 0, "v", nominal=1)],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": "b"})],
        schedules=[hs.Schedule("clock", times=(0.25,), reset={"w": "w + v0"})] if reset else [],
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("reset", [False, True])
def test_a_velocity_that_changes_its_sign(method: str, reset: bool, followed: list[float]) -> None:
    """v = v0 - (a + b) t up to t1 = v0/(a + b), and -(a - b) (t - t1) after it; a reset goes event by event."""
    a, b, v0, t = 3.0, 1.0, 2.0, 1.0
    t1, total = v0 / (a + b), a + b
    found = hs.sensitivities(hs.simulate(thrown(reset), (0, t), integrator=method), ["a", "b", "v0"])
    by_t1 = np.array([-v0 / total**2, -v0 / total**2, 1.0 / total])
    rest = t - t1
    v = np.array([-rest, rest, 0.0]) + (a - b) * by_t1
    w = np.array([0.0, 0.0, v0]) / total - 0.5 * v0**2 / total**2 * np.array([1.0, 1.0, 0.0])
    w += np.array([-0.5, 0.5, 0.0]) * rest**2 + (a - b) * rest * by_t1 + np.array([0.0, 0.0, float(reset)])
    assert found.by_parameter == pytest.approx(np.array([v, w]), rel=1e-10, abs=1e-10)
    assert found.times_by_parameter[-1] == pytest.approx(by_t1, rel=1e-10)
    assert bool(followed) == reset
