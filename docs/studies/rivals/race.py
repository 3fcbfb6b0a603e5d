"""Times all methods of a scene in turns, after each has run once and has been held against the exact motion."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any

from rivals.method import Method
from rivals.scenes import Scene
from rivals.truth import Errors, Truth

_TURN, _MOST_CALLS = 0.01, 10  # a short run has several calls in its turn: as many as fill this time
_ENOUGH = 1.0  # seconds that a run has in all; slow ones have fewer turns
_LEAST = 2  # turns that even the slowest has


@dataclass
class Times:
    """Seconds that the first call took on the clock; seconds of the later ones, in processor time unless it is of a
    method with threads of its own, of the same on the clock, and inside a compiled loop, where it is known."""

    first: float = 0.0
    has_threads: bool = False
    calls: list[float] = field(default_factory=list)
    clock: list[float] = field(default_factory=list)
    inside: list[float] = field(default_factory=list)

    @property
    def middle(self) -> float:
        """The median."""
        return median(self.calls)

    @property
    def least(self) -> float:
        """The fastest."""
        return min(self.calls)

    @property
    def building(self) -> float:
        """What the first call took beyond the others."""
        return max(self.first - median(self.clock), 0.0)


# Where its times go, the run, and what tells of its outcome the seconds in a compiled loop.
Running = tuple[Times, Callable[[], Any], Callable[[Any], float] | None]


@dataclass
class Line:
    """A method on a scene: its times with events alone and with the grid, and its errors."""

    method: Method
    errors: Errors
    events: Times | None
    grid: Times


def race(
    scene: Scene, exact: Truth, methods: Iterable[Method], turns: int, say: Callable[[str], None]
) -> list[Line]:
    """The lines of a scene."""
    lines: list[Line] = []
    running: list[Running] = []
    for method in methods:
        began = time.perf_counter()
        runs = method.start(scene)
        if runs is None:
            continue
        outcome = runs.grid()
        first = Times(time.perf_counter() - began, method.has_threads)
        errors = exact.errors(scene, runs.read(outcome), method.has_modes)
        say(f"  {method.label}: first call {first.first:.3g} s, {described(errors)}")
        events = Times(has_threads=method.has_threads) if runs.events is not None else None
        lines.append(Line(method, errors, events, first))
        if runs.events is not None and events is not None:
            alone = exact.errors(scene, runs.read(runs.events()), method.has_modes)
            # states are of the run with the grid, events of that without
            if errors.right and not alone.right:
                say(f"  {method.label}: with events alone {described(alone)}")
            lines[-1].errors = replace(alone, states=errors.states)
            running.append((events, runs.events, runs.parts))
        running.append((first, runs.grid, runs.parts))
    take_turns(running, turns)
    return lines


def take_turns(running: Sequence[Running], turns: int) -> None:
    """Call each run again and again, in turns over all of them."""
    gc.collect()
    gc.freeze()
    try:
        for turn in range(turns):
            for times, call, parts in running:
                if turn >= _LEAST and sum(times.calls) > _ENOUGH:
                    continue
                gc.collect()
                gc.disable()
                spent = 0.0
                for _ in range(_MOST_CALLS):
                    clock, began = time.perf_counter(), time.process_time()
                    outcome = call()
                    taken = time.process_time() - began
                    times.clock.append(time.perf_counter() - clock)
                    times.calls.append(times.clock[-1] if times.has_threads else taken)
                    if parts is not None:
                        times.inside.append(parts(outcome))
                    spent += times.calls[-1]
                    if spent > _TURN:
                        break
    finally:
        gc.enable()
        gc.unfreeze()


def described(errors: Errors) -> str:
    """Errors in words."""
    if errors.right is None:
        return f"states {errors.states:.1e}, no modes"
    if not errors.right:
        wrong = f"{errors.missing:+d} events missing" if errors.missing else "other modes"
        return f"states {errors.states:.1e}, WRONG: {wrong}"
    return f"states {errors.states:.1e}, times {errors.times:.1e} T"
