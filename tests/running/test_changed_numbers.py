"""A run with other numbers in `params` or `x0` is the run of a model that was written with these numbers."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.events.start import settled_start, start_by_kernel
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system_cache import system_of

LINEAR = """
[parameters]
m = 1.0
c = 0.2
k = 4.0
F0 = 3.0
mu = 0.3
N = 2.0
x1 = 0.5
on = 1.0
omega = "0.7*sqrt(k/m)"
[states]
x = { start = "x1", der = "v" }
v = { start = 0, der = "(F0*sin(omega*t) - c*v - (k*x if on > 0.5 else 2*k*x) - f)/m" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "coulomb", mu = "mu" }
"""
CURVED = LINEAR.replace("[states]", "n = 1.5\\n[states]".replace("\\n", "\n")).replace(
    "(k*x if", "(k*x*(1 + x**2)**n if"
)
TIMED = LINEAR + '[schedules.push]\ntimes = ["x1 + 1", "2/omega"]\nreset = { v = "v + x1" }\n'
# equal eigenvalues (c = 2 sqrt(k m)), resonance, zero damping, a switch, no load, no force, expressions for numbers
POINTS: list[dict[str, Any]] = [
    {}, {"F0": 2.5}, {"c": 4.0}, {"c": 0.0, "omega": 2.0}, {"c": 0.0}, {"on": 0.0}, {"N": 0.0}, {"F0": 0.0},
    {"k": 5.0}, {"m": "k/2"}, {"omega": 1.3}, {"x1": -0.25}, {"x1": "mu*m", "mu": 0.1}, {"k": 0.0, "omega": 1.0},
]  # fmt: skip
# through equal eigenvalues, resonance, zero damping and the loss of a coupling in steps of 1e-12
STEPS: list[dict[str, Any]] = [
    point
    for k in range(-3, 4)
    for point in (
        {"c": 4.0 + 1e-12 * k},
        {"c": 0.0, "omega": 2.0 + 1e-12 * k},
        {"c": 1e-12 * k},
        {"k": 1e-12 * k, "omega": 1.0},
        {"F0": 1e-12 * k},
    )
]
CASES = {
    "linear": (LINEAR, ("exact", "taylor"), POINTS),
    "steps": (LINEAR, ("exact",), STEPS),
    "curved": (CURVED, ("taylor", "dop853"), [*POINTS, {"n": 2.0}, {"n": 0.0}, {"n": "mu"}]),
    "timed": (TIMED, ("taylor",), POINTS),
}


def content(sol: hs.Solution) -> list[Any]:
    """What a run found, to the last bit, and the numbers that its model has."""
    events = [[e.t.hex(), e.kind, e.target, *(x.hex() for x in e.x_plus.tolist())] for e in sol.events]
    return [sol.status, events, [x.hex() for x in sol.y[:, -1].tolist()], sol.model.parameter_values()]


def anew(text: str, changes: dict[str, Any]) -> hs.Model:
    """The model read from a text in which these values stand."""
    return hs.Model.from_toml(hs.Model.from_toml(text).with_(**changes).to_toml())


def runs_of_models_with_these_numbers() -> list[Any]:
    """All runs, of models of their own, the last point first."""
    found = [
        content(hs.simulate(anew(text, point), (0, 8), integrator=name))
        for text, integrators, points in CASES.values()
        for name in integrators
        for point in reversed(points)
    ]
    return found


def test_other_numbers_are_those_of_a_model_written_with_them() -> None:
    """The other process has seen none of the runs of this one."""
    code = "import json, test_changed_numbers as t; print(json.dumps(t.runs_of_models_with_these_numbers()))"
    folders = [str(Path(__file__).parent), *sys.path]
    child = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(folders)},
        capture_output=True,
        text=True,
        check=True,
    )
    wanted = iter(json.loads(child.stdout))
    for text, integrators, points in CASES.values():
        model = hs.Model.from_toml(text)
        for name in integrators:
            found = [content(hs.simulate(model, (0, 8), integrator=name, params=p)) for p in points]
            for point, one in zip(reversed(points), reversed(found), strict=True):
                assert json.loads(json.dumps(one)) == next(wanted), (text, name, point)


def test_a_bad_number_is_refused_after_good_ones() -> None:
    """The message names the load, its value and the contact, as for a model that was never run."""
    model = hs.Model.from_toml(LINEAR)
    hs.simulate(model, (0, 1), params={"N": 3.0})
    for changes in ({"N": -1.0}, {"mu": -0.5}, {"k": -1.0}, {"m": 0.0}):
        with pytest.raises(hs.ModelError) as later:
            hs.simulate(model, (0, 1), params=changes)
        with pytest.raises(hs.ModelError) as first:
            anew(LINEAR, changes)
        assert str(later.value).splitlines()[0].split(": ", 1)[-1] in str(first.value)


def test_a_number_that_makes_a_model_nonlinear_is_noticed_after_good_ones() -> None:
    """The settings of the first run are known, and its method does not suit the second."""
    model = hs.Model("m", [hs.State("x", 1, "-x if q < 0.5 else -x**2")], parameters={"q": 0})
    for name in ("exact", "auto"):
        assert hs.simulate(model, (0, 1), integrator=name).integrator == "exact"
    with pytest.raises(hs.UsageError, match="exact cannot run"):
        hs.simulate(model, (0, 1), integrator="exact", params={"q": 1})
    assert hs.simulate(model, (0, 1), params={"q": 1}).integrator != "exact"
    assert hs.simulate(model, (0, 1), params={"q": -0.0}).integrator == "exact"


@pytest.mark.parametrize(
    ("effect", "good", "bad"), [("a/m", {"m": 2.0}, {"m": -1.0}), ("x", {}, {"a": -1.0})]
)
def test_a_contact_that_drives_its_velocity_is_refused_after_good_runs(
    effect: str, good: dict[str, float], bad: dict[str, float]
) -> None:
    """The effect of the force depends on parameters alone, or on the state at the start."""
    states = [hs.State("x", "a", 0), hs.State("v", 0.1, f"1 - v - f*{effect}")]
    contact = hs.Contact("f", velocity="v", normal=0.5, law="coulomb", arguments={"mu": 0.5})
    model = hs.Model("m", states, parameters={"a": 1.0, "m": 1.0}, contacts=[contact])
    for changes in ({}, good, {"a": 2.0}):
        assert hs.simulate(model, (0, 1), params=changes).success
    for _ in range(2):
        with pytest.raises(hs.ModelError, match="acts along the relative velocity"):
            hs.simulate(model, (0, 1), params=bad)


# -- models by name and path ---------------------------------------------------------------------------------------


def test_a_file_is_read_again_when_it_changes(tmp_path: Path) -> None:
    path = tmp_path / "block.toml"
    path.write_text(LINEAR)
    old = time.time_ns() - 10**12
    os.utime(path, ns=(old, old))
    first = hs.simulate(path, (0, 1)).model
    assert hs.simulate(path, (0, 1)).model is first
    assert hs.load(path) is not hs.load(path) and hs.load(path) == first
    path.write_text(LINEAR.replace("F0 = 3.0", "F0 = 4.0"))  # of the same size
    os.utime(path, ns=(old + 1, old + 1))
    assert hs.simulate(path, (0, 1)).model.parameter_values()["F0"] == 4.0
    path.unlink()
    with pytest.raises(hs.ModelError, match="does not exist"):
        hs.simulate(path, (0, 1))


def test_a_table_in_a_file_of_its_own_is_read_each_time(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("0,1\n1,1\n")
    path = tmp_path / "driven.toml"
    path.write_text(
        '[states]\nx = { start = 0, der = "u" }\n[inputs.u]\nkind = "table"\nfile = "u.csv"\n'
        'interpolation = "linear"\n'
    )
    old = time.time_ns() - 10**12
    os.utime(path, ns=(old, old))
    assert hs.simulate(path, (0, 1), integrator="taylor")(1.0)[0] == pytest.approx(1.0)
    (tmp_path / "u.csv").write_text("0,3\n1,3\n")
    assert hs.simulate(path, (0, 1), integrator="taylor")(1.0)[0] == pytest.approx(3.0)


# -- starts --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not ENABLED, reason="starts are decided in compiled code only with a compiler")
@pytest.mark.parametrize(
    "name", ["dfcs", "belt", "dfcs-stribeck", "drill-string", "mode-coupling", "clutches"]
)
def test_a_start_in_compiled_code_is_that_of_the_general_rules(name: str) -> None:
    """At random parameters and states, many of them zero or on a surface: bit for bit where the code is certain."""
    draw, certain, model = random.Random(name), 0, hs.load(name)
    for _ in range(60):
        values = model.parameter_values()
        changes = {
            parameter: values[parameter] * draw.choice([1.0, 0.0, draw.uniform(0.5, 1.5)])
            for parameter in values
            if draw.random() < 0.4
        }
        try:
            system = system_of(model.with_(**changes))
        except hs.ModelError:
            continue
        x0 = np.array([draw.choice([0.0, x, draw.uniform(-1, 1)]) for x in system.start_state({}).tolist()])
        t0 = draw.choice([0.0, draw.uniform(0, 5)])
        none = np.full(len(system.automata), -1, dtype=np.int64)
        task = Task(t0, t0 + 1, x0, none, None, system.discrete_start)
        found = start_by_kernel(system, task, Instant(t0))
        if found is None:
            continue
        certain += 1
        outcome = settled_start(system, task, Instant(t0), ())
        wanted = HybridState.of(outcome, system.vector(Instant(t0), task.discrete))
        for field in ("x", "x_error", "p", "z"):
            assert getattr(found, field).tobytes() == getattr(wanted, field).tobytes()
        active = system.active(wanted.z)
        for field in ("sides", "orders", "floors"):
            assert getattr(found, field)[active].tobytes() == getattr(wanted, field)[active].tobytes()
        assert not (outcome.changes or outcome.warnings or outcome.status or outcome.continuous)
    assert certain > 10
