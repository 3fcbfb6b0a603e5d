"""Pictures of sweeps draw what the sweep holds, with units, and say where there is nothing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import hybridsim as hs
from hybridsim.plot import save, sweep_lines, sweep_map
from hybridsim.plot.sweeps.readings import label_of, not_drawn, show_range

OMEGA, N = [300.0, 500.0, 400.0, 600.0], [20.0, 40.0]


def measured(model: hs.Model) -> dict[str, object]:
    values = model.parameter_values()
    a = 1e-4 * values["omega"] / values["N"]
    return {
        "a": math.nan if values["omega"] == 600 and values["N"] == 20 else a,
        "z": 1j * a,
        "all": [a, 2 * a],
        "s": "s",
    }


def swept(**values: list[object]) -> hs.Sweep:
    return hs.sweep("dfcs", values, measured, units={"a": "m"})


def test_lines_over_one_parameter() -> None:
    found = swept(omega=OMEGA)
    panels = found.plot()
    assert [axes.get_ylabel() for axes in panels] == ["a [mm]", "|z|", "all"]
    assert panels[-1].get_xlabel() == "ω [rad/s]"
    x, y = panels[0].lines[0].get_data()
    assert list(x) == sorted(OMEGA) and y[1] == found["a"][2]
    dots = panels[2].lines[0].get_xydata()
    assert sorted(map(tuple, dots)) == sorted((w, v) for w, row in zip(OMEGA, found["all"]) for v in row)


def test_states_at_the_end_of_runs_are_dots_without_lines() -> None:
    """In a sensitive system they jump from point to point."""
    result = hs.sweep("bouncing-ball", {"e": [0.3, 0.5]}, ["final.h", "maximum.h"], t_span=(0, 1))
    final, highest = result.plot()
    assert final.lines[0].get_linewidth() == 0 and final.lines[0].get_marker() == "o"
    assert highest.lines[0].get_linewidth() > 0


def test_of_many_readings_those_that_people_ask_for_first_are_drawn() -> None:
    result = hs.sweep("dfcs", {"omega": [400.0, 500.0]}, "steady")
    drawn = [" ".join(axes.get_ylabel().split()).partition(" [")[0] for axes in sweep_lines(result)]
    labels = {
        "amplitude.x": "amplitude of x",
        "amplitude.v": "amplitude of v",
        "amplitude.f": "amplitude of f",
        "stick_fraction.f": "stick fraction of f",
        "stops_per_period.f": "stops per period of f",
        "dissipated.f": "dissipated energy of f",
    }
    assert drawn == list(labels.values())
    assert not_drawn(result, arrays=True) == tuple(
        name for name, values in result.values.items() if values.dtype.kind in "fc" and name not in labels
    )


def test_a_reading_of_a_mode_is_named_once() -> None:
    result = hs.sweep("dfcs", {"omega": [400.0, 500.0]}, "mode_fraction.f.stick", t_span=(0, 0.1))
    (panel,) = sweep_lines(result)
    assert panel.get_ylabel().split() == ["mode", "fraction", "of", "f.stick"]


def test_lines_of_two_parameters_say_where_there_is_nothing() -> None:
    (panel,) = swept(omega=OMEGA, N=N).plot("a", over="omega")
    legend = [text.get_text() for text in panel.get_legend().get_texts()]
    assert legend == ["N = 20 N", "N = 40 N", "no result"]
    assert list(panel.lines[2].get_xdata()) == [600.0]
    assert list(panel.lines[1].get_ydata()) == [1e-4 * w / 40 for w in sorted(OMEGA)]


def test_a_bifurcation_diagram_is_dots_over_the_parameter() -> None:
    found = hs.bifurcation("dfcs", "F0", [22, 30], settle=20, samples=4)
    (panel,) = found.plot("x")
    assert panel.get_xlabel() == r"F$_{\mathregular{0}}$ [N]" and panel.get_ylabel().startswith("x [")
    upward = panel.get_lines()[0]
    assert sorted(set(upward.get_xdata())) == [22.0, 30.0] and len(upward.get_xdata()) == 8


def test_many_lines_are_named_in_part() -> None:
    (panel,) = sweep_lines(swept(omega=OMEGA, N=np.linspace(30, 60, 40).tolist()), "a", over="omega")
    names = [text.get_text() for text in panel.get_legend().get_texts()]
    assert len(names) <= 14 and names[0] == "N = 30 N" and names[-1] == "N = 60 N"
    assert len({line.get_color() for line in panel.lines}) == 40


def test_a_map(tmp_path: Path) -> None:
    found = swept(N=N, omega=OMEGA)
    panels = found.plot()
    assert [axes.get_xlabel() for axes in panels] == ["ω [rad/s]"] * 2
    (mesh,) = panels[0].collections
    drawn = mesh.get_array()
    assert drawn.mask.sum() == 1 and drawn.mask[0, 3]
    assert drawn[1].tolist() == [1e-4 * w / 40 for w in sorted(OMEGA)]
    assert panels[0].get_legend().get_texts()[0].get_text() == "no result"
    assert panels[1].get_legend() is None
    scales = [axes for axes in panels[0].figure.axes if axes not in panels]
    assert scales[0].get_ylabel() == "a [mm]"
    assert save(panels, tmp_path / "map.png").stat().st_size > 1000


def test_texts_as_values_of_a_parameter() -> None:
    found = swept(k=[1e5, 2e5], omega=["sqrt(k/m)", 400])
    (panel,) = sweep_lines(found, "a", over="omega")
    assert [tick.get_text() for tick in panel.get_xticklabels()] == ["sqrt(k/m)", "400.0"]
    (panel,) = sweep_map(found, "a")
    assert panel.get_xlabel() == "ω"


@pytest.mark.parametrize(
    "draw, message",
    [
        (lambda: swept(omega=OMEGA).plot("s"), "s is text"),
        (lambda: swept(omega=OMEGA).plot("b"), "no 'b'"),
        (lambda: swept(omega=OMEGA, N=N).plot("all"), "all is an array"),
        (lambda: swept(omega=OMEGA).plot(over="N"), "`over` cannot be 'N'"),
        (lambda: swept(omega=OMEGA, N=N, F0=[1]).plot(), "3 parameters"),
        (lambda: sweep_map(swept(omega=OMEGA)), "a grid of two"),
        (lambda: hs.sweep("dfcs", {"N": [1]}, lambda m: "s").plot(), "no result of the sweep can be drawn"),
        (lambda: sweep_lines(swept(omega=OMEGA), "a", axes=()), "0 axes were passed for 1"),
    ],
)
def test_what_cannot_be_drawn(draw, message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        draw()


def test_a_constant_is_drawn_without_its_rounding() -> None:
    values = 2.0 + 1e-12 * np.array([0, 1, -1, 1])
    axis = Figure().subplots().yaxis
    show_range(axis, values)
    low, high = axis.get_view_interval()
    assert (low, high) == pytest.approx((1.8, 2.2))
    axis.set_view_interval(0, 1, ignore=True)
    show_range(axis, np.array([2.0, 2.1]))
    assert tuple(axis.get_view_interval()) == (0, 1)


def test_labels_of_measures_are_phrases() -> None:
    result = hs.sweep("dfcs", {"F0": [22.0, 30.0]}, "steady")
    assert label_of(result, "amplitude.x") == "amplitude of x"
