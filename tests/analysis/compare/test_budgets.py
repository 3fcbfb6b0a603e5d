"""A comparison keeps to its budget: its reference, its runs and its repetitions end when their time is over."""

from __future__ import annotations

import itertools
import time
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.analysis.compare.reference import find_reference
from hybridsim.analysis.compare.timing import timed_in_turns
from hybridsim.analysis.time_budget import OutOfTime

DECAY = hs.Model("decay", [hs.State("x", 1.0, "-x")])


def late(*names: str) -> Any:
    """Runs of the decay. Those by the given integrators use up all their time."""

    def run(integrator: str, *, progress: Any, **options: Any) -> hs.Solution:
        if integrator in names:
            raise OutOfTime("not done after 2 s")
        return hs.simulate(DECAY, (0, 1), integrator=integrator, **options)

    return run


def test_a_reference_that_takes_too_long_is_made_by_stiff_methods() -> None:
    found = find_reference(DECAY, (0, 1), None, late("scipy-dop853"), "runs", seconds=2.0)
    assert found.title.startswith("run with rodas5p") and found.second.startswith("run with cvode-bdf")
    assert found.warnings == ("the run with scipy-dop853 at rtol 1e-13 was not done after 2 s",)
    assert found.difference.state <= 1e-8


def test_a_second_reference_that_takes_too_long_is_left_out() -> None:
    found = find_reference(DECAY, (0, 1), None, late("cvode-adams"), "runs", seconds=2.0)
    assert found.difference is None and found.second == ""
    assert "cvode-adams" in found.warnings[0] and "not done after 2 s" in found.warnings[0]


def test_where_no_reference_is_ready_in_time_it_is_said() -> None:
    with pytest.raises(
        hs.SimulationError, match=r"rodas5p at rtol 1e-10 was not done(.*\n)*.*larger `budget`"
    ):
        find_reference(DECAY, (0, 1), None, late("scipy-dop853", "rodas5p"), "runs", seconds=2.0)


def test_repetitions_without_number_end_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes on by a tenth of a second at every look, the ten seconds of these are soon over."""
    clock = itertools.count(0.0, 0.1)
    for name in ("monotonic", "perf_counter"):
        monkeypatch.setattr(time, name, lambda: next(clock))
    (times,) = timed_in_turns([lambda: None], 10**12, expected=[0.1], until=10.0)
    assert 1 <= len(times) <= 100


def test_repetitions_end_where_all_runs_have_been_timed_for_long_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = itertools.count(0.0, 0.1)
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    (times,) = timed_in_turns([lambda: None], 10**12)
    assert 2.0 <= sum(times) <= 2.2


def test_a_segment_that_is_done_in_one_call_is_looked_at_on_the_way() -> None:
    """SciPy's own event finding steps through a whole segment: here about 1e4 steps."""
    fractions: list[float] = []

    def watch(fraction: float) -> None:
        fractions.append(fraction)
        if len(fractions) > 100:
            raise OutOfTime("enough")

    model = hs.Model("swing", [hs.State("x", 1.0, "v"), hs.State("v", 0.0, "-x")])
    with pytest.raises(OutOfTime):
        hs.simulate(
            model, (0, 1000), integrator="scipy-dop853", events="native", max_step=0.1, progress=watch
        )
    assert len(fractions) == 101 and 0.0 < max(fractions) < 0.01
