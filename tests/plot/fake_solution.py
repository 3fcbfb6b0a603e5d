"""Solutions made by no engine: closed forms behind the interface of a `Solution`, for tests of pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.model import Component, Contact, FrictionLaw, Guard, Mode, Model, Output, State
from hybridsim.model.parts.component import Choice
from hybridsim.reference.closed_forms.coulomb_model import recognise


@dataclass(frozen=True)
class FakeEvent:
    t: float
    component: str
    source: str
    target: str
    guard: str = "velocity"
    kind: str = "transition"
    x_minus: tuple = ()
    x_plus: tuple = ()
    direction: int = -1


@dataclass(frozen=True)
class FakeInterval:
    mode: str
    t0: float
    t1: float


@dataclass(frozen=True)
class FakeSolution:
    model: Model
    t: np.ndarray
    y: np.ndarray
    states: object
    outputs: dict
    events: tuple
    modes: dict
    integrator: str = "fake"
    success: bool = True
    status: str = "finished"
    message: str = ""
    warnings: tuple = ()
    stats: dict = field(
        default_factory=lambda: {"steps": 10, "rejected": 0, "rhs_evaluations": 40, "guard_evaluations": 20}
    )

    @property
    def _trajectory(self) -> SimpleNamespace:
        return SimpleNamespace(own_times=self.t)

    @property
    def components(self) -> tuple:
        return self.model.all_components()

    @property
    def t_start(self) -> float:
        return float(self.t[0])

    @property
    def t_end(self) -> float:
        return float(self.t[-1])

    def __call__(self, t, side="+"):
        return self.states(np.asarray(t, dtype=float), side)

    def output(self, name, t, side="+"):
        if name not in self.outputs:
            raise UsageError(f"no quantity {name!r}")
        return self.outputs[name](np.asarray(t, dtype=float), side)


def oscillator_model(**changes: float | str) -> Model:
    law = FrictionLaw("coulomb", slip="mu_k*N", stick="mu*N", parameters={"mu": None, "mu_k": "mu"})
    values = {"m": 0.2, "c": 5.65, "k": 1e5, "mu": 0.5, "N": 40, "F0": 30, "omega": "0.6*sqrt(k/m)"}
    return Model(
        "oscillator",
        states=[
            State("x", 0, "v", unit="m", nominal=1e-4),
            State("v", 0, "(F0*sin(omega*t) - c*v - k*x - f)/m", unit="m/s", nominal=0.1),
        ],
        parameters={**values, **changes},
        contacts=[Contact("f", "v", "N", law, {"mu": "mu"})],
        outputs=[Output("f", "f", unit="N")],
        title="Dry friction oscillator",
    )


def oscillator(periods: float = 100, error: float = 0.0, model: Model | None = None) -> FakeSolution:
    """The exact run of the oscillator; with an `error` its events come late and its states are scaled."""
    model = oscillator_model() if model is None else model
    values = model.parameter_values()
    system = recognise(model).system
    t_end = periods * 2 * math.pi / values["omega"]
    start = model.start_values()
    motion = system.motion(start["x"], start["v"], (0.0, t_end))
    shift = error * t_end / periods
    changes = motion.changes
    times = np.array([change.t for change in changes]) + shift
    names = [motion.first_mode, *(change.target for change in changes)]
    edges = [0.0, *times, t_end]
    intervals = tuple(FakeInterval(*row) for row in zip(names, edges[:-1], edges[1:]))

    def states(t, side):
        return motion(np.maximum(t - shift, 0.0)) * (1 + error)

    def friction(t, side):
        index = np.searchsorted(times, t, side="right" if side == "+" else "left")
        forces = {"slip+": system.slip_force, "slip-": -system.slip_force}
        x = states(t, side)[0]
        push = values["F0"] * np.sin(values["omega"] * t) - values["k"] * x
        return np.where(
            np.array(names)[index] == "stick", push, np.array([forces.get(n, 0.0) for n in names])[index]
        )

    grid = np.unique(np.concatenate([np.linspace(0, t_end, 50), times]))
    events = tuple(FakeEvent(t, "f", c.source, c.target) for t, c in zip(times, changes))
    return FakeSolution(model, grid, states(grid, "+"), states, {"f": friction}, events, {"f": intervals})


def ball_model() -> Model:
    bounce = Choice("flight", "-w > v_rest", {"h": "0", "w": "-e*w"})
    rest = Choice("rest", None, {"h": "0", "w": "0"})
    modes = [Mode("flight", [Guard("floor", "h", [bounce, rest])]), Mode("rest", der={"h": "0", "w": "0"})]
    return Model(
        "ball",
        states=[State("h", 1, "w", unit="m"), State("w", 0, "-g", unit="m/s")],
        parameters={"g": 9.81, "e": 0.8, "v_rest": 0.5},
        components=[Component("mode", modes, initial="flight")],
        title="Bouncing ball",
    )


def ball(restitution: float = 0.8, t_end: float = 4.5) -> FakeSolution:
    """The bouncing ball from rest at height 1, in closed form; it stays down after its last bounce."""
    g = 9.81
    t, speed = math.sqrt(2 / g), math.sqrt(2 * g)
    starts, speeds, events = [-t], [speed], []  # flights begin at the floor
    while t < t_end:
        up = restitution * speed
        before, after = ("flight", "flight") if speed > 0.5 else ("flight", "rest")
        events.append(FakeEvent(t, "mode", before, after, "floor", x_minus=(0.0, -speed), x_plus=(0.0, up)))
        if after == "rest":
            break
        starts.append(t)
        speeds.append(up)
        t, speed = t + 2 * up / g, up
    end = events[-1].t if events[-1].target == "rest" else np.inf
    starts_, speeds_ = np.array(starts), np.array(speeds)

    def states(t, side):
        index = np.searchsorted(starts_, t, side="right" if side == "+" else "left") - 1
        s = t - starts_[index]
        down = (t > end) | ((t == end) & (side == "+"))
        h, w = speeds_[index] * s - g * s * s / 2, speeds_[index] - g * s
        return np.array([np.where(down, 0.0, h), np.where(down, 0.0, w)])

    grid = np.linspace(0, t_end, 50)
    stop = min(end, t_end)
    modes = (
        FakeInterval("flight", 0.0, stop),
        *([FakeInterval("rest", stop, t_end)] if stop < t_end else []),
    )
    return FakeSolution(ball_model(), grid, states(grid, "+"), states, {}, tuple(events), {"mode": modes})
