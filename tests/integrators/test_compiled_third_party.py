"""A compiled method in a package of its own, in docs/examples, compared with closed forms and the scenes."""

from __future__ import annotations

import ast
import json
import math
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from integrators.order_conditions import density, order, stages, trees
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs
from hybridsim.integrators import contract
from hybridsim.integrators.registry import registered
from hybridsim.testing import SCENES, Scene, outcome

FOLDER = Path(__file__).parents[2] / "docs" / "examples" / "compiled_method"
FILE = FOLDER / "dormand_prince.py"
MODES = {1: "slip+", -1: "slip-", 0: "stick"}
SAMPLE = (
    "NOS-osc",
    "twisting",
    "graze-miss",
    "double-root",
    "ball-accumulation",
    "stepped-load",
    "round-wall",
    "FREE-1",
)

RUN = """
import json, sys
import hybridsim as hs
assert "dormand-prince" in [one.name for one in hs.list_integrators()]
sol = hs.simulate("dfcs", (0.0, 0.03), integrator="dormand-prince", rtol=1e-8)
json.dump([[e.t for e in sol.events], [e.target for e in sol.events], sol.y[:, -1].tolist()], sys.stdout)
"""


@pytest.fixture(scope="module")
def module() -> Any:
    """The file as a module, under the name by which numba stores its code."""
    sys.path.insert(0, str(FOLDER))
    try:
        import dormand_prince
    finally:
        sys.path.remove(str(FOLDER))
    return dormand_prince


def test_it_is_one_short_file_that_imports_the_contract_alone() -> None:
    text = FILE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 250
    assert [path.name for path in FOLDER.glob("*.py")] == [FILE.name]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            assert not any(one.name.startswith("hybridsim") for one in node.names)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hybridsim"):
            assert (node.module, [one.name for one in node.names]) == ("hybridsim.integrators", ["contract"])
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "contract":
            assert node.attr in contract.__all__, f"{node.attr} is not public"


@pytest.mark.parametrize("tree", [tree for size in range(1, 6) for tree in sorted(trees(size))], ids=str)
def test_the_order_conditions_of_pair_and_interpolant(module: Any, tree: Any) -> None:
    size, weights = order(tree), stages(tree, module.A)
    wanted = 1.0 / density(tree)
    assert module.A[-1] @ weights == pytest.approx(wanted, abs=1e-14)
    if size <= 4:
        assert (module.A[-1] - module.E) @ weights == pytest.approx(wanted, abs=1e-14)
        theta = np.array([0.2, 0.5, 0.9, 1.0])
        values = (theta[:, None] ** np.arange(1, 5)) @ module.P @ weights
        assert values == pytest.approx(theta**size * wanted, abs=1e-13)


def test_it_runs_the_oscillator_as_the_closed_form_does_in_compiled_code(
    module: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P1 over 100 periods: 401 mode changes in order, times within 1e-6 T; the stepper takes hardly a segment."""
    model = hs.load("dfcs").with_(omega="0.6*sqrt(k/m)", F0=30)
    p = model.parameter_values()
    period, limit = 2 * math.pi / p["omega"], p["mu"] * p["N"]
    motion = Oscillator(p["m"], p["c"], p["k"], limit, limit, p["F0"], p["omega"]).run(0, 100 * period, 0)
    starts, start = [0], module.DormandPrince.start

    def counted(*arguments: Any) -> Any:
        starts[0] += 1
        return start(*arguments)

    monkeypatch.setattr(module.DormandPrince, "start", counted)
    with registered(module.DormandPrince) as name:
        sol = hs.simulate(model, (0.0, 100 * period), integrator=name, rtol=1e-9)
    assert (sol.status, sol.warnings, len(sol.events)) == ("finished", (), 401)
    assert [e.target for e in sol.events] == [MODES[c.mode] for c in motion.changes]
    for event, change in zip(sol.events, motion.changes, strict=True):
        assert abs(event.t - change.t) <= 1e-6 * period
        assert abs(event.x_plus[0] - change.x) <= 1e-6 * limit / p["k"]
        assert event.x_plus[1] == 0.0
    assert starts[0] <= 5


def test_it_is_found_by_its_entry_point_and_runs_without_the_compiler(tmp_path: Path) -> None:
    project = tomllib.loads((FOLDER / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (places,) = project["entry-points"].items()
    record = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    record.mkdir()
    (record / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0.1\n")
    lines = "".join(f"{name} = {place}\n" for name, place in places[1].items())
    (record / "entry_points.txt").write_text(f"[{places[0]}]\n{lines}")
    paths = [str(tmp_path), str(FOLDER), *filter(None, [os.environ.get("PYTHONPATH")])]
    found = []
    for jit in "01":
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", RUN],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "HYBRIDSIM_JIT": jit},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    (times, targets, end), (others, other_targets, other_end) = found
    assert len(times) > 5 and targets == other_targets
    assert times == pytest.approx(others, rel=1e-9) and end == pytest.approx(other_end, rel=1e-7)


@pytest.mark.parametrize(
    "scene",
    [pytest.param(s, marks=[] if s.name in SAMPLE else [pytest.mark.slow], id=s.name) for s in SCENES],
)
def test_it_passes_the_conformance_suite(module: Any, scene: Scene) -> None:
    result = outcome(module.DormandPrince, scene)
    assert result.verdict == ("lacks" if "stiff" in scene.needs else "right"), "\n".join(result.reasons)
