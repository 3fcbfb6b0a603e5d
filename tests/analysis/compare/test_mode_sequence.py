"""Matching of events: the cheapest alignment, and what the verdict counts."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable

import numpy as np
import pytest

from hybridsim.analysis.compare.mode_sequence import SequenceVerdict, _align, _Entry, match_events
from hybridsim.reference.trajectory import ExactEvent, Trajectory

CYCLE = [(0.1, "slip+"), (0.3, "stick"), (0.6, "slip-"), (0.8, "stick"), (1.1, "slip+"), (1.3, "stick")]


def trajectory(changes: Iterable[tuple[float, str]], t_end: float = 2.0, **other) -> Trajectory:
    events = [ExactEvent(t, "f", "", mode) for t, mode in changes]
    for component, changes in other.items():
        events += [ExactEvent(t, component, "", mode) for t, mode in changes]
    events.sort(key=lambda event: event.t)
    return Trajectory(lambda t, side: t[None], (0.0, t_end), tuple(events), {"f": "stick"})


def verdict(changes: Iterable[tuple[float, str]], **other) -> SequenceVerdict:
    return match_events(trajectory(CYCLE), trajectory(changes, **other)).verdict


def test_alignment_is_the_cheapest() -> None:
    rng = np.random.default_rng(0)

    def random_entries() -> list[_Entry]:
        return [
            _Entry(t, str(rng.choice(list("abc"))), None) for t in np.sort(rng.random(rng.integers(0, 9)))
        ]

    for _ in range(300):
        a, b, window = random_entries(), random_entries(), float(rng.choice([0.05, 0.2, 0.6, 2]))

        def match_cost(i: int, j: int, a=a, b=b, window=window) -> float:
            distance = abs(a[i].t - b[j].t)
            return (a[i].label != b[j].label) + distance / window / 2 if distance <= window else np.inf

        @functools.cache
        def least(i: int, j: int, a=a, b=b, cost=match_cost) -> float:
            if i == len(a) or j == len(b):
                return len(a) - i + len(b) - j
            return min(least(i + 1, j) + 1, least(i, j + 1) + 1, least(i + 1, j + 1) + cost(i, j))

        pairs = _align(a, b, window)
        assert all(p[0] < q[0] and p[1] < q[1] for p, q in itertools.pairwise(pairs))
        cost = len(a) + len(b) - 2 * len(pairs) + sum(match_cost(i, j) for i, j in pairs)
        assert cost == pytest.approx(least(0, 0))


def test_right_where_only_times_differ() -> None:
    found = match_events(trajectory(CYCLE), trajectory([(t + 0.02, mode) for t, mode in CYCLE]))
    assert found.verdict.right and str(found.verdict) == "right"
    assert [b.t - a.t for a, b in found.pairs] == pytest.approx([0.02] * 6)


def test_missed_spurious_and_wrong_are_counted_and_the_rest_still_matched() -> None:
    assert verdict(CYCLE[:2] + CYCLE[4:]) == SequenceVerdict(missed=2)
    assert verdict([*CYCLE[:1], (0.15, "stick"), (0.2, "slip+"), *CYCLE[1:]]) == SequenceVerdict(spurious=2)
    assert verdict([*CYCLE[:1], (0.3, "slip-"), *CYCLE[2:]]) == SequenceVerdict(wrong=1)
    assert str(SequenceVerdict(2, 1, 0)) == "2 missed, 1 spurious"


def test_wrong_first_mode() -> None:
    started = Trajectory(lambda t, side: t[None], (0.0, 2.0), trajectory(CYCLE).events, {"f": "slip-"})
    assert match_events(trajectory(CYCLE), started).verdict == SequenceVerdict(wrong=1)


def test_a_mode_of_no_duration_does_not_count() -> None:
    crossing = [(0.3, "slip+"), (0.7, "slip-")]
    by_way_of_stick = [(0.3, "slip+"), (0.7, "stick"), (0.7, "slip-")]
    assert match_events(trajectory(crossing), trajectory(by_way_of_stick)).verdict.right
    grazing = [(0.3, "slip+"), (0.5, "stick"), (0.5, "slip+"), (0.7, "slip-")]
    assert match_events(trajectory(crossing), trajectory(grazing)).verdict.right
    at_the_start = [(0.0, "slip+"), *crossing[1:]]
    started = Trajectory(lambda t, side: t[None], (0.0, 2.0), trajectory(crossing[1:]).events, {"f": "slip+"})
    assert match_events(started, trajectory(at_the_start)).verdict.right


def test_an_event_pushed_over_the_end_is_not_missed() -> None:
    late = [(t + 0.02, mode) for t, mode in CYCLE][:-1]
    assert match_events(trajectory(CYCLE, t_end=1.31), trajectory(late, t_end=1.31)).verdict.right
    assert match_events(trajectory(CYCLE, t_end=1.4), trajectory(late, t_end=1.4)).verdict.missed == 1


def test_components_are_judged_one_by_one() -> None:
    one = trajectory([(0.5, "slip+")], g=[(0.5 + 1e-9, "slip+")])
    other = trajectory([(0.5 + 1e-9, "slip+")], g=[(0.5, "slip+")])
    assert match_events(one, other).verdict.right


def test_chatter_is_told_apart_quickly() -> None:
    chatter = [(i / 3600, "slip+" if i % 2 else "slip-") for i in range(1, 7000)]
    counted = verdict(chatter)
    assert counted.spurious == len(chatter) - len(CYCLE)
    assert counted.wrong == 3
