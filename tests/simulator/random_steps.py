"""Random sequences of calls of a simulator, each compared with the straight run with knots at the same times."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np

import hybridsim as hs
from hybridsim.engine.run import mode_loop

KNOTS = 10
END = 2.0
_RATES = {
    "block": "(F - f)/m",
    "oscillator": "(F + 12*sin(7*t) - 0.3*v - 60*x - f)/m",
    "pendulum": "(F + 12*sin(7*t) - 0.3*v - 60*sin(x) - f)/m",
}
KINDS = tuple(_RATES)


def _text(kind: str, parts: str, parameters: str = "") -> str:
    return f"""
schema = 1
name = "{kind}"
[parameters]
m = 2
N = 16
{parameters}
[states]
x = {{ start = 0, der = "v" }}
v = {{ start = 0, der = "{_RATES[kind]}" }}
[contacts.f]
velocity = "v"
normal = "N"
law = {{ name = "coulomb", mu = 0.5 }}
{parts}
"""


def models(kind: str) -> tuple[hs.Model, hs.Model]:
    """A model with a held force F, and one with a force that schedules set at times that are parameters."""
    held = _text(kind, "[inputs]\nF = { kind = 'held' }\n")
    parameters = "".join(f"t{k} = {100 + k}\nF{k} = 0\n" for k in range(KNOTS))
    parts = "".join(f"[schedules.k{k}]\ntimes = ['t{k}']\nreset = {{ F = 'F{k}' }}\n" for k in range(KNOTS))
    return hs.Model.from_toml(held), hs.Model.from_toml(
        _text(kind, f"[discrete]\nF = 0\n{parts}", parameters)
    )


@dataclass
class Outcome:
    """How a sequence compares with a straight run.

    is_equal: whether all bits are those of the run whose compiled calls end at the knots. difference: of a state from
    the run whose calls pass them.
    """

    is_equal: bool
    difference: float
    has_same_modes: bool
    calls: int


def compare(kind: str, integrator: str, seed: int) -> Outcome:
    """Drive a simulator by random calls, and compare its end with that of the straight run."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    held, scheduled = models(kind)
    sim, numbers = hs.Simulator(held, integrator=integrator), {"m": 2.0}
    sim.start(0.0)
    path: list[tuple[float, float]] = []  # the knots of the present state
    saved = [(sim.save(), path, numbers)]
    calls = 0
    while len(path) < KNOTS and calls < 60:
        calls += 1
        call = rng.choice(
            ["advance", "set", "again", "save", "restore", "copy", "pickle", "start"], p=_SHARES
        )
        if call in ("advance", "set"):
            # some of the times are round, and some are those of events
            to = sim.t + float(rng.choice([0.0625, 0.125, rng.uniform(0.001, 0.3)]))
            sim.advance(to)
            if call == "set":
                sim.set({"F": float(rng.choice([0.0, 8.0, -8.0, rng.uniform(-30, 30)]))})
            path = [*path, (to, sim.inputs["F"])]
        elif call == "again":
            assert sim.advance(sim.t, sim.inputs) == ()
        elif call == "save":
            saved.append((sim.save(), path, numbers))
        elif call == "restore":
            state, path, numbers = saved[int(rng.integers(len(saved)))]
            sim.restore(state)
        elif call == "copy":
            former, sim = sim, sim.copy()
            former.advance(former.t + 0.1, {"F": 25.0})
        elif call == "pickle":
            sim = pickle.loads(pickle.dumps(sim))
        else:
            path, numbers = [], {"m": float(rng.uniform(1, 4))}
            sim.start(0.0, params=numbers)
    sim.advance(sim.t + END)
    knots = {f"t{k}": t for k, (t, _) in enumerate(path)} | {
        f"F{k}": value for k, (_, value) in enumerate(path)
    }
    settings: dict[str, Any] = {"params": numbers | knots, "integrator": integrator}
    whole = hs.simulate(scheduled, (0, sim.t), **settings)
    # tables of `exact` are made for the longest call of a run, so a call that passes knots has other last digits
    with patch.object(mode_loop, "has_known_times", lambda system: False):
        straight = hs.simulate(scheduled, (0, sim.t), **settings)
    assert straight.status == whole.status == "finished"
    found = np.array(list(sim.state.values()))
    return Outcome(
        found.tobytes() == straight.y[:, -1].tobytes(),
        float(np.abs(found - whole.y[:, -1]).max()),
        sim.modes == {"f": straight.modes["f"][-1].mode} == {"f": whole.modes["f"][-1].mode},
        calls,
    )


_SHARES = [0.3, 0.3, 0.1, 0.08, 0.08, 0.06, 0.02, 0.06]
