"""Comparisons end to end: errors that are right, failures that stay in their row, tables and files."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import time
from dataclasses import replace
from functools import cache

import pytest
from plot.fake_solution import oscillator

import hybridsim as hs
from hybridsim.analysis import Series
from hybridsim.analysis.compare.timing import timed_in_turns
from hybridsim.errors import UsageError

PERIOD = 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
SPAN = (0.0, 6 * PERIOD)


@cache
def comparison() -> hs.Comparison:
    return hs.compare(
        "dfcs",
        t_span=SPAN,
        integrators=["scipy-dop853", ("scipy-rk45", {"first_step": PERIOD / 50})],
        rtols=[1e-5, 1e-9],
        repeat=2,
    )


def test_errors_follow_the_tolerance() -> None:
    result = comparison()
    assert "closed form" in result.reference
    assert result.labels == ("scipy-dop853", f"scipy-rk45 (first_step={PERIOD / 50:g})")
    for loose, tight in (result.rows[:2], result.rows[2:]):
        assert tight.errors.state < 1e-3 * loose.errors.state < 1e-5
        assert tight.errors.event_time < 1e-2 * loose.errors.event_time
        assert tight.errors.sequence.right and loose.errors.sequence.right
        assert tight.cost.rhs_evaluations > loose.cost.rhs_evaluations
        assert len(tight.cost.wall_times) >= 2
    assert result.uncertainty.state < 1e-12


def test_two_runs_and_the_closed_form_agree_within_their_uncertainty() -> None:
    exact = comparison().rows[1].errors
    by_runs = hs.compare(
        "dfcs", t_span=SPAN, integrators=["scipy-dop853"], rtols=[1e-9], repeat=1, reference="runs"
    )
    assert by_runs.reference == "run with scipy-dop853 at rtol 1e-13"
    assert by_runs.second_reference == "run with cvode-adams at rtol 1e-12"
    assert by_runs.uncertainty.state < 1e-9
    assert by_runs.rows[0].errors.state == pytest.approx(exact.state, abs=2 * by_runs.uncertainty.state)


def test_a_reference_of_the_caller() -> None:
    reference = hs.simulate("dfcs", SPAN, rtol=1e-12)
    result = hs.compare(
        "dfcs", t_span=SPAN, integrators=["scipy-rk45"], rtols=[1e-8], repeat=1, reference=reference
    )
    assert result.reference == "given by the caller"
    assert 0 < result.rows[0].errors.state < 1e-6
    by_function = hs.compare(
        "dfcs",
        t_span=SPAN,
        integrators=["scipy-rk45"],
        rtols=[1e-8],
        repeat=1,
        reference=lambda t: oscillator(6)(t),
    )
    assert 0 < by_function.rows[0].errors.state < 1e-6
    assert by_function.rows[0].errors.event_time is None


def test_a_reference_in_multiple_precision() -> None:
    """The slider of static-kinetic is pulled off at t = mu_s N/(k v_pull) = 4: both know it to the last digit."""
    result = hs.compare(
        "static-kinetic", t_span=(0, 4.5), integrators=["dop853"], rtols=[1e-9], repeat=1,
        reference="multiple precision",
    )  # fmt: skip
    assert result.reference == "Taylor series in multiple precision, 32 digits"
    assert result.second_reference == "run with dop853 at rtol 1e-13"
    assert result.difference.event_time < 1e-13 and result.difference.state < 1e-11
    assert 0 < result.rows[0].errors.state < 1e-7


def test_parameters_and_start_are_part_of_the_question() -> None:
    changed = hs.compare(
        "dfcs", t_span=SPAN, integrators=["scipy-dop853"], rtols=[1e-8], repeat=1,
        params={"F0": 25, "omega": "0.7*sqrt(k/m)"}, x0={"x": 1e-4},
    )  # fmt: skip
    assert changed.rows[0].errors.state < 1e-6
    assert changed.period == pytest.approx(PERIOD * 0.6 / 0.7)
    model = hs.load("dfcs").with_(F0=25, omega="0.7*sqrt(k/m)").with_start(x=1e-4)
    assert changed.provenance["model_sha256"] == hashlib.sha256(model.to_toml().encode()).hexdigest()


def test_failures_are_rows(monkeypatch) -> None:
    lines = [
        Series("scipy-dop853", "rtol", (1e-20, 1e-6)),
        ("scipy-rk45", {"no_such_option": 1}),
    ]
    result = hs.compare("dfcs", t_span=SPAN, integrators=lines, rtols=[1e-5], repeat=1)
    assert [row.status for row in result.rows] == ["refused", "finished", "refused"]
    assert "rtol" in result.rows[0].message and "no_such_option" in result.rows[2].message
    assert result.rows[0].errors is None and result.rows[0].cost is None
    table = result.table()
    assert "  rtol 1e-20: refused: `rtol` cannot be 1e-20" in table and "no_such_option" in table


def test_a_third_partys_exception_costs_its_own_row_only(monkeypatch) -> None:
    from hybridsim.integrators.scipy.solvers import ScipyRK45

    def broken(*arguments, **keywords):
        raise ZeroDivisionError("somebody's bug")

    monkeypatch.setattr(ScipyRK45, "start", broken)
    result = hs.compare(
        "dfcs", t_span=SPAN, integrators=["scipy-rk45", "scipy-dop853"], rtols=[1e-5], repeat=1
    )
    assert (result.rows[0].status, result.rows[0].message) == ("failed", "ZeroDivisionError: somebody's bug")
    assert result.rows[1].errors is not None


def test_resets_are_compared_at_matched_events() -> None:
    result = hs.compare(
        "bouncing-ball",
        t_span=(0, 2),
        integrators=["scipy-dop853"],
        rtols=[1e-5, 1e-9],
        repeat=1,
        reference="runs",
    )
    loose, tight = (row.errors for row in result.rows)
    assert loose.sequence.right and tight.sequence.right
    assert loose.state < 1e-3 and tight.state < 1e-6
    assert tight.state_last_period is None
    assert result.reading(result.rows[0], "state_last_period") is None


def test_below_the_uncertainty_only_that_is_said() -> None:
    from dataclasses import replace

    result = comparison()
    blurred = replace(result, uncertainty=replace(result.uncertainty, state=1e-7, event_time=1e-7 * PERIOD))
    loose, tight = (blurred.reading(row, "state") for row in blurred.rows[:2])
    assert not loose.is_bound and tight.is_bound
    assert (tight.value, str(tight)) == (1e-7, "< 1.0e-07")
    assert blurred.reading(blurred.rows[1], "event_time").value == pytest.approx(1e-7)
    assert "< 1.0e-07" in blurred.table()


def test_table_and_files(tmp_path) -> None:
    result = comparison()
    lines = result.table().splitlines()
    header = next(i for i, line in enumerate(lines) if "event time / T" in line)
    assert lines[header + 1] == "scipy-dop853" and lines[header + 2].startswith("  rtol 1e-05 ")
    end = lines[header].index("modes")
    assert all(
        line[end:] == "right" for line in (*lines[header + 2 : header + 4], *lines[header + 5 : header + 7])
    )
    assert max(map(len, lines)) < 125

    result.to_csv(tmp_path / "table.csv")
    with open(tmp_path / "table.csv", encoding="utf-8") as file:
        records = list(csv.DictReader(file))
    assert len(records) == 4
    assert float(records[1]["state_error"]) == result.rows[1].errors.state
    assert json.loads(records[1]["options"]) == {"rtol": 1e-9}

    frame = result.to_pandas()
    assert frame["state_error"].tolist() == [row.errors.state for row in result.rows]
    assert list(frame.columns) == list(records[0])

    text = result.to_json(tmp_path / "comparison.json")
    content = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert content == json.loads(text)
    assert content["rows"][1]["event_time_error"] == result.rows[1].errors.event_time
    assert {"hybridsim", "python", "numpy", "scipy", "numba", "scikit-sundae", "cpus"} <= content[
        "provenance"
    ].keys()
    assert len(content["provenance"]["model_sha256"]) == 64
    assert content["provenance"]["parameters"] == hs.load("dfcs").parameter_values()
    assert content["provenance"]["start"] == {"x": 0.0, "v": 0.0}


def test_the_table_names_the_cheapest_run_that_is_accurate_and_right() -> None:
    result = comparison()
    accurate = [row for row in result.rows if row.errors.state <= 1e-6 and row.errors.sequence.right]
    first = min(accurate, key=lambda row: row.cost.wall_time)
    (line,) = (line for line in result.table().splitlines() if line.startswith("Cheapest at 1e-06: "))
    assert line.startswith(f"Cheapest at 1e-06: {first.label} (rtol {first.setting[1]:.0e}), ")
    slow = replace(first, cost=replace(first.cost, wall_times=(1e3,)))
    assert "Cheapest at 1e-06: " in replace(result, rows=(slow,)).table()
    off = replace(first, errors=replace(first.errors, state=1e-3))
    assert "No run reaches 1e-06 with the right modes." in replace(result, rows=(off,)).table()


def test_progress_counts_to_its_end() -> None:
    calls = []
    hs.compare(
        "dfcs", t_span=(0, PERIOD), integrators=["scipy-rk45"], rtols=[1e-4, 1e-5], repeat=2,
        progress=lambda *call: calls.append(call),
    )  # fmt: skip
    done, totals, texts = zip(*calls)
    assert list(done) == sorted(done) and done[-1] == totals[-1] == totals[0]
    assert texts[0] == "reference" and texts[-1] == "done"


def test_timing_goes_in_turns() -> None:
    order = []
    times = timed_in_turns([lambda: order.append("a"), lambda: order.append("b")], 3)
    assert order == ["a", "b"] * 3
    assert [len(spent) for spent in times] == [3, 3] and all(t >= 0 for spent in times for t in spent)


def test_a_long_run_is_not_repeated_for_ever(monkeypatch) -> None:
    clock, turns = [0.0], []
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])

    def long() -> None:
        clock[0] += 3.0  # of two seconds that are enough

    times = timed_in_turns([long, lambda: None], 3, turns.append)
    assert [len(spent) for spent in times] == [1, 3]
    assert turns == [0, 1] * 3


@pytest.mark.parametrize(
    "keywords, message",
    [
        ({"t_span": (1, 0)}, "t_span"),
        ({"repeat": 0}, "`repeat` cannot be 0"),
        ({"integrators": []}, "no integrators"),
        ({"integrators": ["scipy-rk4"]}, "scipy-rk4"),
        ({"integrators": ["scipy-rk45", "scipy-rk45"]}, "two series"),
        ({"rtols": []}, "no values of rtol are given"),
        ({"reference": "guess"}, "`reference` cannot be 'guess'"),
        ({"reference": 3}, "`reference` cannot be a int"),
        ({"params": {"mass": 1}}, "no parameter 'mass'"),
    ],
)
def test_bad_requests(keywords: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        hs.compare("dfcs", **{"t_span": SPAN, "integrators": ["scipy-rk45"], **keywords})


def test_no_closed_form_where_none_is_known() -> None:
    with pytest.raises(UsageError, match="no closed form is known for belt"):
        hs.compare("belt", integrators=["scipy-rk45"], reference="closed form")
