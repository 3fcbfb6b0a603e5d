"""The examples of steps do what they say; the environment is one of gymnasium where that is installed."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def run(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(folder)
    return runpy.run_path(str(EXAMPLES / name))


def test_a_soft_torque_keeps_the_drill_turning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = run("plot_10_environment.py", tmp_path, monkeypatch)
    assert found["stops"]["constant"] > 3
    assert found["stops"]["soft"] == 0
    assert found["speeds"]["soft"][-1] == pytest.approx(found["DrillEnv"].target, abs=0.01)


def test_the_error_of_a_co_simulation_is_of_first_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = np.array(run("plot_11_cosimulation.py", tmp_path, monkeypatch)["errors"])
    assert errors[:-1] / errors[1:] == pytest.approx([2.0, 2.0, 2.0], rel=0.03)


def test_the_environment_passes_the_checks_of_gymnasium(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    run("plot_10_environment.py", tmp_path, monkeypatch)
    check_env(gymnasium.make("hybridsim/Drill-v0").unwrapped, skip_render_check=True)
