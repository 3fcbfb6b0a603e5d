"""`hybridsim sweep`: values from the command line, data and picture in the folder, exit codes."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

import hybridsim as hs

FINAL = ("--measure", "final.x", "--t-end", "2T")


def test_a_grid_fills_its_folder(hybridsim: Callable, tmp_path: Path) -> None:
    code, out, err = hybridsim("sweep", "dfcs", "F0=22:30:3", "N=30,40", *FINAL, "--out", "o", "--workers", 2)
    assert code == 0, err
    assert "6 of 6 points: ok" in out and "final.x" in out
    with (tmp_path / "o" / "sweep.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["F0"], row["N"]) for row in rows[1:3]] == [("22.0", "40.0"), ("26.0", "30.0")]
    t_end = 2 * 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
    run = hs.simulate("dfcs", (0, t_end), params={"F0": 26, "N": 30})
    assert float(rows[2]["final.x"]) == run.y[0, -1]
    assert (tmp_path / "o" / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "o" / "sweep.json").read_text(encoding="utf-8"))["values"]


def test_processes_give_the_bits_of_threads(hybridsim: Callable, tmp_path: Path) -> None:
    sweep = ("sweep", "dfcs", "F0=22:30:3", *FINAL)
    for how in ("processes", "workers"):
        code, _, err = hybridsim(*sweep, "--out", how, f"--{how}", 2)
        assert code == 0, err
    one, two = ((tmp_path / how / "sweep.csv").read_bytes() for how in ("processes", "workers"))
    assert one == two
    assert "ProcessPool" in (tmp_path / "processes" / "sweep.json").read_text(encoding="utf-8")
    code, _, err = hybridsim(*sweep, "--processes", 2, "--workers", 2)
    assert code == 2 and "--processes cannot be combined with --workers" in err


class Breaking(ThreadPoolExecutor):
    """A pool whose worker ends after the first batch, as a process that the system kills."""

    batches = 0

    def submit(self, *args: Any, **options: Any) -> Future[Any]:
        self.batches += 1
        if self.batches > 1:
            raise BrokenProcessPool("a process was terminated")
        return super().submit(*args, **options)


def test_points_of_a_killed_process_run_again(
    hybridsim: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The finished points stay in the journal, and the same command completes the table."""
    argv = ("sweep", "dfcs", "F0=22:30:3", *FINAL, "--out", "o", "--processes", 1)
    with monkeypatch.context() as patched:
        patched.setattr("hybridsim.cli.commands.sweep._pool", lambda processes: Breaking(processes))
        code, out, err = hybridsim(*argv)
    assert code == 1
    assert "1 of 3 points: ok" in out
    assert (
        "2 of 3 points failed: the executor lost the batch" in err
        and "again to compute the missing points" in err
    )
    assert (tmp_path / "o" / "sweep.journal").exists()
    code, out, err = hybridsim(*argv)
    assert code == 0 and "3 of 3 points: ok" in out and "continuing from" in err
    assert not (tmp_path / "o" / "sweep.journal").exists()


def test_readings_of_the_last_period(hybridsim: Callable) -> None:
    code, out, err = hybridsim(
        "sweep", "dfcs", "F0=22,30", "--measure", "amplitude.x", "--after", 40, "--json"
    )
    assert code == 0, err
    period = 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
    for load, amplitude in zip((22.0, 30.0), json.loads(out)["values"]["amplitude.x"], strict=True):
        x = hs.simulate("dfcs", (0, 40 * period), params={"F0": load}, keep="last-period").y[0]
        # it turns where v is zero: at events
        assert amplitude == pytest.approx(0.5 * (x.max() - x.min()), rel=1e-12)
    code, _, err = hybridsim("sweep", "dfcs", "F0=22,30", *FINAL, "--after", 40)
    assert code == 2 and "--after cannot be combined with measures of a whole run" in err


def test_json_lists_expressions_and_ratios(hybridsim: Callable) -> None:
    argv = (
        "sweep",
        "dfcs",
        "m=0.1:0.4:3:log",
        "omega=0.5*sqrt(k/m),300,(1+2)*100",
        "--list",
        "--json",
        "--measure",
        "final.x",
        "--t-end",
        "0.03",
    )
    code, out, err = hybridsim(*argv)
    assert code == 0, err
    found = json.loads(out)
    assert found["axes"]["m"] == pytest.approx([0.1, 0.2, 0.4], rel=1e-15)
    assert found["axes"]["omega"] == ["0.5*sqrt(k/m)", "300", "(1+2)*100"]
    assert found["mode"] == "list" and len(found["values"]["final.x"]) == 3


def test_a_point_that_fails_is_told_and_only_all_of_them_are_a_failure(hybridsim: Callable) -> None:
    code, out, err = hybridsim("sweep", "dfcs", "m=0.2,0", *FINAL, "--json")
    assert code == 0 and "1 of 2 points failed: " in err
    assert json.loads(out)["status"][0] == "ok"
    code, out, err = hybridsim("sweep", "dfcs", "m=0,-0*1", *FINAL)
    assert code == 1 and "of 2 points" in err


@pytest.mark.parametrize(
    "argv, message",
    [
        (["F0"], "NAME=VALUE"),
        (["F=1,2"], "did you mean 'F0'"),
        (["F0=1:2"], "FROM:TO:COUNT"),
        (["F0=1:2:0"], "FROM:TO:COUNT"),
        (["F0=0:2:3:log"], "above zero"),
        (["F0=1:q:3"], "q"),
        (["F0=1,,2"], "F0"),
        (["F0=1", "F0=2"], "twice"),
        (["F0=1", "--over", "N"], "--over: the sweep does not vary 'N'"),
        (["F0=1", "--t-end", "3"], "--t-end requires a measure of a whole run"),
        (["F0=1", "--measure", "amplitude.y"], "amplitude.x"),
        (["F0=1,2", "N=1", "--list", *FINAL], "different lengths"),
        (["omega=300,400", *FINAL], "--t-end 2T depends on the swept parameter omega"),
        (
            ["m=0.1:0.3:3", "--measure", "final.x", "--t-end", "m"],
            "--t-end m depends on the swept parameter m",
        ),
        (["F0=1", "--workers", "0"], "--workers"),
    ],
)
def test_bad_usage(hybridsim: Callable, argv: list[str], message: str) -> None:
    code, out, err = hybridsim("sweep", "dfcs", *argv)
    assert (code, out) == (2, ""), err
    assert message in err


def test_a_sweep_that_is_refused_leaves_no_folder(hybridsim: Callable, tmp_path: Path) -> None:
    code, _, err = hybridsim("sweep", "dfcs", "F0=20:30:3", "--measure", "amplitude.q", "--out", "q")
    assert code == 2 and "amplitude.q" in err
    assert not (tmp_path / "q").exists()


@pytest.mark.parametrize(
    ("end", "rate", "want"),
    [('duration = "2*R"', "1", [2.0, 2.0]), ("", "cos(R*t)", [math.sin(2.0), math.sin(6.0) / 3.0])],
)
def test_the_end_of_a_model_that_depends_on_what_is_swept_is_refused(
    end: str, rate: str, want: list[float], hybridsim: Callable, tmp_path: Path
) -> None:
    model = tmp_path / "d.toml"
    model.write_text(
        f"""schema = 1\nname = "d"\n{end}\nparameters = {{ R = 2 }}\nstates.x = {{ start = 0, der = "{rate}" }}\n"""
    )
    code, out, err = hybridsim("sweep", model, "R=1,3", "--measure", "final")
    assert (
        code == 2
        and "the end of the runs depends on the swept parameter R" in err
        and "--t-end" in err
        and not out
    )
    code, out, err = hybridsim("sweep", model, "R=1,3", "--measure", "final", "--t-end", "2", "--json")
    assert code == 0, err
    assert json.loads(out)["values"]["final.x"] == pytest.approx(want, rel=1e-6)
