"""This module measures a batch of points in compiled code, and measures one by one the points that fail there."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hybridsim.analysis.sweep.parameters import Setter
from hybridsim.analysis.sweep.readings import Reading, not_numbers
from hybridsim.analysis.sweep.work.job import DONE, Job, Outcome, Settings, Together, Watch


class PointsTogether:
    """The points of a batch.

    Parameters
    ----------
    job, points : the sweep, and the values of its names at each point.
    alone : measures one point without the others.
    watch : the link to the sweep.

    Attributes
    ----------
    parameters, starts : parameters (m, P) and initial states (m, n) of the points that have numbers for them.
    """

    def __init__(
        self, job: Job, points: Sequence[Settings], alone: Callable[[Settings], Outcome], watch: Watch
    ) -> None:
        self._points, self._alone, self._watch = points, alone, watch
        parameters, starts, self._sound = Setter(job.model, job.names, job.at).values(points)
        self.parameters, self.starts = parameters[self._sound], starts[self._sound]
        self._outcomes: list[Outcome | None] = [None] * len(points)

    def put(
        self,
        numbers: np.ndarray,
        readings: Sequence[dict[str, Reading]],
        blank: Sequence[tuple[str, ...]] = (),
    ) -> None:
        """Store measured values of some points; NaN is an error, except for values that `blank` names."""
        for k, (number, found) in enumerate(zip(self._sound[numbers].tolist(), readings, strict=True)):
            missing = [name for name in not_numbers(found) if not (blank and name in blank[k])]
            status = f"not a number: {', '.join(missing)}" if missing else DONE
            self._outcomes[number] = Outcome(status, found)
        self._watch.tell(len(readings))

    def finished(self) -> Together:
        """Measure one by one the points that have no outcome yet, and return all outcomes.

        If the watch requests a stop, the outcomes are those of the first points, as far as they were run.
        """
        known: list[Outcome] = []
        alone = 0
        for outcome, settings in zip(self._outcomes, self._points, strict=True):
            if outcome is None:
                if not self._watch.may_continue():
                    break
                outcome = self._alone(settings)
                alone += 1
                self._watch.tell(1)
            known.append(outcome)
        return Together(known, alone)
