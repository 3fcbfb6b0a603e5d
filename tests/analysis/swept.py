"""Measures that other processes can import."""

from __future__ import annotations

import math

import hybridsim as hs

SPAN = (0.0, 0.03)


def end(model: hs.Model) -> dict[str, object]:
    """Where a short run ends, and how many events it has; fails above F0 = 39, and has no number at 38."""
    load = model.parameter_values()["F0"]
    if load > 39:
        raise RuntimeError("too heavy\nfor this")
    run = hs.simulate(model, SPAN, keep="events")
    x, v = run.y[:, -1]
    return {"x": math.nan if load == 38 else x, "state": [x, v], "events": len(run.events)}


def longer(model: hs.Model, previous: float | None) -> float:
    """Depends on all points before it in its chain, and on their order."""
    load = model.parameter_values()["F0"]
    if load < 0:
        raise RuntimeError("negative")
    return math.sin(load) + (0.0 if previous is None else 0.5 * previous)


def fall(t: float, x: object, p: object) -> tuple[float, float]:
    return x[1], -p.g


def height(model: hs.Model) -> float:
    return hs.simulate(model, (0.0, 0.5)).y[0, -1]


def note(what: object) -> None:
    """A place for what a test wants to be told."""
