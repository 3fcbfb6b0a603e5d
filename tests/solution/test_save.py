"""What `save` keeps of a run: never other numbers than the whole run has, and never more than was asked for."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError
from hybridsim.engine.native.array_layout import BufferPool
from hybridsim.solution.block_arrays import put_together, taken_apart

DFCS = hs.load("dfcs")
PERIOD = 2 * math.pi / DFCS.parameter_values()["omega"]
SPAN = (0, 5.3 * PERIOD)
METHODS = ["exact", "taylor", "dop853", "scipy-rk45", "cvode-adams", "rk4-dichotomy", "rk4-sign"]


def rows(events: tuple[hs.Event, ...]) -> list[tuple]:
    return [(e.t, e.kind, e.component, e.guard, e.source, e.target, *e.x_minus, *e.x_plus) for e in events]


@pytest.fixture(scope="module", params=METHODS)
def whole(request: pytest.FixtureRequest) -> hs.Solution:
    return hs.simulate(DFCS, SPAN, integrator=request.param)


def again(whole: hs.Solution, **options) -> hs.Solution:
    return hs.simulate(DFCS, SPAN, integrator=whole.integrator, **options)


def test_events_alone(whole: hs.Solution) -> None:
    """All events and modes, the state at the end, no states between."""
    sol = again(whole, keep="events")
    assert rows(sol.events) == rows(whole.events)
    assert sol.modes == whole.modes
    assert (sol.t_start, sol.t_end) == SPAN
    assert sol.t.tolist() == [whole.t_end]
    assert (sol.y[:, 0] == whole.y[:, -1]).all()
    with pytest.raises(UsageError, match="keep='events'"):
        sol(sol.t_end)
    with pytest.raises(UsageError, match="keep='events'"):
        sol.output("f", 0.01)


@pytest.mark.parametrize("save", ["last-period", 0.7 * PERIOD])
def test_the_last_stretch(whole: hs.Solution, save: str | float) -> None:
    """It begins at its exact time, inside a step, and holds what the whole run holds there."""
    sol = again(whole, keep=save)
    length = PERIOD if save == "last-period" else save
    assert sol.t_start == sol.t[0] == pytest.approx(SPAN[1] - length, rel=1e-15)
    assert sol.t_end == sol.t[-1] == SPAN[1]
    assert rows(sol.events) == [row for row in rows(whole.events) if row[0] >= sol.t_start]
    assert 0 < len(sol.events) < len(whole.events)
    grid = np.linspace(sol.t_start, sol.t_end, 301)
    assert (sol(grid) == whole(grid)).all()
    assert (sol.t[1:] == whole.t[-len(sol.t) + 1 :]).all()
    assert (sol.y[:, 1:] == whole.y[:, -len(sol.t) + 1 :]).all()
    assert (sol.output("f", grid) == whole.output("f", grid)).all()
    for name, intervals in sol.modes.items():
        assert intervals[0].t0 == sol.t_start
        assert [i.mode for i in intervals] == [i.mode for i in whole.modes[name][-len(intervals) :]]
    with pytest.raises(UsageError, match="outside the part of the run that keep="):
        sol(0.5 * sol.t_start)


def test_nothing_but_the_end(whole: hs.Solution) -> None:
    sol = again(whole, keep="nothing")
    assert sol.t.tolist() == [whole.t_end]
    assert (sol.y[:, 0] == whole.y[:, -1]).all()
    counts = ("steps", "rejected", "rhs_evaluations", "guard_evaluations", "events", "restarts")
    assert [sol.stats[name] for name in counts] == [whole.stats[name] for name in counts]
    assert (sol.status, sol.message) == (whole.status, whole.message)
    for ask in (lambda: sol.events, lambda: sol.modes, lambda: sol.event_times("f"), lambda: sol(0.0)):
        with pytest.raises(UsageError, match="keep='nothing'"):
            ask()
    assert "not kept" in repr(sol)
    assert "finished" in sol._repr_html_()


def test_a_stretch_longer_than_the_run_is_the_run(whole: hs.Solution) -> None:
    sol = again(whole, keep=10 * SPAN[1])
    assert (sol.t == whole.t).all() and (sol.y == whole.y).all()
    assert rows(sol.events) == rows(whole.events)


def test_a_grid_in_the_last_stretch() -> None:
    grid = np.linspace(4.5 * PERIOD, SPAN[1], 11)
    sol = hs.simulate(DFCS, SPAN, keep="last-period", t_eval=grid)
    assert sol.t.tolist() == grid.tolist()
    assert (sol.y == hs.simulate(DFCS, SPAN, t_eval=grid).y).all()


def test_the_kept_times_lie_within_what_is_kept() -> None:
    """The first of them was rounded otherwise than the start of it: found by trial, one run in two thousand."""
    t0 = 1e-2 * (1 + 246 / 97)
    options = {"integrator": "rk4-dichotomy", "eps_v": 1e-9, "stick_velocity": "zero", "step": PERIOD / 7}
    sol = hs.simulate(DFCS, (t0, t0 + 40 * PERIOD), x0=[1.4e-4, -0.19], keep=10 * PERIOD, **options)
    assert (sol.t[0], sol.t[-1]) == (sol.t_start, sol.t_end)
    assert np.isfinite(sol(sol.t)).all()


def test_backward_in_time_the_last_stretch_is_the_earliest() -> None:
    model = hs.Model("turn", states=[hs.State("x", 1, "v"), hs.State("v", 0, "-x")])
    whole, sol = (hs.simulate(model, (10, 0), rtol=1e-10, keep=save) for save in ("all", 2.0))
    assert (sol.t_start, sol.t_end) == (2.0, 0.0)
    grid = np.linspace(2, 0, 41)
    assert (sol(grid) == whole(grid)).all()
    assert sol(grid)[0] == pytest.approx(np.cos(grid - 10), abs=1e-8)


def test_a_run_that_stops_early_keeps_the_last_stretch_before() -> None:
    ball = hs.load("bouncing-ball")
    end = hs.Monitor("slow", "w - 0.5", direction="down", action="terminate")
    model = hs.Model(
        "ended", ball.states, parameters=ball.parameters, components=ball.components, monitors=[end]
    )
    whole, sol = (hs.simulate(model, (0, 3), keep=save) for save in ("all", 0.2))
    assert sol.status == whole.status == "terminated"
    assert sol.t_end == whole.t_end < 3
    assert sol.t_start == pytest.approx(whole.t_end - 0.2, rel=1e-14)
    assert sol.events[-1].component == "slow"


def test_modes_out_of_events_with_transitions_at_both_ends() -> None:
    """A schedule changes a mode at t0, and another at the very end."""
    ticks = [hs.Schedule("tick", start=0, period=1, reset={"n": "n + 1"})]
    gate = hs.Component(
        "gate",
        modes=[
            hs.Mode("shut", guards=[hs.Guard("g", "0.5 - n", then="open")]),
            hs.Mode("open", guards=[hs.Guard("g", "2.5 - n", then="done")]),
            hs.Mode("done"),
        ],
        initial="shut",
    )
    model = hs.Model(
        "gated",
        states=[hs.State("x", 0, "1")],
        discrete=[hs.Discrete("n", 0)],
        components=[gate],
        schedules=ticks,
    )
    whole, sol = (hs.simulate(model, (0, 2), keep=save) for save in ("all", "events"))
    assert sol.modes == whole.modes
    assert [i.mode for i in sol.modes["gate"]] == ["open", "done"]


@pytest.mark.parametrize(
    ("save", "said"),
    [
        ("some", "`keep` cannot be 'some'"),
        (-1.0, "`keep` cannot be -1.0"),
        (0, "`keep` cannot be 0"),
        (math.nan, "`keep` cannot be nan"),
        (None, "`keep` cannot be None"),
        (True, "`keep` cannot be True"),
    ],
)
def test_what_save_cannot_be(save: object, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        hs.simulate(DFCS, (0, 0.01), keep=save)


def deprecated(call) -> hs.Solution:
    """The run of a call with the former name, after checking that the warning names the new one and this file."""
    with pytest.warns(DeprecationWarning, match=r"simulate\(save=\.\.\.\) is deprecated.*keep=") as caught:
        sol = call()
    assert [warning.filename for warning in caught] == [__file__]
    return sol


def test_the_former_name_does_the_same_and_warns() -> None:
    for call in (
        lambda: hs.simulate(DFCS, (0, 0.01), save="nothing"),
        lambda: hs.Simulator(DFCS).run((0, 0.01), save="nothing"),
        lambda: hs.simulate(hs.two_blocks_on_belt(), (0, 0.1), save="nothing"),
    ):
        with pytest.raises(UsageError, match="keep='nothing'"):
            _ = deprecated(call).events
    with pytest.raises(UsageError, match="has no argument 'sve'"):
        hs.Simulator(DFCS).run((0, 0.01), sve="all")


@pytest.mark.parametrize("keep", ["all", "events"])
def test_the_former_and_the_present_name_together_are_refused(keep: str) -> None:
    for call in (
        lambda: hs.simulate(DFCS, (0, 0.01), keep=keep, save="nothing"),
        lambda: hs.Simulator(DFCS).run((0, 0.01), keep=keep, save="nothing"),
        lambda: hs.simulate(hs.two_blocks_on_belt(), (0, 0.1), keep=keep, save="nothing"),
        lambda: hs.sweep(
            DFCS, {"F0": [30.0]}, "final.x", t_span=(0, 0.01), keep=keep, save="nothing", workers=1
        ),
        lambda: hs.steady_state(DFCS, keep=keep, save="nothing"),
    ):
        with pytest.raises(UsageError, match=rf"both save='nothing' and keep='{keep}'.*\n?.*remove `save`"):
            call()


def test_analyses_take_the_former_name_too() -> None:
    with pytest.warns(DeprecationWarning, match="Use keep="):
        found = hs.sweep(DFCS, {"F0": [30.0]}, "final.x", t_span=(0, 0.01), save="events", workers=1)
    assert found.status.tolist() == ["ok"]


def test_what_does_not_go_together() -> None:
    with pytest.raises(UsageError, match="no forcing period"):
        hs.simulate("bouncing-ball", (0, 1), keep="last-period")
    with pytest.raises(UsageError, match="`t_eval` needs the states"):
        hs.simulate(DFCS, (0, 0.01), keep="events", t_eval=[0.0])
    with pytest.raises(UsageError, match="`t_eval` contains times before"):
        hs.simulate(DFCS, (0, 1), keep=0.5, t_eval=[0.1, 0.9])


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "rk4-dichotomy"])
@pytest.mark.parametrize("save", ["last-period", "nothing"])
def test_memory_does_not_grow_with_the_run(
    integrator: str, save: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Eight times as many periods take as much memory, where the whole run would take eight times as much."""
    monkeypatch.setattr(
        BufferPool, "block", lambda self: np.empty(self.size, np.uint8)
    )  # none of former runs
    periods = {"taylor": 600, "dop853": 600, "rk4-dichotomy": 25}[integrator]

    def peak(count: int, keep: str) -> int:
        tracemalloc.start()
        sol = hs.simulate(DFCS, (0, count * PERIOD), integrator=integrator, keep=keep)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert sol.success and sol.stats["events"] >= 3 * count
        return found

    peak(periods, save)  # what the first run of all leaves in caches
    assert peak(8 * periods, save) < 1.5 * peak(periods, save)
    assert peak(8 * periods, "all") > 2 * peak(8 * periods, save)


def test_a_state_that_grows_from_zero_is_the_same_in_the_file(tmp_path: Path) -> None:
    """Near the start of a segment such a state is summed from its series, and not from modal coordinates."""
    states = [hs.State("x", 1, "-x"), hs.State("y", 0, "x + 0.1*sin(3*t)")]
    sol = hs.simulate(hs.Model("growth", states=states), (0, 2), integrator="exact")
    sol.save(tmp_path / "growth.hsol")
    loaded = hs.load_solution(tmp_path / "growth.hsol")
    times = np.array([1e-17, 1e-9, 1e-3, 0.3, 1.9])
    assert (loaded(times) == sol(times)).all()
    assert loaded(1e-17)[1] == pytest.approx(1e-17, rel=1e-12)


def test_closed_forms_of_earlier_versions_are_read(tmp_path: Path) -> None:
    """They have no tables for what is near a start."""
    sol = hs.simulate("dfcs", (0, 0.2), integrator="exact")
    blocks = [
        (kind, {name: array for name, array in arrays.items() if name not in ("flows", "near")})
        for kind, arrays in taken_apart(sol._segments.blocks)
    ]
    assert {kind for kind, _ in blocks} == {"tables", "closed-form"}
    found = put_together(sol._system, blocks)
    times = np.linspace(0.0, 0.2, 50)
    index, s = sol._of_model.segment_at(times, "+")
    assert np.allclose(found[0].states(index, s).T, sol(times), rtol=0.0, atol=1e-15)
