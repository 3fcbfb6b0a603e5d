"""How far a run is from a reference: in its states, in the times of its events and in its modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybridsim.analysis.graph_distance import CompletedGraph, graph_distance
from hybridsim.analysis.mode_sequence import MatchedEvents, SequenceVerdict, match_events
from hybridsim.analysis.resets import Resets
from hybridsim.analysis.trajectory import Trajectory

# Prime, so that the points fall at all phases of the steps of a method whose step is a round part of a
# period: what is between the steps is to be seen too.
SAMPLES_PER_PERIOD = 211
# A run without a period, and the longest: enough to see every swing, few enough to be asked for many times.
SAMPLES, MOST_SAMPLES = 20_011, 200_003


@dataclass(frozen=True)
class Errors:
    """Errors of a run.

    Parameters
    ----------
    state : largest error of a state over the run, relative to that state's amplitude in the reference.
    state_last_period : the same over the last period; None without a period.
    event_time : largest error in time of an event that both have; None if there is none.
    sequence : how the sequence of modes differs; None for a run that has no modes, as of a regularised law.
    graph : distance of the completed graphs (`hybridsim.analysis.graph_distance`), in periods (without a period, in
        spans) and amplitudes; None where no state jumps.
    """

    state: float
    state_last_period: float | None
    event_time: float | None
    sequence: SequenceVerdict | None
    graph: float | None = None

    @property
    def wrong_modes(self) -> bool:
        """Whether there are modes, and not the right ones."""
        return self.sequence is not None and not self.sequence.right


class Yardstick:
    """A reference sampled once, against which any number of runs are measured.

    Parameters
    ----------
    trajectory : the reference.
    resets : which events make the states jump.
    nominal : (n,) size of each state, for those that do not move in the reference.
    period : for the error over the last period, or None.

    Around an event at which the states jump, a run that jumps a little earlier or later would be off by the
    whole jump for that little while. So a point between two jumps of the reference is compared at the nearest
    time between the same two jumps of the run; without jumps, times are compared as they are.
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
        """Errors of a run from the same start, up to the end of the shorter of the two."""
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
        """Where to look at the run: the time, and whether the state just before an event there is meant."""
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
    """States at times, just before or just after what happens there; (n, k)."""
    after = trajectory.states(times[~before], "+")
    states = np.empty((len(after), len(times)))
    states[:, ~before] = after
    if before.any():
        states[:, before] = trajectory.states(times[before], "-")
    return states
