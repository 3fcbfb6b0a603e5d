"""Checks of a solution beyond events and states: exact values, amplitudes, end of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybridsim.testing.scene import Check


def at_times(times: Sequence[float]) -> str:
    """Return times as text; a long list shows only the first three times."""
    if not times:
        return "never"
    shown = [repr(float(t)) for t in times[:3]]
    if len(times) > len(shown):
        shown.append(f"{len(times) - len(shown)} later times")
    return "at t = " + (", ".join(shown[:-1]) + " and " if len(shown) > 1 else "") + shown[-1]


def exact_stick(component: str, held: Mapping[str, float], rest: tuple[str, ...] = ()) -> Check:
    """Return a check of a solution: held states are exact in stick, and the states in `rest` are constant."""

    def check(solution: Any) -> list[str]:
        names = [state.name for state in solution.model.states]
        for interval in solution.modes[component]:
            if interval.mode != "stick":
                continue
            times = np.linspace(interval.t0, interval.t1, 9)[1:-1]
            values = solution(times)
            for name, value in held.items():
                row = values[names.index(name)]
                if not (row == value).all():
                    worst = row[np.argmax(np.abs(row - value))]
                    return [
                        f"in the stick that begins at t = {interval.t0!r}, "
                        f"{name} is {float(worst)!r} instead of {value!r}"
                    ]
            for name in rest:
                row = values[names.index(name)]
                if not (row == row[0]).all():
                    return [
                        f"in the stick that begins at t = {interval.t0!r}, {name} moves by {float(np.ptp(row))!r}"
                    ]
        return []

    return check


def amplitude(name: str, t0: float, t1: float) -> Callable[[Any], float]:
    """Return a function that computes (max - min)/2 on [t0, t1] from the values at the events and at both ends."""

    def quantity(solution: Any) -> float:
        row = [state.name for state in solution.model.states].index(name)
        times = [t0, t1, *(event.t for event in solution.events if t0 <= event.t <= t1)]
        values = [float(solution(t)[row]) for t in times]
        return (max(values) - min(values)) / 2

    return quantity


def no_transition(solution: Any) -> list[str]:
    """Check that no mode changes."""
    changes = [event.t for event in solution.events if event.kind == "transition"]
    return [f"a mode changes {at_times(changes)}, where nothing happens"] if changes else []


def equals(t: float, **values: float) -> Check:
    """Return a check of a solution: quantities have given values at a time, just after the events at this time."""

    def check(solution: Any) -> list[str]:
        found = {name: float(solution.output(name, t)) for name in values}
        return [
            f"{n} is {found[n]!r} at t = {t!r} instead of {v!r}" for n, v in values.items() if found[n] != v
        ]

    return check


def says(*texts: str) -> Check:
    """Return a check of a solution: the message of the stopped run contains given words."""

    def check(solution: Any) -> list[str]:
        return [
            f"the message does not say {text!r}: {solution.message}"
            for text in texts
            if text not in solution.message
        ]

    return check
