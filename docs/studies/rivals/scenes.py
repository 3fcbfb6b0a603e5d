"""The scenes of the study of speed: each as a model for hybridsim and as equations for its rivals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hybridsim as hs
from rivals.physics import Friction, Impact, Oscillator

PERIODS = 100
POINTS = 2000
_HERE = Path(__file__).parent / "models"


@dataclass(frozen=True)
class Scene:
    """A scene.

    Parameters
    ----------
    name, title : for tables and charts.
    model : for hybridsim.
    end, period : length of the run from t = 0, and what times of events are relative to.
    physics : for the rivals.
    oscillator : its numbers, where it is the oscillator that has a closed form.
    velocity : size of a velocity, for those that need a small one.
    """

    name: str
    title: str
    model: hs.Model
    end: float
    period: float
    physics: Friction | Impact
    oscillator: Oscillator | None = None
    velocity: float = 1.0

    @property
    def grid(self) -> np.ndarray:
        """The times at which all methods give their states."""
        return np.linspace(0.0, self.end, POINTS)

    @property
    def last(self) -> np.ndarray:
        """Which of them lie in the last period."""
        return self.grid >= self.end - self.period


def _oscillator(name: str, title: str, F0: float, ratio: float) -> Scene:
    model = hs.load("dfcs").with_(F0=F0, N=40, omega=f"{ratio}*sqrt(k/m)")
    p = model.parameter_values()
    m, c, k, w, limit = p["m"], p["c"], p["k"], p["omega"], p["mu"] * p["N"]
    period = 2 * math.pi / w
    physics = Friction((0.0, 0.0), (m,), (0.0,), (limit,), _one_mass(F0, w, c, k))
    numbers = Oscillator(m, c, k, limit, F0, w)
    return Scene(name, title, model, PERIODS * period, period, physics, numbers, F0 / k * w)


def _one_mass(F0: float, w: float, c: float, k: float) -> Callable[[Any], Any]:
    def push(m: Any) -> Any:
        return lambda t, x: (F0 * m.sin(w * t) - c * x[1] - k * x[0],)

    return push


def _two_masses() -> Scene:
    model = hs.load(str(_HERE / "two-masses.toml"))
    p = model.parameter_values()
    c, k, kc, F0, w = (p[name] for name in ("c", "k", "kc", "F0", "omega"))

    def push(m: Any) -> Any:
        return lambda t, x: (
            F0 * m.sin(w * t) - c * x[1] - k * x[0] - kc * (x[0] - x[2]),
            -c * x[3] - k * x[2] - kc * (x[2] - x[0]),
        )

    period = 2 * math.pi / w
    physics = Friction((0.0,) * 4, (1.0, 1.0), (0.0, 0.0), (p["L1"], p["L2"]), push)
    return Scene("two-masses", "4 states, two contacts, linear", model, PERIODS * period, period, physics)


def _belt() -> Scene:
    model = hs.load("belt")
    p = model.parameter_values()
    m, k, Fs, delta, speed = (p[name] for name in ("m", "k", "Fs", "delta", "v_belt"))

    def push(_: Any) -> Any:
        return lambda t, x: (-k * x[0],)

    def slip(_: Any) -> Any:
        return lambda speeds: (Fs / (1.0 + delta * speeds[0]),)

    physics = Friction((0.0, 0.0), (m,), (speed,), (Fs,), push, slip)
    return Scene("belt", "belt, 200 units of time", model, 200.0, 12.0010, physics)


def _stribeck() -> Scene:
    model = hs.load("dfcs-stribeck")
    p = model.parameter_values()
    m, c, k, N, F0, w = (p[name] for name in ("m", "c", "k", "N", "F0", "omega"))
    mu_s, mu_k, v_s = p["mu_s"], p["mu_k"], p["v_s"]

    def slip(module: Any) -> Any:
        return lambda speeds: (
            N * (mu_k + (mu_s - mu_k) * module.exp(-(speeds[0] / v_s) * (speeds[0] / v_s))),
        )

    period = 2 * math.pi / w
    physics = Friction((0.0, 0.0), (m,), (0.0,), (mu_s * N,), _one_mass(F0, w, c, k), slip)
    return Scene("stribeck", "dfcs-stribeck", model, PERIODS * period, period, physics, velocity=F0 / k * w)


def _impact() -> Scene:
    model = hs.load(str(_HERE / "impact-oscillator.toml"))
    p = model.parameter_values()
    zeta, F0, w = p["zeta"], p["F0"], p["omega"]

    def acceleration(m: Any) -> Any:
        return lambda t, x: F0 * m.sin(w * t) - 2.0 * zeta * x[1] - x[0]

    period = 2 * math.pi / w
    physics = Impact((0.0, 0.0), acceleration, p["wall"], p["r"])
    return Scene("impact", "impact oscillator", model, PERIODS * period, period, physics)


_MAKERS: dict[str, Callable[[], Scene]] = {
    "P1": lambda: _oscillator("P1", "P1: F0 = 30 N, 0.6 of resonance", 30, 0.6),
    "P2": lambda: _oscillator("P2", "P2: F0 = 22 N, 0.64 of resonance", 22, 0.64),
    "no-stop": lambda: _oscillator("no-stop", "no stop: F0 = 60 N, 1.4 of resonance", 60, 1.4),
    "grazing": lambda: _oscillator("grazing", "near grazing: F0 = 62.035 N, 0.2 of resonance", 62.035, 0.2),
    "two-masses": _two_masses,
    "belt": _belt,
    "stribeck": _stribeck,
    "impact": _impact,
}
NAMES = tuple(_MAKERS)


def scene(name: str) -> Scene:
    """The scene of a name."""
    return _MAKERS[name]()
