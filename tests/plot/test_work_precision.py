"""The chart of a comparison: every point where it belongs, hollow where the modes are wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv, to_rgb
from matplotlib.figure import Figure
from plot.fake_comparison import PERIOD, comparison

from hybridsim.errors import UsageError
from hybridsim.plot import save, work_precision
from hybridsim.plot.shared.lines import looks
from hybridsim.plot.work_precision import label_ticks


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
        is_right = row.integrator != "rk4-sign"
        assert (x, y) == (row.cost.wall_time, row.errors.state if is_right else 1.0)
        assert filled == is_right
    assert events[0][1] == pytest.approx(rows[0].errors.event_time / PERIOD)
    assert min(y for _, y, _ in events) == pytest.approx(result.uncertainty.event_time / PERIOD)


def test_wrong_modes_stand_at_the_top_edge_and_no_line_joins_them() -> None:
    """In every panel, also where the error of a wrong run is below the uncertainty of the reference."""
    for panel in work_precision(comparison()):
        wrong = [line for line in panel.get_lines() if line.get_markerfacecolor() == "white"]
        assert len(wrong) == 5
        top = panel.transAxes.transform((0, 1))[1]
        for line in wrong:
            assert line.get_transform().transform(line.get_xydata())[0, 1] == pytest.approx(top)
        lines = [
            line for line in panel.get_lines() if line.get_marker() == "None" and len(line.get_xdata()) == 5
        ]
        assert len(lines) == 6


def test_legend_names_every_drawn_line_once_and_what_hollow_means() -> None:
    panels = work_precision(comparison())
    (legend,) = panels[0].figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:7] == [*comparison().labels[:7]]
    assert texts[7:] == ["hollow, at the top: wrong modes", "reference uncertain"]
    assert "no result: third-party" in panels[0].figure.get_suptitle()


def test_the_title_tells_the_cheapest_run() -> None:
    """Of the fake, scipy-dop853 reaches 1e-6 at 1e-6 times 0.9 in 0.9*10**0.11 s, before all others but wrong ones."""
    title = work_precision(comparison())[0].figure.get_suptitle().replace("\n", " ")
    assert "cheapest at 1e-06: scipy-dop853 (rtol 1e-06), 1.16 s" in title
    none = replace(comparison(), rows=comparison().rows[-6:-1], uncertainty=None)
    assert "no run reaches 1e-06 with the right modes" in work_precision(none)[
        0
    ].figure.get_suptitle().replace("\n", " ")


def without(result, *quantities: str):
    """The comparison without some kinds of error."""
    gone = dict.fromkeys(quantities)
    rows = tuple(
        replace(row, errors=replace(row.errors, **gone)) if row.errors else row for row in result.rows
    )
    return replace(result, rows=rows, period=None, uncertainty=None)


def test_there_is_a_panel_for_each_kind_of_error_and_no_other() -> None:
    result = without(comparison(), "state_last_period")
    whole, events = work_precision(result)
    assert len(points(whole)) == len(points(events)) == 35
    assert events.get_ylabel() == "largest event-time error"
    rows = tuple(
        replace(row, errors=replace(row.errors, graph=1e-5)) if row.errors else row for row in result.rows
    )
    *_, graphs = work_precision(replace(result, rows=rows))
    assert graphs.get_ylabel() == "distance of the graphs"
    assert {y for _, y, filled in points(graphs) if filled} == {1e-5}


def test_where_nothing_ran_the_chart_says_so() -> None:
    result = comparison()
    lost = replace(result, rows=result.rows[-1:], uncertainty=None)
    (panel,) = work_precision(lost)
    assert [text.get_text() for text in panel.texts] == ["no run to show"]


def test_families_share_a_hue_and_every_line_looks_different() -> None:
    rows = list(comparison().rows)
    rows += [replace(row, label=f"{row.label}, native events") for row in rows[:10]]
    chosen = looks(rows)
    assert len({(look.colour, look.marker, look.dashes) for look in chosen.values()}) == len(chosen)
    native, ours = chosen["scipy-rk45, native events"], chosen["scipy-rk45"]
    assert (native.colour, native.marker) == (ours.colour, ours.marker) and native.dashes != ours.dashes
    families = ("exact", "dop853", "rodas5p", "taylor", "scipy-rk45", "scipy-bdf", "cvode-bdf", "rk4-sign")
    ours = looks([replace(rows[0], label=name, integrator=name) for name in families])
    assert len({look.colour for look in ours.values()}) == len(families)
    hues = {name: round(rgb_to_hsv(to_rgb(look.colour))[0], 2) for name, look in chosen.items()}
    assert hues["scipy-rk45"] == hues["scipy-dop853"] != hues["cvode-bdf"] == hues["cvode-adams"]


def test_a_run_without_modes_is_half_filled() -> None:
    result = comparison()
    rows = tuple(
        replace(row, errors=replace(row.errors, sequence=None)) if row.errors else row for row in result.rows
    )
    *_, panel = work_precision(replace(result, rows=rows))
    marked = [line for line in panel.get_lines() if line.get_marker() != "None"]
    assert {line.get_fillstyle() for line in marked} == {"left"}
    assert "half filled: no modes to judge" in [
        text.get_text() for text in panel.figure.legends[0].get_texts()
    ]


def test_an_error_of_zero_is_drawn() -> None:
    result = comparison()
    row = result.rows[0]
    exact = replace(result, rows=(replace(row, errors=replace(row.errors, state=0.0)),), uncertainty=None)
    assert points(work_precision(exact)[0])[0][1] == 1e-17


def test_axes_of_the_caller_are_used(tmp_path) -> None:
    figure = Figure(figsize=(12, 4))
    axes = figure.subplots(1, 3)
    assert work_precision(comparison(), axes) == tuple(axes)
    with pytest.raises(UsageError, match="2 axes were passed for 3 kinds of error"):
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
    apart = np.diff(np.log10(panel.get_xticks())) / np.log10(most / least)
    assert (apart > 0.19).all()  # a label takes less than that


def test_a_label_of_times_is_not_next_to_another() -> None:
    """From 3.5 to 70 ms the labels at 10 and 20 would touch in a narrow panel."""
    panel = Figure().subplots()
    panel.set(xscale="log", xlim=(3.5e-3, 70e-3))
    label_ticks(panel)
    assert panel.get_xticks() == pytest.approx([10e-3, 30e-3])


@pytest.mark.parametrize("limits", [(2e-4, 3.0), (1e-4, 0.9), (3e-4, 2e2), (1e-6, 1e2), (7e-3, 0.15)])
def test_labels_of_times_have_room(limits: tuple[float, float]) -> None:
    panel = Figure(figsize=(3, 3)).subplots()
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlim(*limits)
    label_ticks(panel)
    places = np.log(panel.get_xticks() / limits[0]) / np.log(limits[1] / limits[0])
    assert len(places) >= 2
    assert np.diff(places).min() >= 0.23  # a label is about a fifth of a small panel wide
    assert places.min() >= 0 and places.max() <= 1
