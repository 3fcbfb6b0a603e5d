"""Wall times that can be compared: repetitions in turns over all runs, so that a slow spell hits them all."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence


def timed_in_turns(
    runs: Sequence[Callable[[], object]], repeat: int, progress: Callable[[int], None] | None = None
) -> list[tuple[float, ...]]:
    """Seconds of each of `repeat` calls of each run, round by round; they have been warmed up before.

    The collection of garbage is left out, as `timeit` does: it strikes whom it happens to strike.
    """
    times: list[list[float]] = [[] for _ in runs]
    collecting = gc.isenabled()
    try:
        for _ in range(repeat):
            for i, run in enumerate(runs):
                gc.collect()
                gc.disable()
                start = time.perf_counter()
                run()
                times[i].append(time.perf_counter() - start)
                if progress is not None:
                    progress(i)
    finally:
        if collecting:
            gc.enable()
    return [tuple(spent) for spent in times]
