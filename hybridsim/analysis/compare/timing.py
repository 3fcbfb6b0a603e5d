"""This module measures wall times of runs in rotation, so that disturbances affect all runs alike."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence

# Seconds; a run timed for this long in total is not repeated, because it already averages over disturbances.
ENOUGH = 2.0
# A shorter run is called several times per turn, to fill this time, but at most five times.
_TURN, _MOST_CALLS = 0.05, 5
_LONG = 0.5  # a run whose first call took longer is not called again before timing
_MOST_BEFORE = 30  # untimed calls of a short run, in which remaining compilation happens


def timed_in_turns(
    runs: Sequence[Callable[[], object]],
    repeat: int,
    progress: Callable[[int], None] | None = None,
    expected: Sequence[float] | None = None,
    until: float = math.inf,
) -> list[tuple[float, ...]]:
    """Return the seconds of each run in each of `repeat` rounds; long runs are repeated less often.

    Each run must have been called once; short ones are called several more times before the first round.
    Garbage collection is off, as in `timeit`, because it would disturb random runs. Objects alive at the
    start are frozen, so that collections between the runs are cheap. If the caller has frozen objects, nothing
    else is frozen, because no function of Python could unfreeze it alone.

    Parameters
    ----------
    progress : called with the index of a run before its turn, even if the turn is skipped.
    expected : likely seconds of each run. With it a short run has several calls per turn, and the longest runs are
        left out of a round that would take too long.
    until : the `time.monotonic` deadline.
    """
    times: list[list[float]] = [[] for _ in runs]
    likely = [0.0] * len(runs) if expected is None else list(expected)
    collecting, freezes = gc.isenabled(), gc.get_freeze_count() == 0
    gc.collect()
    if freezes:
        gc.freeze()
    try:
        if expected is not None:
            likely = [_warmed_up(run, seconds, until) for run, seconds in zip(runs, expected, strict=True)]
        for _ in range(repeat):
            turn = set(_fitting([max(seconds, _TURN) for seconds in likely], until - time.monotonic()))
            if all(sum(times[i]) >= ENOUGH for i in turn):
                break
            for i, run in enumerate(runs):
                if progress is not None:
                    progress(i)
                late = time.monotonic() + likely[i] > until
                if i not in turn or late or sum(times[i]) >= ENOUGH:
                    continue
                calls = 1 if expected is None else min(math.ceil(_TURN / max(likely[i], 1e-9)), _MOST_CALLS)
                gc.collect()
                gc.disable()
                for _ in range(calls):
                    start = time.perf_counter()
                    run()
                    times[i].append(time.perf_counter() - start)
    finally:
        if freezes:
            gc.unfreeze()
        if collecting:
            gc.enable()
    return [tuple(spent) for spent in times]


def _warmed_up(run: Callable[[], object], expected: float, until: float) -> float:
    """Return the expected seconds of a further call, without the one-time work of the first calls."""
    calls, spent, likely = 0, 0.0, expected
    while likely < (_TURN if calls else _LONG) and spent < _TURN and calls < _MOST_BEFORE:
        if time.monotonic() + likely > until:
            break
        start = time.perf_counter()
        run()
        took = time.perf_counter() - start
        calls, spent, likely = calls + 1, spent + took, min(likely, took)
    return likely


def _fitting(expected: Sequence[float], seconds: float) -> list[int]:
    """Return the indices of the runs that fit into the remaining seconds; shorter runs are chosen first."""
    chosen, left = [], seconds
    for i in sorted(range(len(expected)), key=lambda i: expected[i]):
        if expected[i] > left:
            break
        left -= expected[i]
        chosen.append(i)
    return chosen
