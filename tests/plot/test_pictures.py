"""The pictures draw what the solution holds, label it rightly, and leave matplotlib as it was."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text
from plot.fake_solution import FakeEvent, FakeInterval, ball, oscillator, oscillator_model

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.plot import friction_loop, phase_portrait, save, time_history
from hybridsim.plot.shared.smooth_parts import Window, smooth_parts_of

PERIOD = 2 * math.pi / oscillator_model().parameter_values()["omega"]


def drawn(axes) -> np.ndarray:
    """Points of the solid curve of a time history, (k, 2)."""
    return max((line.get_xydata() for line in axes.get_lines()), key=len)


def test_time_history_draws_the_states_and_outputs() -> None:
    solution = oscillator(3)
    history = time_history(solution)
    assert [axes.get_ylabel() for axes in history.quantities] == [
        "x [mm]",
        "v [mm/s]",
        "friction force\nf [N]",
    ]
    assert history.modes.get_xlabel() == "time t [ms]"
    for i, axes in enumerate(history.quantities[:2]):
        t, y = drawn(axes).T
        assert y == pytest.approx(solution(t)[i], nan_ok=True)
    assert {text.get_text() for text in history.modes.get_legend().get_texts()} == {"slip+", "slip-", "stick"}


@pytest.mark.parametrize("count", [3, 4, 7])
def test_the_legend_of_modes_covers_no_label_of_the_time_axis(count: int) -> None:
    """Also if it is higher than the strip, and the last label stands at the end of the axis."""
    whole = oscillator(3)
    names = [f"mode{k}" for k in range(count)]
    times = np.linspace(whole.t[0], whole.t[-1], count + 1)
    intervals = tuple(FakeInterval(n, a, b) for n, a, b in zip(names, times[:-1], times[1:], strict=True))
    component = hs.Component("c", [hs.Mode(name) for name in names], initial=names[0])
    model = replace(oscillator_model(), components=[component])
    solution = replace(whole, model=model, modes={"c": intervals})
    strip = time_history(solution, t_span=(0, times[-1])).modes
    strip.set_xticks([times[-1]], ["a long label"])
    strip.figure.draw_without_rendering()
    (label,) = strip.get_xticklabels()
    assert not strip.get_legend().get_window_extent().overlaps(label.get_window_extent())


def test_outputs_are_drawn_beside_many_states() -> None:
    states = [hs.State(f"x{k}", float(k), "0") for k in range(6)]
    model = hs.Model("many", states, outputs=[hs.Output("total", "x0 + x5")])
    history = time_history(hs.simulate(model, (0.0, 1.0)))
    assert [axes.get_ylabel() for axes in history.quantities] == [
        *(rf"x$_{{\mathregular{{{k}}}}}$" for k in range(4)),
        "total",
    ]


def test_titles_of_states_and_outputs_stand_on_the_axes() -> None:
    states = [hs.State("theta", 1, "w", "rad", title="angle"), hs.State("w", 0, "-theta", "rad/s")]
    outputs = [hs.Output("a", "-theta", "rad/s^2", title="angular acceleration")]
    sol = hs.simulate(hs.Model("swing", states, outputs=outputs), (0.0, 1.0))
    labels = [axes.get_ylabel() for axes in time_history(sol).quantities]
    assert labels == ["angle\nθ [rad]", "w [rad/s]", "angular acceleration\na [rad/s²]"]
    assert phase_portrait(sol).get_xlabel() == "angle θ [rad]"


def test_quantities_of_one_unit_share_a_panel_if_they_are_three() -> None:
    units = {"w1": "rad/s", "w2": "rad/s", "u": "", "w3": "rad/s"}
    states = [
        hs.State(name, k, "0", unit, title=f"speed of disc {k}")
        for k, (name, unit) in enumerate(units.items())
    ]
    shared, alone = time_history(hs.simulate(hs.Model("discs", states), (0.0, 1.0))).quantities
    assert [drawn_at.get_ydata()[0] for drawn_at in shared.get_lines()[:3]] == [0, 1, 3]
    assert len({line.get_color() for line in shared.get_lines()[:3]}) == 3
    assert shared.get_ylabel() == "speed of disc\n[rad/s]" and alone.get_ylabel() == "speed of disc 2\nu"
    whole = shared.figure
    whole.draw_without_rendering()
    title = next(text for text in shared.findobj(Text) if text.get_text() == "discs")
    assert not shared.get_legend().get_window_extent().overlaps(title.get_window_extent())
    apart = time_history(hs.simulate(hs.Model("discs", states), (0.0, 1.0)), ["w1", ["w2", "w3"]])
    assert len(apart.quantities) == 2


def test_a_panel_of_several_units_has_no_unit_and_keeps_its_power_of_ten() -> None:
    states = [hs.State("x", 2e-6, "0", "m"), hs.State("v", 4e-6, "0", "m/s"), hs.State("u", 3e-6, "0")]
    sol = hs.simulate(hs.Model("small", states), (0.0, 1.0))
    for panel in (["x", "v"], ["u", "x"]):
        (axes,) = time_history(sol, [panel]).quantities
        assert axes.get_ylabel() == "[$10^{-6}$]"
        assert axes.yaxis.get_major_formatter()(2e-6) in ("2", "2.0", "2.00")


def test_equal_units_have_equal_scales_in_a_phase_portrait() -> None:
    circle = [hs.State("x", 1, "y"), hs.State("y", 0, "-x")]
    assert phase_portrait(hs.simulate(hs.Model("circle", circle), (0, 7))).get_aspect() == 1.0
    flat = [hs.State("x", 1, "100*y"), hs.State("y", 0, "-x/100")]
    assert phase_portrait(hs.simulate(hs.Model("flat", flat), (0, 7))).get_aspect() == "auto"
    assert phase_portrait(oscillator(2)).get_aspect() == "auto"


def test_a_component_with_one_mode_has_no_strip() -> None:
    sol = hs.simulate("gear-rattle", (0, 1))
    assert all(len(component.modes) == 1 for component in sol.components)
    assert time_history(sol).modes is None


def test_modes_of_one_colour_are_told_apart_by_their_components() -> None:
    """Two surfaces that hold in modes of different names are black in both."""
    whole = oscillator(2)
    spans = {"f": FakeInterval("held", 0.0, whole.t_end), "g": FakeInterval("locked", 0.0, whole.t_end)}
    whole = replace(whole, modes={name: (span,) for name, span in spans.items()})
    colours = {"held": "#222222", "locked": "#222222"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hybridsim.plot.shared.style.mode_colours", lambda components: colours)
        legend = time_history(whole, ["x"]).modes.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["held (f)", "locked (g)"]


def test_long_runs_show_their_last_periods_and_say_so() -> None:
    axes = time_history(oscillator(100)).quantities[0]
    assert axes.get_xlim() == pytest.approx((96 * PERIOD, 100 * PERIOD))
    assert axes.get_title(loc="left") == "Dry friction oscillator\nthe last 4 of 100 periods"
    assert len(drawn(axes)) < 10_000
    whole = time_history(oscillator(100), t_span=(0, 1)).quantities[0]
    assert whole.get_xlim() == (0, 1)
    assert whole.get_title(loc="left") == "Dry friction oscillator"


@pytest.mark.parametrize("periods", [100, 24.37, 23.5, 3.5])
@pytest.mark.parametrize("draw", [phase_portrait, friction_loop, time_history])
def test_titles_stay_within_the_picture(draw: Callable, periods: float) -> None:
    title = "A system whose title goes on and on, for as long as a title well may, and longer still than that"
    model = replace(oscillator_model(), title=title)
    picture = draw(oscillator(periods, model=model))
    axes = picture.quantities[0] if draw is time_history else picture
    title = axes.get_title(loc="left")
    assert title.replace("\n", " ").startswith(model.title)
    assert ("the last 4 of" in title) == (periods > 24)
    figure = axes.get_figure(root=True)
    figure.draw_without_rendering()
    (text,) = (one for one in axes.findobj(Text) if one.get_text() == title)
    box = text.get_window_extent()
    assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1


def test_many_events_without_a_period_show_the_last_unless_they_crowd() -> None:
    """A limit cycle of 12.001 with two events; bounces that accumulate say nothing by their last ones alone."""
    first = time_history(hs.simulate("belt", (0, 4000))).quantities[0]
    low, high = first.get_xlim()
    assert high == 4000 and 11 * 12.001 < high - low < 13 * 12.001
    assert first.get_title(loc="left").endswith("\nthe last 24 of 667 events")
    model = hs.load("bouncing-ball").with_(e="0.995")
    fallen = hs.simulate(model, (0, 300))
    assert len(fallen.events) > 300
    assert time_history(fallen).quantities[0].get_xlim() == (0, 300)


def test_a_curve_beside_another_has_no_colour_of_a_mode() -> None:
    """The modes of the switch are green and brown, which are colours of curves, too."""
    solution = hs.simulate("buck-converter", (0, 2e-3))
    panel, strip = time_history(solution, [["ramp", "control", "v"]])
    curves = {line.get_color() for line in panel.get_legend().get_lines()}
    modes = {to_hex(patch.get_facecolor()) for patch in strip.get_legend().get_patches()}
    assert len(curves) == 3 and len(modes) == 2 and not {curve.lower() for curve in curves} & modes


def test_a_jump_is_dashed_and_interrupts_the_curve() -> None:
    solution = ball()
    h, w = time_history(solution).quantities
    jumps = [line for line in w.get_lines() if line.get_linestyle() == "--" and len(line.get_xdata()) > 2]
    assert len(jumps) == 1
    t, values = jumps[0].get_xydata().T
    first = solution.events[0]
    assert (t[0], t[1]) == (first.t, first.t)
    assert (values[0], values[1]) == pytest.approx((first.x_minus[1], first.x_plus[1]))
    assert np.isnan(drawn(w)).any() and not np.isnan(drawn(h)).any()


def test_a_jump_of_an_input_is_dashed_without_an_event() -> None:
    force = hs.Input("F", "wave", shape="square", amplitude=2.0, period=1.0)
    moved = hs.Model("moved", [hs.State("x", 0, "F")], inputs=[force])
    (axes,) = time_history(hs.simulate(moved, (0, 1.2)), ["F"]).quantities
    solid, dashed = axes.get_lines()
    assert dashed.get_xdata() == pytest.approx([0.5, 0.5, math.nan, 1, 1, math.nan], nan_ok=True)
    assert dashed.get_ydata() == pytest.approx([2, -2, math.nan, -2, 2, math.nan], nan_ok=True)
    assert np.isnan(solid.get_ydata()).sum() == 2


def test_a_corner_of_an_input_does_not_cut_a_curve() -> None:
    """Also where the two lines that meet at a knot differ by rounding there."""
    knots = np.linspace(0, 1, 200) ** 1.1
    force = hs.Input("F", "table", times=knots.tolist(), values=np.sin(20 * knots).tolist())
    moved = hs.Model("moved", [hs.State("x", 0, "F")], inputs=[force])
    assert len(smooth_parts_of(hs.simulate(moved, (0, 1)), ["F"], Window(0, 1))) == 1


def test_curves_of_different_units_in_one_panel_have_their_own() -> None:
    states = [hs.State("x", 1, "v", unit="m"), hs.State("v", 0, "-2000*x", unit="m/s")]
    (axes,) = time_history(hs.simulate(hs.Model("two", states), (0, 1)), [["x", "v"]]).quantities
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["x [m]", "v [m/s]"]
    assert axes.get_ylabel() == ""
    assert axes.yaxis.get_major_formatter().factor == 1


def test_strips_show_the_modes_of_every_component() -> None:
    solution = oscillator(2)
    two = replace(solution, modes={**solution.modes, "g": (FakeInterval("stick", 0.0, solution.t_end),)})
    strip = time_history(two, ["x"]).modes
    assert [label.get_text() for label in strip.get_yticklabels()] == ["f", "g"]
    first, second = (bars.get_paths() for bars in strip.collections)
    assert len(first) == len(solution.modes["f"]) and len(second) == 1


def test_monitors_are_marked() -> None:
    solution = oscillator(2)
    crossing = FakeEvent(0.4 * PERIOD, "crossing", "", "", "", kind="monitor")
    axes = time_history(replace(solution, events=(*solution.events, crossing)), ["x"]).quantities[0]
    marked = [line for line in axes.get_lines() if line.get_marker() == "v"]
    assert [line.get_xdata()[0] for line in marked] == [crossing.t]


@pytest.mark.parametrize(
    "direction, names, label",
    [("up", ["x", "y"], "monitor half (up)"), ("both", [["x", "y"]], "monitor half")],
)
def test_the_triangles_of_monitors_are_named(direction: str, names: list, label: str) -> None:
    """The legend of the uppermost panel names them, behind the curves if these are named there."""
    states = [hs.State("x", 1, "y"), hs.State("y", 0, "-x")]
    model = hs.Model("circle", states, monitors=[hs.Monitor("half", "x - 0.5", direction=direction)])
    solution = hs.simulate(model, (0.0, 7.0))
    history = time_history(solution, names)
    legend = history.quantities[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [
        *(["x", "y"] if len(names) == 1 else []),
        label,
    ]
    assert legend.legend_handles[-1].get_marker() == "v"
    assert all(axes.get_legend() is None for axes in history.quantities[1:])
    history.quantities[0].figure.draw_without_rendering()
    title = next(text for text in history.quantities[0].findobj(Text) if text.get_text() == "circle")
    assert not legend.get_window_extent().overlaps(title.get_window_extent())
    before = time_history(solution, ["x"], t_span=(0.0, 1.0)).quantities[0]
    assert before.get_legend() is None


def test_phase_portrait_sets_stick_apart() -> None:
    axes = phase_portrait(oscillator(100))
    dots = [line for line in axes.get_lines() if line.get_marker() == "o"]
    assert len(dots) == 1 and dots[0].get_color() == "#222222"
    assert np.all(dots[0].get_ydata() == 0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [mm]", "v [mm/s]")


def test_friction_loop_is_thick_in_stick_and_dashed_in_jumps() -> None:
    axes = friction_loop(oscillator(100))
    assert axes.get_ylabel() == "friction force\nf [N]"
    widths = {
        round(float(c.get_linewidth()[0]), 1) for c in axes.collections if isinstance(c, LineCollection)
    }
    assert widths == {1.2, 3.0, 0.9}
    assert [t.get_text() for t in axes.get_legend().get_texts()] == ["slip+", "slip-", "stick", "jump"]


def test_an_open_contact_has_its_own_colour_in_an_orbit() -> None:
    axes = phase_portrait(hs.simulate("feeny-moon", (0, 40)))
    assert "f: open" in [text.get_text() for text in axes.get_legend().get_texts()]


def test_arrows_show_the_direction_of_an_orbit() -> None:
    circle = [hs.State("x", 1, "y"), hs.State("y", 0, "-x")]  # clockwise
    axes = phase_portrait(hs.simulate(hs.Model("circle", circle), (0, 3)))
    (arrow,) = (text for text in axes.texts if text.arrow_patch)
    (x0, y0), (x1, y1) = arrow.get_position(), arrow.xy
    assert x0 * y1 - x1 * y0 < 0


def test_a_colour_that_shows_the_first_of_several_components_names_it() -> None:
    axes = phase_portrait(hs.simulate("relay-spiral", (0, 20)), "x", "y")
    shown = {text.get_text() for text in axes.get_legend().get_texts()}
    assert {"u: above", "u: below"} <= shown <= {"u: above", "u: below", "sliding"}


def test_axes_of_the_caller_are_used() -> None:
    figure = Figure()
    x, f, modes = figure.subplots(3)
    history = time_history(oscillator(2), ["x", "f"], axes=[x, f, modes])
    assert history.quantities == (x, f) and history.modes is modes
    axes = Figure().subplots()
    assert phase_portrait(ball(), axes=axes) is axes
    assert friction_loop(oscillator(2), axes=axes) is axes


def test_nothing_global_is_touched() -> None:
    before = dict(matplotlib.rcParams)
    time_history(oscillator(2))
    phase_portrait(ball())
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize(
    "draw, message",
    [
        (lambda: time_history(oscillator(2), ["y"]), "has no quantity 'y'"),
        (lambda: time_history(oscillator(2), ["x"], axes=[]), "0 axes"),
        (lambda: time_history(hs.simulate("gear-rattle", (0, 1)), []), "a panel has no quantity"),
        (lambda: time_history(oscillator(2), ["x", []]), "a panel has no quantity"),
        (lambda: time_history(oscillator(2), t_span=(5, 6)), "outside the run"),
        (lambda: time_history(oscillator(2), t_span=(1e-3, 1e-3)), "no curve from t = 0.001 to 0.001"),
        (lambda: hs.simulate("dfcs", (1, 1)).plot(), "no curve from t = 1 to 1"),
        (lambda: phase_portrait(hs.simulate("belt", (2, 2))), "no curve from t = 2 to 2"),
        (lambda: friction_loop(ball()), "no outputs"),
        (lambda: phase_portrait(oscillator(2), "x", "w"), "has no quantity 'w'"),
        (lambda: save(phase_portrait(ball()), "picture.jpg"), "picture.jpg"),
        (lambda: time_history(oscillator(2).model), "Model oscillator.* cannot be drawn"),
    ],
)
def test_what_cannot_be_drawn_says_why(draw, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        draw()


def test_what_a_surface_switches_can_be_drawn() -> None:
    """It is neither a state nor an output, and `output` knows it."""
    solution = hs.simulate("relay-control", (0, 1))
    assert "u" not in {output.name for output in solution.model.outputs}
    line = time_history(solution, ["u"]).quantities[0].lines[0]
    t, u = line.get_xdata(), line.get_ydata()
    inside = np.isfinite(u) & ~np.isin(t, solution.event_times("u"))
    assert inside.sum() > 10 and (u[inside] == solution.output("u", t[inside])).all()


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_save(tmp_path, suffix: str) -> None:
    path = save(time_history(oscillator(2)), tmp_path / f"run.{suffix}")
    assert path.stat().st_size > 10_000
    save(phase_portrait(ball()), path)
    save(phase_portrait(ball()).figure, path)


def test_of_several_contacts_the_modes_are_those_of_the_one_that_is_drawn() -> None:
    """The second of two bodies never sticks while the first one always does."""
    states = [hs.State(f"{kind}{j}", 0, f"v{j}" if kind == "x" else None) for j in (1, 2) for kind in "x"]
    states += [hs.State("v1", 0, "0 - f1"), hs.State("v2", 1, "-x2 + 20*cos(t) - f2")]
    contacts = [
        hs.Contact(f"f{j}", velocity=f"v{j}", normal="1", law="coulomb", arguments={"mu": 0.5})
        for j in (1, 2)
    ]
    sol = hs.simulate(hs.Model("two", states=states, contacts=contacts), (0.0, 20.0))
    assert {i.mode for i in sol.modes["f1"]} == {"stick"}
    for axes, own in (
        (phase_portrait(sol, "x2", "v2"), "f2"),
        (friction_loop(sol, "f2", "x2"), "f2"),
        (phase_portrait(sol, "x1", "v1"), "f1"),
    ):
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        modes = {"jump", *(f"{own}: {i.mode}" for i in sol.modes[own])}
        assert set(labels) <= modes and labels, (labels, modes)
