"""Sweeps: each point is what a single run gives, whoever runs it and in whatever order, and none ends the others."""

from __future__ import annotations

import csv
import json
import math
import multiprocessing
import os
import subprocess
import sys
import threading
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from analysis.swept import SPAN, end, fall, height, longer

import hybridsim as hs
from hybridsim.analysis.sweep.work.batches import Batches

F0, OMEGA = [22.0, 30.0, 38.0, 40.0], [350.0, 424.0, 500.0]
GRID = {"F0": F0, "omega": OMEGA}


class Backwards(Executor):
    """Works alone, last in first out, and counts how much waits for it."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future, object]] = []
        self.most = 0
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        with self._lock:
            self.waiting.append((future, lambda: fn(*args, **kwargs)))
            self.most = max(self.most, len(self.waiting))
            if self._timer is None:
                self._timer = threading.Timer(0.01, self._work)
                self._timer.start()
        return future

    def _work(self) -> None:
        with self._lock:
            waiting, self.waiting, self._timer = self.waiting, [], None
        for future, work in reversed(waiting):
            future.set_result(work())


@cache
def by_threads() -> hs.Sweep:
    return hs.sweep("dfcs", GRID, end)


def same(one: hs.Sweep, other: hs.Sweep) -> bool:
    """Whether two sweeps hold the same bits."""
    return (
        list(one.values) == list(other.values)
        and all(one[name].tobytes() == other[name].tobytes() for name in one.values)
        and (one.status == other.status).all()
    )


def test_each_point_is_a_run_of_its_own() -> None:
    found, model = by_threads(), hs.load("dfcs")
    assert found.dimensions == ("F0", "omega") and found["events"].shape == (4, 3)
    assert found["state"].shape == (4, 3, 2)
    for i, load in enumerate(F0[:2]):
        for j, omega in enumerate(OMEGA):
            run = hs.simulate(model, SPAN, params={"F0": load, "omega": omega})
            assert found["x"][i, j] == run.y[0, -1]
            assert found["state"][i, j].tolist() == run.y[:, -1].tolist()
            assert found["events"][i, j] == len(run.events)


def test_a_point_that_fails_leaves_its_status_and_all_the_others() -> None:
    found = by_threads()
    assert set(found.status[3]) == {"RuntimeError: too heavy for this"}
    assert set(found.status[2]) == {"not a number: x"}
    assert np.isnan(found["x"][2:]).all() and np.isnan(found["events"][3]).all()
    assert np.isfinite(found["state"][2]).all()
    assert found.failed.tolist() == [[False] * 3, [False] * 3, [True] * 3, [True] * 3]
    assert "3 of 12 points: RuntimeError: too heavy" in repr(found)
    assert list(found.problems()) == [("not a number: x", 3), ("RuntimeError: too heavy for this", 3)]


def test_a_sweep_without_any_result_has_its_readings_all_the_same() -> None:
    found = hs.sweep("dfcs", {"c": [-200.0, -300.0]}, ["amplitude.x", "kind"])
    assert found.failed.all()
    assert np.isnan(found["amplitude.x"]).all()
    assert found["kind"].tolist() == ["not settled", "not settled"]  # they grow without bound
    found = hs.sweep("dfcs", {"m": [0.0]}, ["amplitude.x", "kind"])
    assert found.failed.all()
    assert np.isnan(found["amplitude.x"]).all() and found["kind"].tolist() == [""]
    ends = hs.sweep("dfcs", {"m": [0.0]}, "final.x", t_span=(0, 0.1))
    assert ends.failed.all() and np.isnan(ends["final.x"]).all()


def test_the_same_by_any_executor() -> None:
    expected = by_threads()
    assert same(hs.sweep("dfcs", GRID, end, workers=1), expected)
    with ThreadPoolExecutor(3) as threads:
        assert same(hs.sweep("dfcs", GRID, end, executor=threads), expected)
    backwards = Backwards()
    assert same(hs.sweep("dfcs", GRID, end, executor=backwards, workers=2), expected)
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as processes:
        assert same(hs.sweep("dfcs", GRID, end, executor=processes), expected)
        chained = hs.sweep("dfcs", GRID, longer, executor=processes, warm_start=True)
    assert same(chained, hs.sweep("dfcs", GRID, longer, warm_start=True))


def test_few_pieces_are_under_way_at_a_time() -> None:
    backwards = Backwards()
    found = hs.sweep(
        "dfcs", {"F0": np.arange(2000.0)}, lambda m: m.parameters[5].value.text, executor=backwards, workers=2
    )
    assert backwards.most <= 4
    assert found["value"].tolist() == [f"{load!r}" for load in np.arange(2000.0).tolist()]


def test_pieces_hold_every_point_once() -> None:
    for total, chains, workers in ((1, None, 4), (1000, None, 3), (60, 12, 2), (7, 1, 2)):
        batches, seen = Batches(total, chains, workers), []
        while (piece := batches.next()) is not None:
            seen += piece
            batches.learn(len(piece), 1e-5 * len(piece))
        assert sorted(seen) == list(range(total))


def test_batches_take_long_enough_to_outweigh_their_cost() -> None:
    """At 1e-4 s a point, batches of 0.01 s to 0.1 s have 100 to 1000 points; the first sizes grow towards that."""
    batches, sizes = Batches(3000, None, 2), []
    while (piece := batches.next()) is not None:
        sizes.append(len(piece))
        batches.learn(len(piece), 1e-4 * len(piece))
    assert len(sizes) < 20 and sizes[0] == 1 and max(sizes) <= 1000
    assert min(sizes[4:-1]) >= 100


def test_chains_run_along_the_first_axis() -> None:
    loads = [1.0, 2.0, -3.0, 4.0, 5.0]
    found = hs.sweep("dfcs", {"F0": loads, "omega": OMEGA}, longer, warm_start=True)
    a = math.sin(1.0)
    d = math.sin(4.0)  # after a point that failed a chain begins anew
    expected = [a, math.sin(2.0) + 0.5 * a, math.nan, d, math.sin(5.0) + 0.5 * d]
    for column in found["value"].T:
        assert column == pytest.approx(expected, rel=1e-15, nan_ok=True)
    listed = hs.sweep("dfcs", {"F0": loads}, longer, mode="list", warm_start=True)
    assert listed["value"] == pytest.approx(expected, rel=1e-15, nan_ok=True)


def test_lists_and_expressions() -> None:
    def measure(model: hs.Model) -> dict[str, float]:
        return model.parameter_values()

    listed = hs.sweep("dfcs", {"F0": [1, 2], "omega": ["sqrt(k/m)", 3]}, measure, mode="list")
    assert listed.dimensions == ("point",) and listed["F0"].tolist() == [1.0, 2.0]
    assert listed.axes["omega"].tolist() == [math.sqrt(1e5 / 0.2), 3.0] == listed["omega"].tolist()
    both = hs.sweep("dfcs", {"k": [1e5, 4e5], "omega": ["sqrt(k/m)", 3]}, measure)
    assert both.axes["omega"].tolist() == ["sqrt(k/m)", "3.0"]
    assert both["omega"][:, 0].tolist() == [math.sqrt(1e5 / 0.2), math.sqrt(4e5 / 0.2)]
    through = hs.sweep("dfcs", {"m": [0.2, 0.8], "F0": ["omega"]}, measure)
    assert through.axes["F0"].tolist() == ["omega"]
    assert through["F0"][:, 0] == pytest.approx([0.6 * math.sqrt(1e5 / 0.2), 0.6 * math.sqrt(1e5 / 0.8)])


def test_an_expression_without_a_value_is_the_fault_of_its_point() -> None:
    found = hs.sweep("dfcs", {"m": ["0.2", "0*k", "1/(k - k)"], "F0": [1.0]}, _load)
    assert found.status[0, 0] == "ok" and found.axes["m"][0] == 0.2 and math.isnan(found.axes["m"][2])
    assert all(text.startswith("ExpressionError") for text in found.status[1:, 0])
    with pytest.raises(hs.ExpressionError, match="unknown name 'mv'"):
        hs.sweep("dfcs", {"m": ["mv"]}, _load)


def test_initial_values_and_options() -> None:
    def start(model: hs.Model, factor: float) -> dict[str, complex]:
        return {"x": factor * model.start_values()["x"], "z": 1j * model.parameter_values()["N"]}

    found = hs.sweep("dfcs", {"x": [1e-4, "2*m"], "N": [30.0]}, start, params={"m": 0.3}, factor=2.0)
    assert found["x"][:, 0].tolist() == [2e-4, 1.2]
    assert found.axes["x"].tolist() == [1e-4, 0.6] and found.units["x"] == "m" and found.units["N"] == "N"
    assert found["z"].tolist() == [[30j], [30j]]


def test_what_points_return_need_not_be_alike() -> None:
    def ragged(model: hs.Model) -> object:
        n = int(model.parameter_values()["F0"])
        return {"a": list(range(n)), "s": "odd"} if n % 2 else {"b": 1.0, "a": n}

    first = hs.sweep("dfcs", {"F0": [2, 3, 1]}, ragged, workers=1)
    assert list(first.values) == ["b", "a", "s"]
    assert first["a"].tolist()[1] == [0, 1, 2] and first["s"].tolist() == ["", "odd", "odd"]
    nan = math.nan
    assert first["a"][[0, 2]] == pytest.approx(np.array([[2, nan, nan], [0, nan, nan]]), nan_ok=True)
    assert same(first, hs.sweep("dfcs", {"F0": [2, 3, 1]}, ragged, executor=Backwards(), workers=4))


@pytest.mark.parametrize("executor", [None, "backwards"])
def test_an_interruption_keeps_what_was_computed(executor: str | None) -> None:
    def stop(done: int, total: int, what: str) -> None:
        if done >= 3:
            raise KeyboardInterrupt

    chosen = Backwards() if executor else None
    found = hs.sweep("dfcs", {"F0": np.arange(1.0, 5000.0)}, _load, executor=chosen, progress=stop)
    ran = found.status == "ok"
    assert found.interrupted and 3 <= ran.sum() < 4999
    assert (found["value"][ran] == np.arange(1.0, 5000.0)[ran]).all()
    assert set(found.status[~ran]) == {"not run"} and np.isnan(found["value"][~ran]).all()


def _load(model: hs.Model) -> float:
    return model.parameter_values()["F0"]


def test_progress_goes_up_to_the_end() -> None:
    seen: list[tuple[int, int, str]] = []
    hs.sweep("dfcs", {"F0": range(1, 300)}, _load, progress=lambda *told: seen.append(told))
    counts = [done for done, _, _ in seen]
    assert counts == sorted(counts) and seen[-1] == (299, 299, "299 of 299 points")


def test_files(tmp_path: Path) -> None:
    found = by_threads()
    found.to_csv(tmp_path / "sweep.csv")
    with open(tmp_path / "sweep.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["F0", "omega", "x", "state[0]", "state[1]", "events", "status"]
    assert [float(row["x"]) for row in rows[:6]] == found["x"].ravel()[:6].tolist()
    assert rows[4]["F0"] == "30.0" and rows[4]["omega"] == "424.0"
    assert rows[11] == {**rows[11], "x": "nan", "status": "RuntimeError: too heavy for this"}
    read = json.loads(found.to_json(tmp_path / "sweep.json"))
    assert read == json.loads((tmp_path / "sweep.json").read_text(encoding="utf-8"))
    assert read["values"]["x"][3] == [None] * 3 and read["values"]["state"][0] == found["state"][0].tolist()
    assert read["axes"] == {"F0": F0, "omega": OMEGA} and read["provenance"]["model"] == "dfcs"


@pytest.mark.parametrize("mode", ["grid", "list"])
def test_a_result_with_the_name_of_another_column_is_kept(mode: str, tmp_path: Path) -> None:
    """The user's own status, and a result with the name of an axis, a dimension or an item of an array."""

    def own(model: hs.Model) -> dict[str, object]:
        values = {"status": 7.0, "F0": 8.0, "error": 9.0, "point": 10.0, "v[1]": 11.0}
        return {**values, "v": np.array([12.0, 13.0])}

    found = hs.sweep("dfcs", {"F0": [1, 2]}, own, mode=mode)
    found.to_csv(tmp_path / "sweep.csv")
    with open(tmp_path / "sweep.csv", encoding="utf-8") as file:
        row = next(csv.DictReader(file))
    assert {name: row[name] for name in ("F0", "F0_", "status", "status_", "error", "point")} == {
        "F0": "1.0", "F0_": "8.0", "status": "ok", "status_": "7.0", "error": "9.0", "point": "10.0"
    }  # fmt: skip
    assert (row["v[0]"], row["v[1]"], row["v[1]_"]) == ("12.0", "11.0", "13.0")
    assert list(found.to_pandas().columns) == list(row)
    data = found.to_xarray()
    assert data["status_"].values.tolist() == [7.0, 7.0] and data["status"].values.tolist() == ["ok", "ok"]
    assert data["F0"].values.tolist() == [1.0, 2.0] and data["F0_"].values.tolist() == [8.0, 8.0]
    assert found["status"].tolist() == [7.0, 7.0]


def test_labelled_arrays() -> None:
    data = by_threads().to_xarray()
    assert data["x"].dims == ("F0", "omega") and data["state"].dims == ("F0", "omega", "item of state")
    assert float(data["x"].sel(F0=30, omega=424)) == by_threads()["x"][1, 1]
    assert data["omega"].attrs["units"] == "rad/s"
    assert str(data["status"][3, 0].item()).startswith("RuntimeError")
    listed = hs.sweep("dfcs", {"F0": [1, 2], "omega": [3, 4]}, _load, mode="list").to_xarray()
    assert listed["value"].dims == ("point",) and listed["omega"].values.tolist() == [3.0, 4.0]


def test_data_frame() -> None:
    """One row for each point, in the order of the grid: the second axis runs fastest."""
    found = hs.sweep("dfcs", {"F0": [1, 2], "omega": [3, 4, 5]}, _load)
    frame = found.to_pandas()
    assert list(frame.columns) == ["F0", "omega", "value", "status"]
    assert frame["F0"].tolist() == frame["value"].tolist() == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    assert frame["omega"].tolist() == [3.0, 4.0, 5.0] * 2 and set(frame["status"]) == {"ok"}
    assert frame.attrs["units"]["omega"] == "rad/s" and frame.attrs["model"] == "dfcs"
    failed = by_threads().to_pandas()
    assert failed["status"][9:].tolist() == ["RuntimeError: too heavy for this"] * 3  # those of the last load
    assert failed["x"].isna().tolist() == (failed["status"] != "ok").tolist()
    assert list(failed.columns) == ["F0", "omega", "x", "state[0]", "state[1]", "events", "status"]


@pytest.mark.parametrize(
    "given, message",
    [
        ({"values": {"F": [1]}}, "did you mean 'F0'"),
        ({"values": {}}, "`values` cannot be"),
        ({"values": {"F0": []}}, "the list of values of F0 is empty"),
        ({"values": {"F0": 3.0}}, "use a list of numbers"),
        ({"values": {"F0": [math.inf]}}, "finite"),
        ({"values": {"F0": [None]}}, "a value of F0 cannot be None"),
        ({"values": {"F0": [1, 2], "N": [1]}, "mode": "list"}, "F0 2, N 1"),
        ({"mode": "cloud"}, "`mode` cannot be 'cloud'"),
        ({"workers": 0}, "`workers` cannot be 0"),
        ({"executor": 3}, "get_executor"),
        ({"measure": 3}, "`measure` cannot be 3"),
        ({"progress": 3}, "`progress` cannot be 3"),
    ],
)
def test_what_cannot_be_asked_for(given: dict[str, object], message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        hs.sweep("dfcs", **({"values": {"F0": [1.0]}, "measure": _load} | given))


def test_an_expression_that_is_none() -> None:
    with pytest.raises(hs.ExpressionError):
        hs.sweep("dfcs", {"F0": ["2*"]}, _load)


def test_what_is_no_measurement_is_a_status() -> None:
    found = hs.sweep("dfcs", {"F0": [1.0]}, lambda model: {"a": object()})
    assert "the measure returned a value of type object for a" in found.status[0] and found.values == {}
    with pytest.raises(hs.UsageError, match="no 'a'"):
        found["a"]


def test_what_cannot_be_sent_to_a_process_is_refused_with_a_remedy() -> None:
    with (
        ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes,
        pytest.raises(hs.UsageError, match=r"(?s)measure of the sweep cannot be sent .*remove `executor`"),
    ):
        hs.sweep("dfcs", {"F0": [1.0]}, lambda model: 1.0, executor=processes)


def test_models_of_python_functions_go_where_their_functions_can_be_imported() -> None:
    model = hs.Model("ball", states={"h": 1.0, "w": 0.0}, parameters={"g": 9.81}, flow=fall)
    gravity = [1.62, 9.81]
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as processes:
        found = hs.sweep(model, {"g": gravity}, height, executor=processes)
        assert found["value"] == pytest.approx([1.0 - g / 8.0 for g in gravity], rel=1e-9)
        lost = hs.Model("ball", states={"h": 1.0}, flow=lambda t, x, p: (1.0,), parameters={"g": 1.0})
        with pytest.raises(hs.UsageError, match="the model of the sweep cannot be sent"):
            hs.sweep(lost, {"g": gravity}, height, executor=processes)


def test_a_pool_that_breaks_loses_its_points_and_says_so() -> None:
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    found = hs.sweep("dfcs", {"F0": [1.0, 2.0]}, _load, executor=pool)
    assert all(text.startswith("the executor lost the batch: RuntimeError") for text in found.status)


# A cluster has threads and event loops of its own, whose last words at exit are no warnings of ours.
_ON_A_CLUSTER = """
import sys, warnings
import distributed
from analysis.swept import end, longer
import hybridsim as hs

if __name__ == "__main__":
    grid = {"F0": [22.0, 30.0, 38.0, 40.0], "omega": [350.0, 424.0, 500.0]}
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True
    ) as cluster, distributed.Client(cluster) as client:
        with warnings.catch_warnings(), client.get_executor() as executor:
            warnings.simplefilter("error")
            there = hs.sweep("dfcs", grid, end, executor=executor)
            chained = hs.sweep("dfcs", grid, lambda m, p: longer(m, p), executor=executor, warm_start=True)
    here = hs.sweep("dfcs", grid, end), hs.sweep("dfcs", grid, longer, warm_start=True)
    for one, other in zip((there, chained), here):
        assert list(one.values) == list(other.values)
        assert (one.status == other.status).all()
        for name in one.values:
            assert one[name].tobytes() == other[name].tobytes(), name
    print("same", there.executor)
"""


def test_the_same_by_a_dask_cluster(tmp_path: Path) -> None:
    pytest.importorskip("distributed")  # an optional dependency, which the test extra brings
    script = tmp_path / "cluster.py"
    script.write_text(_ON_A_CLUSTER, encoding="utf-8")
    tests = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": tests},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "same ClientExecutor (2)\n"
