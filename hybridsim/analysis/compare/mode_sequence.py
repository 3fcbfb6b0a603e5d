"""This module matches the events of a run with the events of a reference, and compares the two mode sequences."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybridsim.reference.trajectory import EventLike, Trajectory

# Costs of an event that one side lacks, and of a wrong mode: two events matched under a wrong name cost less
# than one missed and one spurious event. The distance in time only decides between equal costs.
_LACKING, _WRONG, _FAR = 1.0, 1.0, 0.5
_MISSED, _MATCHED, _SPURIOUS = 0, 1, 2


@dataclass(frozen=True)
class SequenceVerdict:
    """The numbers of missed, spurious and wrong modes of a run, in comparison with the reference."""

    missed: int = 0
    spurious: int = 0
    wrong: int = 0

    @property
    def right(self) -> bool:
        return not (self.missed or self.spurious or self.wrong)

    def __str__(self) -> str:
        counts = {"missed": self.missed, "spurious": self.spurious, "wrong": self.wrong}
        return ", ".join(f"{n} {what}" for what, n in counts.items() if n) or "right"


@dataclass(frozen=True)
class MatchedEvents:
    """Matched events of a reference and a run, and the verdict on the mode sequence of the run."""

    pairs: tuple[tuple[EventLike, EventLike], ...]
    verdict: SequenceVerdict | None


@dataclass(frozen=True)
class _Entry:
    """One element of a mode sequence: an event with its new mode, or the first mode, which has no event."""

    t: float
    label: str
    event: EventLike | None


def match_events(reference: Trajectory, run: Trajectory) -> MatchedEvents:
    """Match the events of a run with the events of the reference, for each component, monitor and schedule.

    The sequences of different components are matched separately, because the order of independent events may
    differ by rounding. Matched events are at most half of the longest event-free interval apart; beyond that
    they are different events. A component that the run does not have, such as a regularised contact, is not
    compared.
    """
    ours, theirs = _sequences(reference), _sequences(run)
    components = {channel for channel in ours if channel[0] == "transition"}
    absent = components - theirs.keys()
    t0, t1 = reference.t_span[0], min(reference.t_span[1], run.t_span[1])
    pairs: list[tuple[EventLike, EventLike]] = []
    missed: list[float] = []
    spurious: list[float] = []
    wrong = 0
    for channel, expected in ours.items():
        if channel in absent:
            continue
        found = theirs.get(channel, [])
        times = [t0, *(entry.t for entry in expected), reference.t_span[1]]
        window = max(after - before for before, after in itertools.pairwise(times)) / 2
        matched = _align(expected, found, window)
        for i, j in matched:
            first, second = expected[i], found[j]
            if first.label != second.label:
                wrong += 1
            elif first.event is not None and second.event is not None:
                pairs.append((first.event, second.event))
        if channel[0] == "transition":
            missed += _left_over(expected, {i for i, _ in matched})
            spurious += _left_over(found, {j for _, j in matched})
    # Close to the end, an event's error may move it past the end.
    last = t1 - max((abs(a.t - b.t) for a, b in pairs), default=0.0)
    verdict = SequenceVerdict(sum(t < last for t in missed), sum(t < last for t in spurious), wrong)
    judged = None if absent and absent == components else verdict
    return MatchedEvents(tuple(sorted(pairs, key=lambda pair: pair[0].t)), judged)


def _left_over(entries: Sequence[_Entry], matched: set[int]) -> list[float]:
    return [entry.t for i, entry in enumerate(entries) if i not in matched]


def _sequences(trajectory: Trajectory) -> dict[tuple[str, str], list[_Entry]]:
    """Return the modes of each component, and the events of each monitor and schedule, in order of time."""
    t0 = trajectory.t_span[0]
    sequences = {
        ("transition", component): [_Entry(t0, mode, None)]
        for component, mode in trajectory.initial_modes.items()
    }
    for event in trajectory.events:
        if event.kind == "transition":
            sequences.setdefault(("transition", event.component), []).append(
                _Entry(event.t, event.target, event)
            )
        elif event.kind in ("monitor", "scheduled"):
            name = event.component or event.guard
            sequences.setdefault((event.kind, name), []).append(_Entry(event.t, name, event))
    return {
        channel: _without_instants(entries) if channel[0] == "transition" else entries
        for channel, entries in sequences.items()
    }


def _without_instants(entries: Sequence[_Entry]) -> list[_Entry]:
    """Return a sequence of modes without the modes of zero duration."""
    lasting: list[_Entry] = []
    for _, group in itertools.groupby(entries, key=lambda entry: entry.t):
        *passing, last = group
        if not (
            passing and lasting and lasting[-1].label == last.label
        ):  # otherwise the mode returned at once
            lasting.append(last)
    return lasting


def _align(expected: Sequence[_Entry], found: Sequence[_Entry], window: float) -> list[tuple[int, int]]:
    """Return the index pairs of the cheapest alignment, in order; only elements within the time window match.

    This is the edit distance, row by row over the expected entries and, in each row, over the found entries
    within the window only. The work therefore grows linearly with the number of events.
    """
    a, b = np.array([entry.t for entry in expected]), np.array([entry.t for entry in found])
    lows, highs = np.searchsorted(b, a - window), np.searchsorted(b, a + window, side="right")
    choices: list[NDArray[np.int8]] = []
    # Cost of aligning the entries so far with the first `low`, low + 1, ... found entries.
    low, cost = (0, np.zeros(1))
    for i, (next_low, high) in enumerate(zip(lows, highs, strict=True)):
        count = np.arange(next_low, high + 1)
        beyond = np.maximum(count - (low + len(cost) - 1), 0)
        before = cost[np.minimum(count - low, len(cost) - 1)] + _LACKING * beyond
        row = before + _LACKING
        choice = np.full(len(count), _MISSED, dtype=np.int8)
        if len(count) > 1:
            differs = np.array([found[j].label != expected[i].label for j in count[:-1]])
            distance = np.abs(b[next_low:high] - a[i]) / window if window > 0 else np.zeros(len(count) - 1)
            match = before[:-1] + _WRONG * differs + _FAR * distance
            better = match <= row[1:]
            row[1:], choice[1:] = np.where(better, match, row[1:]), np.where(better, _MATCHED, _MISSED)
        shifted = row - _LACKING * count
        least = np.minimum.accumulate(shifted)
        choice[least < shifted] = _SPURIOUS
        choices.append(choice)
        low, cost = int(next_low), least + _LACKING * count
    pairs: list[tuple[int, int]] = []
    i, j = len(expected) - 1, len(found)
    while i >= 0 and j > 0:
        choice = choices[i]
        here = j - int(lows[i])
        if here >= len(choice) or choice[here] == _SPURIOUS:
            j -= 1
        elif choice[here] == _MATCHED:
            i, j = i - 1, j - 1
            pairs.append((i + 1, j))
        else:
            i -= 1
    return pairs[::-1]
