"""Verdicts on studies that are made up: what each kind of failure is called, the order, and the reasons in words."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hybridsim.errors import UsageError
from hybridsim.testing import verdict as v
from hybridsim.testing.clock import Endless
from hybridsim.testing.measuring import Measured
from hybridsim.testing.study import RUNAWAY, Setting, Study, cut_short


def measured(**changes: Any) -> Measured:
    """A right run, but for the changes."""
    right = {
        "ending": (), "sequence": (), "checks": (), "time_error": 1e-9, "state_error": 1e-9,
        "status": "finished", "steps": 10, "seconds": 0.1,
    }  # fmt: skip
    return Measured(**{**right, **changes})


def study(*runs: Measured, failure: Exception | None = None) -> Study:
    """A fixed-step study with these runs."""
    settings = [Setting(f"unit/{300 * 4**n}", {"step": 1.0}, 1e-12, 2.0) for n in range(len(runs))]
    ended = None if failure is None else ("the last", failure)
    return Study(tuple(zip(settings, runs, strict=True)), (1e-6, 1e-6), ended)


def test_each_failure_has_its_name() -> None:
    cases = {
        v.RIGHT: measured(),
        v.WRONG_ANSWER: measured(state_error=1e-3),
        v.WRONG_SEQUENCE: measured(sequence=("event 0: f:stick expected",)),
        v.HANG: measured(ending=("ended as 'limit'",), status="limit"),
        v.REFUSED: measured(ending=("ended as 'cascade'",), status="cascade"),
    }
    assert {name: v.verdict(study(run))[0] for name, run in cases.items()} == {name: name for name in cases}
    assert v.verdict(study(measured(checks=("it moves",)))) == (v.WRONG_ANSWER, "unit/300: it moves")
    early = measured(ending=("ended at t = 1, not 2",), status="terminated")
    assert v.verdict(study(early))[0] == v.WRONG_ANSWER  # as if all were well


def test_a_run_that_raises_has_refused_and_one_without_end_hangs() -> None:
    refusal = UsageError("it has no stick", remedy="choose another")
    assert v.verdict(study(failure=refusal)) == (v.REFUSED, "the last: it has no stick; choose another")
    found, why = v.verdict(study(failure=ZeroDivisionError("by zero")))
    assert found == v.ERROR and why.startswith("the last: internal error")
    assert v.verdict(study(failure=Endless("no end after 4 s")))[0] == v.HANG


def test_the_worst_of_a_study_is_its_first_failure() -> None:
    runs = (measured(sequence=("event 3 is missing",)), measured())
    assert v.verdict(study(*runs)) == (v.WRONG_SEQUENCE, "unit/300: event 3 is missing")


def test_errors_that_stay_are_a_wrong_answer_with_the_order_zero() -> None:
    runs = study(measured(state_error=1e-3), measured(state_error=1e-3))
    assert v.verdict(runs)[0] == v.WRONG_ANSWER
    assert v.order(runs.done) == pytest.approx(0.0)


def test_the_order_is_that_of_the_two_finest_settings() -> None:
    errors = [1.0, 1e-2, 1e-2 / 4**3]
    assert v.order(study(*(measured(state_error=e) for e in errors)).done) == pytest.approx(3.0)
    assert v.order(study(measured(state_error=0.0), measured(state_error=0.0)).done) is None
    assert v.order(study(measured()).done) is None


def test_reasons_name_no_folders() -> None:
    assert v.one_line("/models/scenes/bar.toml:16: p\n  and q") == "bar.toml:16: p and q"


def test_a_study_that_is_cut_short_allows_for_its_last_tolerance() -> None:
    setting = Setting("rtol 1e-09", {"rtol": 1e-9}, 1e-9, 10.0)
    assert cut_short((1e-12, 1.0), setting) == pytest.approx((1e-6, 1.0))
    assert math.sqrt(1000.0) < RUNAWAY  # more than what a method of order 2 needs for a thousandth
