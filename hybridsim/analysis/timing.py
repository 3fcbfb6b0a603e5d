"""Wall times that can be compared: repetitions in turns over all runs, so that a slow spell hits them all."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence

# A run that has been timed for this long in all is not repeated: it has averaged over the machine's moods itself.
ENOUGH = 2.0


def timed_in_turns(
    runs: Sequence[Callable[[], object]], repeat: int, progress: Callable[[int], None] | None = None
) -> list[tuple[float, ...]]:
    """Seconds of each call of each run, round by round: `repeat` calls, fewer of those that take long.

    The runs have been warmed up before. The collection of garbage is left out, as `timeit` does: it strikes whom
    it happens to strike.

    Parameters
    ----------
    progress : called with the index of a run before it has its turn, also where the turn is passed over.
    """
    times: list[list[float]] = [[] for _ in runs]
    collecting = gc.isenabled()
    try:
        for _ in range(repeat):
            for i, run in enumerate(runs):
                if progress is not None:
                    progress(i)
                if sum(times[i]) >= ENOUGH:
                    continue
                gc.collect()
                gc.disable()
                start = time.perf_counter()
                run()
                times[i].append(time.perf_counter() - start)
    finally:
        if collecting:
            gc.enable()
    return [tuple(spent) for spent in times]
