"""The page of the suite and the chart of regularised runs: every point where it belongs, one legend for all."""

from __future__ import annotations

from dataclasses import replace

import pytest
from plot.fake_comparison import comparison

from hybridsim.analysis.compare.rows import Row
from hybridsim.analysis.suite.result import SceneResult, SuiteComparison
from hybridsim.analysis.suite.scenes import SCENES
from hybridsim.plot import regularisation, save, suite_page


def points(panel) -> list[tuple[float, float, str]]:
    """(x, y, fill) of every marker."""
    marked = [line for line in panel.get_lines() if line.get_marker() != "None"]
    fills = ["none" if line.get_markerfacecolor() == "white" else line.get_fillstyle() for line in marked]
    return [(line.get_xdata()[0], line.get_ydata()[0], fill) for line, fill in zip(marked, fills)]


def suite(count: int) -> SuiteComparison:
    return SuiteComparison(
        tuple(SceneResult(scene, comparison()) for scene in SCENES[:count]), 3, 600.0, 300.0
    )


def test_a_panel_for_each_scene_and_one_legend(tmp_path) -> None:
    panels = suite_page(suite(4))
    titles = [panel.get_title(loc="left").replace("\n", " ") for panel in panels]
    assert titles == [scene.title for scene in SCENES[:4]]
    rows = [row for row in comparison().rows if row.errors is not None]
    for panel in panels:
        found = points(panel)
        assert [(x, y) for x, y, _ in found] == [
            (row.cost.wall_time, 1.0 if row.integrator == "rk4-sign" else row.errors.state) for row in rows
        ]
        assert [fill == "none" for *_, fill in found] == [row.integrator == "rk4-sign" for row in rows]
        assert panel.get_legend() is None
    (legend,) = panels[0].figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == [*comparison().labels[:-1], "hollow, at the top: wrong modes", "reference uncertain"]
    assert len(panels[0].figure.axes) == 4
    assert save(panels, tmp_path / "suite.png").exists()


def forms() -> list[Row]:
    """A set-valued run, and a form of first order whose work grows as the root of 1/v0."""
    whole = comparison().rows[3]
    errors, cost = whole.errors, whole.cost
    rows = [replace(whole, label="set-valued, dop853")]
    for v0 in (1e-2, 1e-3, 1e-4, 1e-5):
        rows.append(
            replace(
                whole,
                label="tanh, dop853",
                form="tanh",
                setting=("v0", v0),
                options={"rtol": whole.setting[1]},
                errors=replace(errors, state=3.0 * v0, sequence=None),
                cost=replace(cost, rhs_evaluations=round(1000 * v0**-0.5), guard_evaluations=0, wall_times=(v0**-0.5,)),
            )
        )  # fmt: skip
    return rows


def test_regularised_runs_over_v0(tmp_path) -> None:
    result = replace(comparison(), rows=tuple(forms()), uncertainty=None)
    errors, times = regularisation(result)
    assert [(x, y) for x, y, _ in points(errors)] == [
        (row.setting[1], row.errors.state) for row in result.rows[1:]
    ]
    assert [y for _, y, _ in points(times)] == [row.cost.wall_time for row in result.rows[1:]]
    assert {fill for *_, fill in points(errors)} == {"left"}
    level = [
        line for line in errors.get_lines() if len(set(line.get_ydata())) == 1 and len(line.get_ydata()) == 2
    ]
    assert [line.get_ydata()[0] for line in level] == [result.rows[0].errors.state]
    texts = [text.get_text() for text in times.figure.legends[0].get_texts()]
    assert texts[0] == "set-valued, dop853"
    assert texts[1] == "tanh, dop853 (1.00, -0.50)"
    assert save((errors, times), tmp_path / "chart.png").exists()


@pytest.mark.parametrize("kept", [2, 3])
def test_an_exponent_needs_three_points(kept: int) -> None:
    result = replace(comparison(), rows=tuple(forms()[: 1 + kept]), uncertainty=None)
    *_, times = regularisation(result)
    text = times.figure.legends[0].get_texts()[1].get_text()
    assert ("?" in text) == (kept < 3)
