"""What each command does when all is well: what it prints, what it writes, and that JSON says the same."""

from __future__ import annotations

import csv
import importlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.cli import values

PNG = b"\x89PNG"


def test_run_says_how_it_went(hybridsim: Callable) -> None:
    code, out, err = hybridsim("run", "dfcs", "--t-end", "5T", "--integrator", "scipy-dop853")
    assert (code, err) == (0, "")
    for part in ("dfcs", "scipy-dop853", "finished", "slip+", "slip-", "stick", "x = ", "steps"):
        assert part in out


def test_run_says_why_auto_took_the_integrator(hybridsim: Callable) -> None:
    _, chosen, _ = hybridsim("run", "dfcs", "--t-end", "5T")
    assert "exact, chosen because its modes are linear in the states\n" in chosen
    _, named, _ = hybridsim("run", "dfcs", "--t-end", "5T", "--integrator", "exact")
    assert "integrator   exact\n" in named


def test_run_as_json_is_the_solution(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("run", "dfcs", "--t-end", "5T", "--rtol", "1e-8", "--json")
    assert code == 0
    record = json.loads(out)
    model = hs.load("dfcs")
    solution = hs.simulate(model, tuple(record["t_span"]), rtol=1e-8)
    assert record["t_span"][1] == pytest.approx(5 * 2 * 3.141592653589793 / record["parameters"]["omega"])
    assert record["final"] == dict(zip(("x", "v"), solution.y[:, -1], strict=True))
    assert [event["t"] for event in record["events"]] == [event.t for event in solution.events]
    assert record["stats"]["steps"] == solution.stats["steps"]
    shares = record["modes"]["f"]
    assert set(shares) == {"slip+", "slip-", "stick"}
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)


def test_run_with_changed_parameters_and_start(hybridsim: Callable) -> None:
    argv = ("-p", "F0=22", "-p", "omega=0.64*sqrt(k/m)", "--x0", "x=1e-4", "--t-end", "0.01", "--json")
    code, out, _ = hybridsim("run", "dfcs", *argv)
    assert code == 0
    record = json.loads(out)
    assert record["parameters"]["F0"] == 22
    assert record["parameters"]["omega"] == pytest.approx(0.64 * (1e5 / 0.2) ** 0.5, rel=1e-15)
    model = hs.load("dfcs").with_(F0=22, omega="0.64*sqrt(k/m)")
    solution = hs.simulate(model, (0.0, 0.01), x0={"x": 1e-4})
    assert record["final"]["x"] == solution.y[0, -1]


def test_end_time_may_be_an_expression_of_parameters(hybridsim: Callable) -> None:
    ends = []
    for text in ("3T", "6*pi/omega"):
        code, out, _ = hybridsim("run", "dfcs", "--t-end", text, "--json")
        assert code == 0
        ends.append(json.loads(out)["t_span"][1])
    assert ends[0] == pytest.approx(ends[1], rel=1e-15)


def test_run_writes_what_was_asked_for(hybridsim: Callable, tmp_path: Path) -> None:
    code, _, err = hybridsim("run", "dfcs", "--t-end", "2T", "--plot", "out.png", "--csv", "out.csv")
    assert code == 0
    assert err.splitlines() == ["hybridsim: wrote out.csv", "hybridsim: wrote out.png"]
    assert (tmp_path / "out.png").read_bytes().startswith(PNG)
    with (tmp_path / "out.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {"t", "x", "v", "f"} <= set(rows[0])
    assert float(rows[-1]["t"]) == pytest.approx(2 * 2 * 3.141592653589793 / (0.6 * (1e5 / 0.2) ** 0.5))


def test_run_writes_tables_of_equal_steps(hybridsim: Callable, tmp_path: Path) -> None:
    argv = ("--csv", "out.csv", "--npz", "out.npz", "--points", "11")
    code, _, err = hybridsim("run", "dfcs", "--t-end", "2T", *argv)
    assert code == 0
    assert err.splitlines() == ["hybridsim: wrote out.csv", "hybridsim: wrote out.npz"]
    assert len((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()) == 12
    with np.load(tmp_path / "out.npz") as data:
        assert np.diff(data["t"]) == pytest.approx(np.full(10, data["t"][-1] / 10))
        assert len(data["x"]) == 11 and len(data["events/t"]) > 1


@pytest.mark.parametrize("suffix", ["pdf", "svg"])
def test_other_pictures(suffix: str, hybridsim: Callable, tmp_path: Path) -> None:
    code, _, _ = hybridsim("run", "dfcs", "--t-end", "1T", "--plot", f"out.{suffix}")
    assert code == 0
    assert (tmp_path / f"out.{suffix}").stat().st_size > 1000


def test_a_picture_without_a_name_is_named_after_the_model(hybridsim: Callable, tmp_path: Path) -> None:
    code, _, err = hybridsim("run", "dfcs", "--plot", "--t-end", "1T", "--save", "saved.hsol")
    assert (code, err.splitlines()[-1]) == (0, "hybridsim: wrote saved.hsol")
    code, _, _ = hybridsim("resume", "saved.hsol", "--t-end", "2T", "--plot")
    assert code == 0
    assert {path.name for path in tmp_path.glob("*.png")} == {"dfcs.png", "saved.png"}


def test_run_with_options_of_the_integrator(hybridsim: Callable) -> None:
    argv = ("--integrator", "rk4-dichotomy", "--option", "stick_velocity=zero", "--json")
    counts = []
    for steps in (300, 600):
        code, out, _ = hybridsim(
            "run", "dfcs", "--t-end", "5T", *argv, "--option", f"steps_per_period={steps}"
        )
        assert code == 0
        counts.append(json.loads(out)["stats"]["rhs_evaluations"])
    assert counts[0] < counts[1]


def test_run_of_a_file(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "fall.toml").write_text(
        'schema = 1\nname = "fall"\n[states]\n'
        'h = { start = 5, der = "w" }\nw = { start = 0, der = "-10" }\n'
        '[monitors.ground]\nexpr = "h"\ndirection = "down"\naction = "terminate"\n'
    )
    code, out, _ = hybridsim("run", "fall.toml", "--t-end", "7", "--json")
    assert code == 0
    record = json.loads(out)
    assert record["status"] == "terminated"
    assert record["t_span"][1] == pytest.approx(1.0, rel=1e-12)


def test_a_simulation_that_fails_exits_with_1_and_says_where(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text(
        'schema = 1\nname = "lift"\n[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-f" }\n'
        '[contacts.f]\nvelocity = "v"\nnormal = "1 - t"\nlaw = { name = "coulomb", mu = 0.1 }\n'
    )
    code, out, err = hybridsim("run", "lift.toml", "--t-end", "3", "--csv", "out.csv")
    assert code == 1
    assert "inconsistent" in out and "inconsistent" in err
    assert "normal" in err and "Traceback" not in err
    assert (tmp_path / "out.csv").exists(), "what was computed is kept"


def test_compare_prints_a_table_and_writes_its_files(hybridsim: Callable, tmp_path: Path) -> None:
    argv = (
        "--integrators",
        "scipy-dop853,rk4-dichotomy",
        "--rtol",
        "1e-4,1e-8",
        "--steps",
        "300",
        "--repeat",
        "1",
    )
    code, out, err = hybridsim("compare", "dfcs", "--t-end", "5T", *argv, "--out", "chart")
    assert code == 0, err
    assert "scipy-dop853" in out and "rk4-dichotomy" in out
    assert (tmp_path / "chart" / "chart.png").read_bytes().startswith(PNG)
    with (tmp_path / "chart" / "table.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert sum(row["integrator"] == "scipy-dop853" for row in rows) == 2
    record = json.loads((tmp_path / "chart" / "comparison.json").read_text(encoding="utf-8"))
    assert len(record["rows"]) == len(rows)
    assert all(f"wrote chart/{name}" in err for name in ("table.csv", "comparison.json", "chart.png"))


def test_compare_as_json_goes_to_a_folder_named_after_the_model(hybridsim: Callable, tmp_path: Path) -> None:
    argv = ("--integrators", "scipy-dop853", "--rtol", "1e-6", "--repeat", "1", "--json")
    code, out, _ = hybridsim("compare", "dfcs", "--t-end", "2T", *argv)
    assert code == 0
    assert len(json.loads(out)["rows"]) == 1
    assert (tmp_path / "compare-dfcs" / "chart.png").exists()


def test_check_prints_the_automaton(hybridsim: Callable) -> None:
    code, out, err = hybridsim("check", "dfcs")
    assert (code, err) == (0, "")
    for part in (
        "mode slip+ (linear)",
        "mode stick",
        "while mu*N - f >= 0",
        "to the admissible mode of slip+, slip-",
        "selected together",
        "operations",
    ):
        assert part in out


def test_check_follows_resets_and_conditions(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("check", "bouncing-ball")
    assert code == 0
    assert "if -e*w >= v_rest: to flight with h := 0, w := -e*w" in out


@pytest.mark.parametrize("name", [info.name for info in hs.list_models()])
def test_check_of_every_model(name: str, hybridsim: Callable) -> None:
    code, out, err = hybridsim("check", name, "--json")
    assert (code, err) == (0, "")
    record = json.loads(out)
    assert record["name"] == name
    assert hybridsim("check", name).code == 0


def test_models(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("models")
    assert code == 0
    _, listed, _ = hybridsim("models", "--json")
    names = [info["name"] for info in json.loads(listed)]
    assert names == [info.name for info in hs.list_models()]
    assert all(name in out for name in names)


def test_laws(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("models", "--laws")
    assert code == 0
    _, listed, _ = hybridsim("models", "--laws", "--json")
    laws = {info["name"]: info for info in json.loads(listed)}
    assert all(name in out for name in laws)
    assert laws["lugre"]["states"] == ["z"]
    assert laws["coulomb"]["parameters"] == ["mu"]


def test_integrators(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("integrators")
    assert code == 0
    _, listed, _ = hybridsim("integrators", "--json")
    found = json.loads(listed)
    assert [each["name"] for each in found] == [each.name for each in hs.list_integrators()]
    flat = " ".join(out.split())
    for each in found:
        assert each["when"] and " ".join(each["when"].split()) in flat
        for capability, reason in each["lacks"].items():
            assert f"lacks {capability}: {' '.join(reason.split())}" in flat


def test_clearing_the_cache_leaves_folders_of_others(
    hybridsim: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder whose name alone is like ours was made by somebody else."""
    monkeypatch.setenv("HYBRIDSIM_CACHE", str(tmp_path))
    drawing = tmp_path / "engine-0123" / "drawing.txt"
    drawing.parent.mkdir()
    drawing.write_text("of a steam engine")
    assert hybridsim("cache", "clear").code == 0
    assert drawing.read_text() == "of a steam engine"


def test_cache_path_and_clear(hybridsim: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from hybridsim.engine.native.cache import kernel_folder, store

    root = tmp_path / "cache"
    monkeypatch.setenv("HYBRIDSIM_CACHE", str(root))
    assert hybridsim("cache", "path").out == f"{root}\n"
    made = kernel_folder()
    assert made is not None and made.parent == root
    store(made / "m.bin", b"x" * 1000)
    (root / "mine.txt").write_text("not of hybridsim")
    others = root / "engine-0123"
    others.mkdir()
    (others / "drawing.txt").write_text("of a steam engine")
    (root / "elsewhere").mkdir()
    (root / "elsewhere" / "kept.txt").write_text("what a link leads to")
    (root / "engine-link").symlink_to("elsewhere")
    code, _, err = hybridsim("cache", "clear")
    assert code == 0 and "deleted 0.0 MB" in err
    assert f"{others} was not deleted" in err and str(made) not in err
    assert not made.exists()
    left = {str(path.relative_to(root)) for path in root.rglob("*")}
    assert left == {
        "mine.txt",
        "engine-0123",
        "engine-0123/drawing.txt",
        "elsewhere",
        "elsewhere/kept.txt",
    } | {"engine-link"}


def test_default_spans_are_those_of_the_library() -> None:
    library = importlib.import_module("hybridsim.analysis.compare.comparison_request")
    assert (values.COMPARED_PERIODS, values.DEFAULT_SECONDS) == (library._PERIODS, library._TIME)


def test_one_integrator_with_its_options(hybridsim: Callable) -> None:
    code, out, _ = hybridsim("integrators", "rk4-dichotomy")
    assert code == 0
    assert "--option steps_per_period=... (a number; default 1200)" in out
    assert "--option stick_velocity=... (one of kept, zero; default kept)" in out
    assert "cvode" not in out
    _, listed, _ = hybridsim("integrators", "rk4-dichotomy", "--json")
    (record,) = json.loads(listed)
    option = record["options"][4]
    assert (option["name"], option["kind"], option["default"]) == ("max_bisections", "a whole number", 16)
    assert "no options" in hybridsim("integrators", "cvode-bdf").out


def test_an_unknown_integrator_is_bad_usage(hybridsim: Callable) -> None:
    code, out, err = hybridsim("integrators", "cvode-bfd")
    assert (code, out) == (2, "")
    assert "did you mean 'cvode-bdf'" in err


def test_run_lasts_as_long_as_the_model_says(hybridsim: Callable) -> None:
    ends = []
    for argv in (["bouncing-ball"], ["bouncing-ball", "--t-end", "1"], ["thermostat", "-p", "tau=1"]):
        code, out, _ = hybridsim("run", *argv, "--json")
        assert code == 0
        ends.append(json.loads(out)["t_span"][1])
    assert ends == [3.0, 1.0, 4.0]


def test_steady_calls_the_sliding_of_a_surface_by_its_name(hybridsim: Callable) -> None:
    """Its share of the period is that of its own mode, and it has no work of friction; a contact has both."""
    _, of_surface, _ = hybridsim("steady", "relay-control")
    assert "100 % of the period in sliding, 0 stops per period\n" in of_surface
    assert "stick" not in of_surface
    _, of_contact, _ = hybridsim("steady", "dfcs")
    assert "% of the period in stick, 2 stops per period, work 0.0316" in of_contact


def test_steady_says_on_stderr_why_it_found_nothing(hybridsim: Callable) -> None:
    code, out, err = hybridsim("steady", "bouncing-ball", "--max-periods", "4")
    assert code == 1 and "Steady state" not in err
    assert err.startswith("hybridsim: ") and err.strip().removeprefix("hybridsim: ") in out


def test_a_folder_without_a_name_is_refused(hybridsim: Callable) -> None:
    code, out, err = hybridsim("compare", "dfcs", "--out", "")
    assert (code, out) == (2, "") and "the folder name is empty" in err
