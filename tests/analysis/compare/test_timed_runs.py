"""What a budget of time does to a comparison: predictions, what is left out first, and that it is said."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from hybridsim.analysis.compare.errors_against_reference import Errors
from hybridsim.analysis.compare.lines import Series
from hybridsim.analysis.compare.mode_sequence import SequenceVerdict
from hybridsim.analysis.compare.rows import Cost, Row
from hybridsim.analysis.compare.timed_runs import Budget, Entry, timed_rows
from hybridsim.analysis.compare.timing import timed_in_turns


@dataclass
class FakeBench:
    """Runs that take no time and say that they took seconds(label, value)."""

    seconds: Callable[[str, float], float]
    order: list[tuple[str, float]] = field(default_factory=list)
    model: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(name="fake"))

    def first_run(self, line: Series, value: float, reference: object, limit: float) -> Row:
        self.order.append((line.label, value))
        seconds = self.seconds(line.label, value)
        row = Row(line.integrator, line.label, (line.varied, value), {}, "finished")
        if seconds > limit:
            return Row(line.integrator, line.label, (line.varied, value), {}, "stopped", "too long")
        errors = Errors(value, None, None, SequenceVerdict())
        cost = Cost((seconds,), round(seconds * 1e6), 0, 1)
        return Row(row.integrator, row.label, row.setting, {}, "finished", errors=errors, cost=cost)

    def call(self, line: Series, value: float) -> Callable[[], None]:
        return lambda: None


def run(bench: FakeBench, lines: list[Series], repeat: int, seconds: float) -> tuple[Row, ...]:
    (rows,) = timed_rows([Entry(bench, None, tuple(lines))], repeat, Budget(seconds), lambda what: None)
    return rows


VALUES = (1e-2, 1e-4, 1e-6, 1e-8)


def test_loose_settings_of_all_lines_come_first_and_rows_stay_in_order() -> None:
    bench = FakeBench(lambda label, value: 0.001)
    rows = run(bench, [Series("a", "rtol", VALUES), Series("b", "rtol", VALUES)], 2, 100.0)
    assert bench.order == [(label, value) for value in VALUES for label in "ab"]
    assert [(row.label, row.setting[1]) for row in rows] == [(label, v) for label in "ab" for v in VALUES]
    assert all(row.cost.repetitions == 2 * 5 for row in rows)  # of a millisecond: five calls in each turn


def test_what_would_take_too_long_is_predicted_and_not_started() -> None:
    """Ten times the equal share of 16 s among 2*4*2 calls is 10 s; line b grows by 30 a setting: 0.01 ... 270 s."""
    bench = FakeBench(lambda label, value: 0.01 * (30 if label == "b" else 1) ** VALUES.index(value))
    rows = run(bench, [Series("a", "rtol", VALUES), Series("b", "rtol", VALUES)], 1, 16.0)
    assert [row.status for row in rows] == ["finished"] * 7 + ["not started"]
    assert ("b", 1e-8) not in bench.order
    assert rows[-1].message.startswith("the run would take 2.7e+02 s")
    assert rows[-1].errors is None and rows[-1].cost is None


def test_where_the_next_settings_do_not_fit_together_the_longest_go() -> None:
    """At the third setting the three lines would take 8, 2 and 1 s, of 5 s that are left."""
    takes = {"a": 8.0, "b": 2.0, "c": 1.0}
    bench = FakeBench(lambda label, value: takes[label] * 4.0 ** (VALUES.index(value) - 2))
    rows = run(bench, [Series(name, "rtol", VALUES[:3]) for name in "abc"], 1, 5.0)
    lost = [(row.label, row.setting[1]) for row in rows if row.status == "not started"]
    assert lost == [("a", 1e-6)]
    assert "budget" in next(row.message for row in rows if row.status == "not started")


def test_the_lines_that_were_fast_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The slow line takes 3 s and then the rest of the 10 s; before that the other two are run at both settings."""
    clock = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    takes = {"slow": 3.0, "fast": 0.1, "faster": 0.01}
    bench = FakeBench(lambda label, value: takes[label] * (1 if value == VALUES[0] else 5))
    first_run = bench.first_run

    def slowly(line: Series, value: float, reference: object, limit: float) -> Row:
        clock[0] += bench.seconds(line.label, value)
        return first_run(line, value, reference, limit)

    bench.first_run = slowly
    rows = run(bench, [Series(name, "rtol", VALUES[:2]) for name in takes], 0, 10.0)
    assert [label for label, _ in bench.order] == ["slow", "fast", "faster", "faster", "fast", "slow"]
    assert [row.label for row in rows] == [name for name in takes for _ in range(2)]
    assert all(row.status == "finished" for row in rows if row.label != "slow")


def test_after_a_run_that_had_to_be_stopped_no_tighter_one_is_tried() -> None:
    bench = FakeBench(lambda label, value: 0.01 if value > 1e-4 else 1e6)
    rows = run(bench, [Series("a", "rtol", VALUES)], 1, 10.0)
    assert [row.status for row in rows] == ["finished", "stopped", "not started", "not started"]


def test_repetitions_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every run is done once; what is left of 2 s is too short to repeat the one that takes 1.2 s."""
    clock = [0.0]
    for name in ("perf_counter", "monotonic"):
        monkeypatch.setattr(time, name, lambda: clock[0])
    bench = FakeBench(lambda label, value: 1.2 if label == "slow" else 0.01)
    first_run = bench.first_run

    def slowly(line: Series, value: float, reference: object, limit: float) -> Row:
        clock[0] += bench.seconds(line.label, value)
        return first_run(line, value, reference, limit)

    bench.first_run = slowly
    rows = run(bench, [Series("slow", "rtol", (1e-2,)), Series("fast", "rtol", (1e-2,))], 3, 2.0)
    assert [row.status for row in rows] == ["finished", "finished"]
    assert [row.cost.repetitions for row in rows] == [0, 3 * 5]
    assert rows[0].cost.wall_times == (1.2,)


def test_a_round_that_is_too_long_is_shortened_by_its_longest_runs() -> None:
    calls: list[str] = []
    runs = [lambda name=name: calls.append(name) for name in "abc"]
    timed_in_turns(runs, 2, expected=[1.0, 50.0, 2.0], until=time.monotonic() + 40.0)
    assert calls == ["a", "c", "a", "c"]
    calls.clear()
    timed_in_turns(runs, 2, expected=[1.0, 50.0, 2.0], until=time.monotonic() - 1.0)
    assert calls == []


def test_objects_that_the_caller_froze_stay_frozen() -> None:
    gc.freeze()
    frozen = gc.get_freeze_count()
    timed_in_turns([lambda: None], 1)
    assert gc.get_freeze_count() > 0.9 * frozen


def test_objects_that_were_frozen_for_the_timing_are_collected_later() -> None:
    gc.unfreeze()
    counts: list[int] = []
    timed_in_turns([lambda: counts.append(gc.get_freeze_count())], 1)
    assert counts[0] > 0 and gc.get_freeze_count() == 0
    gc.freeze()  # as in all modules of tests


def test_a_budget_runs_out(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [5.0]
    monkeypatch.setattr("hybridsim.analysis.time_budget.time.perf_counter", lambda: clock[0])
    budget = Budget(2.0)
    assert budget.left == 2.0
    clock[0] = 6.5
    assert (budget.spent, budget.left) == (1.5, 0.5)
    clock[0] = 8.0
    assert (budget.spent, budget.left) == (3.0, 0.0)


def test_compiling_is_not_of_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, compiled = [0.0], [0.0]
    monkeypatch.setattr("hybridsim.analysis.time_budget.time.perf_counter", lambda: clock[0])
    monkeypatch.setattr("hybridsim.analysis.time_budget.seconds_compiling", lambda: compiled[0])
    budget = Budget(10.0)
    clock[0], compiled[0] = 7.0, 5.0
    assert (budget.spent, budget.left) == (2.0, 8.0)
