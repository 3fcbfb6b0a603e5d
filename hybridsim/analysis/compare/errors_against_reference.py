"""This module measures the errors of a run in states, event times and modes against a reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybridsim.analysis.compare.graph_distance import CompletedGraph, graph_distance
from hybridsim.analysis.compare.mode_sequence import MatchedEvents, SequenceVerdict, match_events
from hybridsim.analysis.compare.resets import Resets
from hybridsim.reference.trajectory import Trajectory

# A prime number, so that the samples fall at all phases of the steps of a fixed-step method, also between its
# steps.
SAMPLES_PER_PERIOD = 211
# For a run without a period, and the largest number: enough to resolve every swing, few enough to repeat
# often.
SAMPLES, MOST_SAMPLES = 20_011, 200_003


@dataclass(frozen=True)
class Errors:
    """The errors of one run.

    Parameters
    ----------
    state : largest error of a state over the run, relative to that state's amplitude in the reference.
    state_last_period : the same over the last period; None without a period.
    event_time : largest time error of an event that both runs have; None if there is none.
    sequence : the difference of the mode sequences; None for a run without modes, as of a regularised law.
    graph : distance of the completed graphs (`hybridsim.analysis.compare.graph_distance`), in periods (without a
    period, in
        spans) and amplitudes; None if no state jumps.
    """

    state: float
    state_last_period: float | None
    event_time: float | None
    sequence: SequenceVerdict | None
    graph: float | None = None

    @property
    def wrong_modes(self) -> bool:
        """Whether the run has modes and their sequence is wrong."""
        return self.sequence is not None and not self.sequence.right


class Yardstick:
    """A reference that is sampled once and then compared with any number of runs.

    Parameters
    ----------
    trajectory : the reference.
    resets : the events at which the states jump.
    nominal : (n,) size of each state, for states that do not move in the reference.
    period : for the error over the last period, or None.

    Near a jump, a run that jumps slightly earlier or later would be wrong by the whole jump for a short time.
    So a point between two jumps of the reference is compared at the nearest time between the same two jumps of
    the run. Without jumps, states are compared at equal times.
    """

    def __init__(
        self, trajectory: Trajectory, resets: Resets, nominal: Sequence[float], period: float | None
    ) -> None:
        self.trajectory, self.resets, self.period = trajectory, resets, period
        t0, t1 = trajectory.t_span
        count = SAMPLES if not period else min(MOST_SAMPLES, round(SAMPLES_PER_PERIOD * (t1 - t0) / period))
        events = np.array([event.t for event in trajectory.events])
        after = np.concatenate([np.linspace(t0, t1, max(count, 2)), events])
        times = np.concatenate([events, after])
        before = np.arange(len(times)) < len(events)
        order = np.argsort(times, kind="stable")
        self.times, self.before = times[order], before[order]
        self.states = _states(trajectory, self.times, self.before)
        amplitude = (self.states.max(axis=1) - self.states.min(axis=1)) / 2
        self.amplitude = np.where(amplitude > 0, amplitude, nominal)
        self.graph = self._graph(trajectory) if any(event in resets for event in trajectory.events) else None

    def _graph(self, trajectory: Trajectory) -> CompletedGraph:
        t0, t1 = self.trajectory.t_span
        jumps = [event.t for event in trajectory.events if event in self.resets]
        return CompletedGraph(trajectory, jumps, self.period or t1 - t0, self.amplitude)

    def measure(self, run: Trajectory) -> Errors:
        """Return the errors of a run up to its end or the end of the reference, whichever is earlier."""
        matched = match_events(self.trajectory, run)
        end = min(self.trajectory.t_span[1], run.t_span[1])
        shared = self.times <= end
        times, before = self._matched_times(matched, run.t_span)
        states = _states(run, times[shared], before[shared])
        error = np.max(np.abs(states - self.states[:, shared]) / self.amplitude[:, None], axis=0)
        last = None
        if self.period:
            last = float(np.max(error[self.times[shared] >= end - self.period]))
        mismatches = [abs(a.t - b.t) for a, b in matched.pairs if a.kind != "scheduled"]
        graph = graph_distance(self.graph, self._graph(run)) if self.graph else None
        return Errors(float(np.max(error)), last, max(mismatches, default=None), matched.verdict, graph)

    def _matched_times(
        self, matched: MatchedEvents, t_span: tuple[float, float]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the times at which the run is evaluated, and a mask of the times just before an event."""
        jumps = [(a.t, b.t) for a, b in matched.pairs if a in self.resets]
        if not jumps:
            return self.times, self.before
        ours, theirs = np.array(jumps).T
        passed = np.where(
            self.before, np.searchsorted(ours, self.times), np.searchsorted(ours, self.times, side="right")
        )
        bounds = np.concatenate([[t_span[0]], np.maximum.accumulate(theirs), [t_span[1]]])
        low, high = bounds[passed], bounds[passed + 1]
        times = np.clip(self.times, low, high)
        reached_next = (times >= high) & (passed < len(ours))
        just_jumped = (times <= low) & (passed > 0)
        return times, (self.before | reached_next) & ~just_jumped


def _states(
    trajectory: Trajectory, times: NDArray[np.float64], before: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the states (n, k) at given times, just before or just after events."""
    after = trajectory.states(times[~before], "+")
    states = np.empty((len(after), len(times)))
    states[:, ~before] = after
    if before.any():
        states[:, before] = trajectory.states(times[before], "-")
    return states
