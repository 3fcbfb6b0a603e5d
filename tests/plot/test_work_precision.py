"""The chart of a comparison: every point where it belongs, hollow where the modes are wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest
from matplotlib.figure import Figure
from plot.fake_comparison import PERIOD, comparison

from hybridsim.errors import UsageError
from hybridsim.plot import save, work_precision


def points(panel) -> list[tuple[float, float, bool]]:
    """(Wall time, error, filled) of every marker."""
    marked = [line for line in panel.get_lines() if line.get_marker() != "None"]
    return [
        (line.get_xdata()[0], line.get_ydata()[0], line.get_markerfacecolor() != "white") for line in marked
    ]


def test_points_stand_where_they_belong_and_wrong_modes_are_hollow() -> None:
    result = comparison()
    whole, last, events = (points(panel) for panel in work_precision(result))
    rows = [row for row in result.rows if row.errors is not None]
    assert len(whole) == len(last) == len(events) == len(rows) == 35
    for row, (x, y, filled) in zip(rows, whole):
        assert (x, y) == (row.cost.wall_time, row.errors.state)
        assert filled == (row.integrator != "rk4-sign")
    assert events[0][1] == pytest.approx(rows[0].errors.event_time / PERIOD)
    assert min(y for _, y, _ in events) == pytest.approx(result.uncertainty.event_time / PERIOD)


def test_legend_names_every_line_once_and_what_hollow_means() -> None:
    *_, panel = work_precision(comparison())
    texts = [text.get_text() for text in panel.get_legend().get_texts()]
    assert texts[:8] == [*comparison().labels[:7], "third-party (1 failed)"]
    assert texts[8:] == ["hollow: wrong modes", "reference uncertain"]


def test_without_period_and_events_the_panels_say_so() -> None:
    result = comparison()
    rows = tuple(
        replace(
            row, errors=replace(row.errors, state_last_period=None, event_time=None) if row.errors else None
        )
        for row in result.rows
    )
    whole, last, events = work_precision(replace(result, rows=rows, period=None, uncertainty=None))
    assert len(points(whole)) == 35 and not points(last) and not points(events)
    assert [text.get_text() for text in last.texts] == ["the model has no period"]
    assert [text.get_text() for text in events.texts] == ["no events to compare"]
    assert events.get_title(loc="left") == "Largest event-time error"


def test_an_error_of_zero_is_drawn() -> None:
    result = comparison()
    row = result.rows[0]
    exact = replace(result, rows=(replace(row, errors=replace(row.errors, state=0.0)),), uncertainty=None)
    assert points(work_precision(exact)[0])[0][1] == 1e-17


def test_axes_of_the_caller_are_used(tmp_path) -> None:
    figure = Figure(figsize=(12, 4))
    axes = figure.subplots(1, 3)
    assert work_precision(comparison(), axes) == tuple(axes)
    with pytest.raises(UsageError, match="2 axes for three panels"):
        work_precision(comparison(), axes[:2])
    assert save(work_precision(comparison()), tmp_path / "chart.png").exists()


@pytest.mark.parametrize("low, high", [(1e-3, 1.1e-3), (21e-3, 83e-3), (9e-3, 0.4), (1e-3, 20), (1e-5, 1e3)])
def test_times_are_labelled_sparsely(low: float, high: float) -> None:
    result = comparison()
    rows = [
        replace(row, cost=replace(row.cost, wall_times=(time,)))
        for row, time in zip(result.rows, (low, high))
    ]
    panel = work_precision(replace(result, rows=tuple(rows)))[0]
    least, most = panel.get_xlim()
    labels = [label.get_text() for label in panel.get_xticklabels()]
    assert 1 <= len(labels) <= 6
    assert all(least <= tick <= most for tick in panel.get_xticks())
