"""Simpler models written out by hand, and plain settled runs of them: brute force for what `advise` says."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

import hybridsim as hs

ORDER = (
    "at-rest", "no-friction", "viscous", "no-stop", "constant-mu-at-rest", "constant-mu-mean", "mu_s=mu_k", "tanh",
    "arctan", "karnopp",
)  # fmt: skip
_SAMPLES = 40001


def top(values: np.ndarray) -> float:
    """Largest value of a curve through samples: that of the parabola through the top three."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    left, middle, right = values[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    return float(middle - (right - left) ** 2 / (8.0 * bend)) if bend < 0.0 else float(middle)


def smooth(model: hs.Model, force: str, **parameters: float) -> hs.Model:
    """A model of one contact f with an expression written in place of f."""
    everything = {**model.parameter_values(), **parameters}
    states = [hs.State(s.name, s.start, s.der.text.replace(" f)", f" ({force}))")) for s in model.states]
    return hs.Model(f"{model.name}-by-hand", states, everything, inputs=model.inputs)


def last(model: hs.Model, name: str, span: float, kept: float) -> np.ndarray:
    """Samples of a quantity over the end of a long run by `dop853`."""
    run = hs.simulate(model, (0.0, span), integrator="dop853", rtol=1e-10, keep=kept)
    return np.asarray(run.output(name, np.linspace(run.t_start, run.t_end, _SAMPLES)))


def amplitude(model: hs.Model, name: str, span: float, kept: float) -> float:
    """(max - min)/2 at the end of a long run."""
    x = last(model, name, span, kept)
    return 0.5 * (top(x) + top(-x))


def equivalent_damper(
    first: Callable[[float], float], force: float, m: float, c: float, k: float, w: float
) -> float | None:
    """c_eq of an oscillator (c > 0) under a sine, by halving; first(V): the first harmonic of friction at V cos."""

    def velocity(extra: float) -> float:
        return w * force / math.hypot(k - m * w * w, (c + extra) * w)

    def is_too_small(extra: float) -> bool:
        return first(velocity(extra)) > extra * velocity(extra)

    low = high = 1e-3 * c
    while is_too_small(high):  # from small dampers up: of several solutions that of the largest motion
        low, high = high, 1.5 * high
        if high > 1e12:
            return None
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_too_small(middle) else (low, middle)
    return 0.5 * (low + high)


def first_harmonic(slip: Callable[[np.ndarray], np.ndarray]) -> Callable[[float], float]:
    """Of a force slip(|v|) sign(v) while v is a cosine: the mean over equal steps, spectrally accurate."""
    angles = (np.arange(2000) + 0.5) * (0.5 * math.pi / 2000)
    return lambda V: float(2.0 * np.mean(slip(V * np.cos(angles)) * np.cos(angles)))


def simplest(errors: dict[str, float], tol: float) -> str:
    """The first rung within the tolerance."""
    return next((name for name in ORDER if errors.get(name, math.inf) <= tol), "full model")
