"""A run as a table: what every form holds is what the solution says."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError


@pytest.fixture(scope="module")
def rubbing() -> hs.Solution:
    """Stops and releases, a force that changes its formula with the mode, units."""
    return hs.simulate("dfcs", (0, 0.03))


@pytest.fixture(scope="module")
def pressed() -> hs.Solution:
    """Two components, a discrete state, jumps of a state, no units."""
    model = hs.Model(
        "file",  # as a state of that name is
        states=(hs.State("file", 1, "w"), hs.State("w", 0, "-9.81")),
        discrete=(hs.Discrete("n", 0),),
        components=(
            hs.Component(
                "ball", [hs.Mode("fly", guards=[hs.Guard("floor", "file", [hs.Choice("fly", reset=BOUNCE)])])]
            ),
            hs.Component(
                "light", [hs.Mode("on", set={"lit": 1}), hs.Mode("off", set={"lit": 0})], initial="off"
            ),
        ),
        schedules=(hs.Schedule("tick", start=0.25, period=0.5, reset={"n": "n + 1"}),),
    )
    return hs.simulate(model, (0, 2))


BOUNCE = {"file": 0, "w": "-0.9*w"}


def expected_modes(sol: hs.Solution, component: str) -> list[set[str]]:
    """For each row of ``sol.t`` the modes that the component may be in: two where it changes."""
    return [{i.mode for i in sol.modes[component] if i.t0 <= t <= i.t1} for t in sol.t]


@pytest.mark.parametrize("name", ["rubbing", "pressed"])
def test_the_rows_are_the_times_of_the_solution(name: str, request: pytest.FixtureRequest) -> None:
    sol: hs.Solution = request.getfixturevalue(name)
    table = sol.table()
    assert (table.t == sol.t).all()
    for quantity, values in table.columns.items():
        assert (values == sol.output(quantity)).all(), quantity
    assert [*table.columns][: len(sol.names)] == list(sol.names)
    for component in sol.modes:
        modes = table.mode_names(component)
        assert all(m in allowed for m, allowed in zip(modes, expected_modes(sol, component), strict=True))


def test_an_event_has_a_row_on_each_side(rubbing: hs.Solution, pressed: hs.Solution) -> None:
    table = rubbing.table()
    for event in rubbing.events:
        before, after = np.flatnonzero(table.t == event.t)
        assert (table.mode_names("f")[[before, after]] == [event.source, event.target]).all()
    table = pressed.table()
    ticks = [e for e in pressed.events if e.component == "tick"]
    assert len(ticks) == 4
    for k, event in enumerate(ticks):
        assert table.columns["n"][table.t == event.t].tolist() == [k, k + 1]
    impact = pressed.events[1]
    before, after = np.flatnonzero(table.t == impact.t)
    assert table.columns["w"][after] == -0.9 * impact.x_minus[1] == impact.x_plus[1]
    assert table.columns["w"][before] == impact.x_minus[1]


def test_on_equal_steps(rubbing: hs.Solution) -> None:
    table = rubbing.table(points=11)
    grid = np.linspace(0, 0.03, 11)
    assert (table.t == grid).all()
    assert (table.columns["v"] == rubbing(grid)[1]).all()
    assert (table.columns["f"] == rubbing.output("f", grid)).all()
    for t, mode in zip(grid, table.mode_names("f"), strict=True):
        assert [i.mode for i in rubbing.modes["f"] if i.t0 <= t][-1] == mode, "right-continuous"


def test_on_the_grid_of_the_run_and_backward() -> None:
    grid = [0.02, 0.001, 0.01]
    sol = hs.simulate("dfcs", (0, 0.03), t_eval=grid)
    assert sol.table().t.tolist() == grid
    assert (sol.table().columns["x"] == sol.y[0]).all()
    decay = hs.Model("decay", states=(hs.State("x", 1, "-x"),), outputs=(hs.Output("twice", "2*x"),))
    back = hs.simulate(decay, (1, 0))
    assert back.table(3).t.tolist() == [1.0, 0.5, 0.0]
    assert back.table(3).columns["twice"] == pytest.approx(2 * np.exp([0.0, 0.5, 1.0]), rel=1e-8)
    assert (back.table().columns["twice"] == 2 * back.y[0]).all()


@pytest.mark.parametrize("points", [1, 0, -3])
def test_too_few_points(points: int, rubbing: hs.Solution) -> None:
    with pytest.raises(UsageError, match=f"`points` cannot be {points}"):
        rubbing.table(points)


def test_csv(rubbing: hs.Solution, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rubbing.to_csv(path)
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["t", "x", "v", "f", "mode(f)"]
    for name in ("t", "x", "v", "f"):
        values = rubbing.t if name == "t" else rubbing.output(name)
        assert [float(row[name]) for row in rows] == values.tolist(), "all digits"
    assert [row["mode(f)"] for row in rows] == rubbing.table().mode_names("f").tolist()
    rubbing.to_csv(path, points=5)
    assert len(path.read_text().splitlines()) == 6


def test_npz(pressed: hs.Solution, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    pressed.to_npz(path)
    with np.load(path, allow_pickle=False) as data:
        assert (data["t"] == pressed.t).all()
        assert (data["file"] == pressed.y[0]).all(), "a name that numpy.savez keeps for itself"
        assert set(data["mode(light)"]) == {"off"}
        assert (data["events/t"] == [e.t for e in pressed.events]).all()
        assert data["events/kind"].tolist() == [e.kind for e in pressed.events]
        assert data["events/target"].tolist() == [e.target for e in pressed.events]
        assert (data["events/w-"] == [e.x_minus[1] for e in pressed.events]).all()
        assert (data["events/w+"] == [e.x_plus[1] for e in pressed.events]).all()
        about = json.loads(data["about.json"])
    assert about["model"] == "file" and about["integrator"] == "exact" and about["units"] == {}
    pressed.to_npz(path, points=7)
    with np.load(path) as data:
        assert len(data["t"]) == len(data["n"]) == len(data["mode(ball)"]) == 7
        assert len(data["events/t"]) == len(pressed.events)


def test_pandas(rubbing: hs.Solution) -> None:
    frame = rubbing.to_pandas()
    assert frame.index.name == "t" and (frame.index == rubbing.t).all()
    assert list(frame.columns) == ["x", "v", "f", "mode(f)"]
    assert (frame["v"] == rubbing.y[1]).all()
    assert frame["mode(f)"].dtype == "category"
    assert set(frame["mode(f)"].cat.categories) == {"stick", "slip+", "slip-"}
    assert (frame["mode(f)"] == rubbing.table().mode_names("f")).all()
    assert frame.attrs["units"] == {"t": "s", "x": "m", "v": "m/s", "f": "N"}
    assert frame.attrs["model"] == "dfcs" and frame.attrs["status"] == "finished"
    assert len(rubbing.to_pandas(points=9)) == 9
    stuck = frame[frame["mode(f)"] == "stick"]
    assert (stuck["v"] == 0.0).all() and (abs(stuck["f"]) <= 20.0 * (1 + 1e-12)).all()


def test_xarray(rubbing: hs.Solution) -> None:
    data = rubbing.to_xarray()
    assert (data["t"] == rubbing.t).all() and (data["x"] == rubbing.y[0]).all()
    assert data["t"].attrs["units"] == "s" and data["f"].attrs["units"] == "N"
    assert (data["mode(f)"] == rubbing.table().mode_names("f")).all()
    assert "mode(f)" in data.coords and set(data.data_vars) == {"x", "v", "f"}
    assert data.attrs["integrator"] == "exact" and data.attrs["model"] == "dfcs"
    even = rubbing.to_xarray(points=301)
    assert float(even["x"].sel(t=0.01, method="nearest")) == even["x"].values[100]
    assert float(abs(even["v"].where(even["mode(f)"] == "stick")).max()) == 0.0


def test_a_unit_that_is_not_declared_is_not_given(pressed: hs.Solution) -> None:
    data = pressed.to_xarray()
    assert "units" not in data["w"].attrs and "units" not in data["t"].attrs


def test_events_in_pandas(pressed: hs.Solution) -> None:
    frame = pressed.events_to_pandas()
    assert list(frame.columns) == [
        "t", "kind", "component", "guard", "source", "target", "direction", "file-", "w-", "file+", "w+",
    ]  # fmt: skip
    assert frame["t"].tolist() == [e.t for e in pressed.events]
    impacts = frame[frame["component"] == "ball"]
    assert (impacts["guard"] == "floor").all() and len(impacts) > 1
    assert (impacts["w+"] == -0.9 * impacts["w-"]).all()
    free = hs.simulate(hs.Model("m", states=(hs.State("x", 1, "-x"),)), (0, 1))
    assert len(free.events_to_pandas()) == 0 and "x+" in free.events_to_pandas()


def test_a_run_that_stopped_before_its_first_step(tmp_path: Path) -> None:
    broken = hs.Model("broken", states=(hs.State("x", 1, "1/t"),))
    sol = hs.simulate(broken, (0, 1))
    assert not sol.success and sol.t.tolist() == [0.0]
    assert sol.to_pandas()["x"].tolist() == sol.to_xarray()["x"].values.tolist() == [1.0]
    sol.to_npz(tmp_path / "run.npz")


@pytest.mark.parametrize(("method", "library"), [("to_pandas", "pandas"), ("to_xarray", "xarray")])
def test_without_the_library(
    method: str, library: str, rubbing: hs.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)  # as if it were not installed
    with pytest.raises(UsageError, match=f"{library} is not installed") as caught:
        getattr(rubbing, method)()
    assert f"pip install {library}" in str(caught.value)
