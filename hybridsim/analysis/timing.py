"""Wall times that can be compared: repetitions in turns over all runs, so that a slow spell hits them all."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence

# A run that has been timed for this long in all is not repeated: it has averaged over the machine's moods itself.
ENOUGH = 2.0
# A run that is shorter than this has several calls in each of its turns, as many as fill the time but at most five.
_TURN, _MOST_CALLS = 0.05, 5
_LONG = 0.5  # a run whose first call took longer is not called once more before it is timed
_MOST_BEFORE = (
    30  # calls of a short run that are not timed: what it takes again and again is compiled in one of them
)


def timed_in_turns(
    runs: Sequence[Callable[[], object]],
    repeat: int,
    progress: Callable[[int], None] | None = None,
    expected: Sequence[float] | None = None,
    until: float = math.inf,
) -> list[tuple[float, ...]]:
    """Seconds of each call of each run, round by round: a call in each of `repeat` rounds, fewer of long runs.

    The runs have been called once before; short ones are called for a while more before the first round. The collection
    of garbage is left out, as `timeit` does: it strikes whom it happens to strike. What is alive at the start is left
    alone, so that the collections in between cost little.

    Parameters
    ----------
    progress : called with the index of a run before it has its turn, also where the turn is passed over.
    expected : seconds that each run is likely to take; with it, a short run has several calls in its turn, and a
        round that would not be over in time is shortened by its longest runs.
    until : time of `time.monotonic` at which all has to be over.
    """
    times: list[list[float]] = [[] for _ in runs]
    likely = [0.0] * len(runs) if expected is None else list(expected)
    collecting = gc.isenabled()
    gc.collect()
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
        gc.unfreeze()
        if collecting:
            gc.enable()
    return [tuple(spent) for spent in times]


def _warmed_up(run: Callable[[], object], expected: float, until: float) -> float:
    """Seconds that a call is likely to take, once what is done only in the first ones is over."""
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
    """Indices of as many runs, cheapest first, as fit in the seconds that are left."""
    chosen, left = [], seconds
    for i in sorted(range(len(expected)), key=lambda i: expected[i]):
        if expected[i] > left:
            break
        left -= expected[i]
        chosen.append(i)
    return chosen
