"""Checks of a solution beyond events and states: exactness bit for bit, amplitudes, how a run ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybridsim.testing.scene import Check


def at_times(times: Sequence[float]) -> str:
    """Times in words; of many the first three."""
    if not times:
        return "never"
    shown = [repr(float(t)) for t in times[:3]]
    if len(times) > len(shown):
        shown.append(f"{len(times) - len(shown)} later times")
    return "at t = " + (", ".join(shown[:-1]) + " and " if len(shown) > 1 else "") + shown[-1]


def exact_stick(component: str, held: Mapping[str, float], rest: tuple[str, ...] = ()) -> Check:
    """In stick the held states have their value bit for bit; those in `rest` do not move by a bit either."""

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
    """(max - min)/2 of a state over [t0, t1], whose extremes are at events or at the ends."""

    def quantity(solution: Any) -> float:
        row = [state.name for state in solution.model.states].index(name)
        times = [t0, t1, *(event.t for event in solution.events if t0 <= event.t <= t1)]
        values = [float(solution(t)[row]) for t in times]
        return (max(values) - min(values)) / 2

    return quantity


def no_transition(solution: Any) -> list[str]:
    """No mode changed at all."""
    changes = [event.t for event in solution.events if event.kind == "transition"]
    return [f"a mode changes {at_times(changes)}, where nothing happens"] if changes else []


def equals(t: float, **values: float) -> Check:
    """Quantities that have a value bit for bit at t, just after any event there."""

    def check(solution: Any) -> list[str]:
        found = {name: float(solution.output(name, t)) for name in values}
        return [
            f"{n} is {found[n]!r} at t = {t!r} instead of {v!r}" for n, v in values.items() if found[n] != v
        ]

    return check


def says(*words: str) -> Check:
    """The message of a run that stopped names these."""

    def check(solution: Any) -> list[str]:
        return [
            f"the message does not say {word!r}: {solution.message}"
            for word in words
            if word not in solution.message
        ]

    return check
