"""This module counts the runs of a fit, limits the runs from further guesses, and reports a long fit on stderr."""

from __future__ import annotations

import math
import sys

from hybridsim.analysis.time_budget import Stopwatch

_NOTICED = 20.0  # seconds after which a fit reports itself
_UNLIMITED = 20.0  # seconds that further first guesses may always take
_RATIO = 2  # of the runs of the first guess, which further first guesses may always take


class Effort:
    """Counts the runs of a fit, and measures its time without the time for compiling.

    Parameters
    ----------
    reports : whether a long fit prints one line.
    """

    def __init__(self, reports: bool) -> None:
        self.runs = 0
        self._reports, self._watch = reports, Stopwatch()

    def add_run(self) -> None:
        """Count a run, and print one line if the fit has lasted long."""
        self.runs += 1
        if self._reports and (seconds := self._watch.seconds) > _NOTICED:
            self._reports = False
            text = f"fitting: {self.runs} runs so far, {seconds / self.runs:.3g} s each (progress=True shows a bar)"
            print(f"hybridsim: {text}", file=sys.stderr, flush=True)

    def affordable_runs(self) -> int:
        """Return how many runs may be used for further guesses.

        They may take twice as many as the first guess, and more if all of them last less than 20 s.
        """
        per_run = self._watch.seconds / max(self.runs, 1)
        return max(_RATIO * self.runs, math.ceil(_UNLIMITED / max(per_run, 1e-6)))
