"""A step in one compiled call leaves exactly what the general loop leaves, and so does a change of a held input."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.run.resume_point import ResumePoint
from simulator.random_steps import models

BELT = """
schema = 1
name = "belt"
[states]
x = { start = 0, der = "v" }
v = { start = 0, der = "sin(2*t) - x - f" }
[inputs]
w = { kind = 'held' }
[contacts.f]
velocity = "v - w"
normal = "1"
law = { name = "coulomb", mu = 0.5 }
"""
RELAY = """
schema = 1
name = "relay"
[states]
T = { start = 0, der = "q - T + power" }
[inputs]
q = { kind = 'held' }
[components.heater.modes.on]
initial = true
set = { power = "1" }
guards.hot = { expr = "0.2 - T", then = "off" }
[components.heater.modes.off]
set = { power = "0" }
guards.cold = { expr = "T - 0.1", then = "on" }
"""


def driven(model: hs.Model, integrator: str, name: str, values: list[float], step: float) -> list[object]:
    """All that steps with these values of one input leave, call by call."""
    sim = hs.Simulator(model, integrator=integrator)
    sim.start(0.0)
    found: list[object] = []
    for k, value in enumerate(values, 1):
        events = sim.advance(step * k, {name: value})
        position = sim._position
        assert position is not None
        checkpoint = position.checkpoint
        arrays = {
            name: array.tolist()
            for name, array in checkpoint.arrays.items()
            if name not in ("p", "continuous")
        }
        discrete, steps = position.discrete.tolist(), position.point.counters.steps
        found.append(
            (repr(events), checkpoint.instant, arrays, discrete, checkpoint.settled, checkpoint.paces, steps)
        )
    return found


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize("kind", ["oscillator", "belt", "relay"])
def test_a_step_in_one_call_is_that_of_the_general_loop(
    kind: str, integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = {"belt": hs.Model.from_toml(BELT), "relay": hs.Model.from_toml(RELAY)}.get(kind) or models(kind)[
        0
    ]
    name, size = {"belt": ("w", 0.3), "relay": ("q", 0.2)}.get(kind, ("F", 30.0))
    values = (size * np.repeat(np.random.default_rng(3).uniform(-1.0, 1.0, 40), [1, 3] * 20)).tolist()
    calls, real = [], ResumePoint.step

    def counted(self: ResumePoint, *arguments: object) -> object:
        calls.append(real(self, *arguments))
        return calls[-1]

    monkeypatch.setattr(ResumePoint, "step", counted)
    quick = driven(model, integrator, name, values, 0.01)
    if ENABLED:
        assert sum(isinstance(found, ResumePoint) for found in calls) > 0.5 * len(values)
    monkeypatch.setattr(ResumePoint, "step", lambda self, end: None)
    monkeypatch.setattr(ResumePoint, "changed", lambda self, discrete: None)
    general = driven(model, integrator, name, values, 0.01)
    for a, b in zip(quick, general, strict=True):
        assert repr(a) == repr(b)  # as text, because a step size that is not known is nan
