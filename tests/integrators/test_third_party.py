"""An integrator written by a third party, found through its entry point, held against closed forms."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from itertools import pairwise
from pathlib import Path

import pytest
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.integrators import registry
from hybridsim.model import Model, State

HERE = Path(__file__).parent
MODES = {1: "slip+", -1: "slip-", 0: "stick"}

RUN = """
import json, sys
import hybridsim as hs
assert "tsitouras" in [one.name for one in hs.list_integrators()]
model = hs.load("dfcs").with_(omega="0.6*sqrt(k/m)", F0=30)
sol = hs.simulate(model, (0.0, float(sys.argv[1])), integrator="tsitouras", rtol=1e-9)
json.dump({"status": sol.status, "warnings": sol.warnings, "integrator": sol.integrator,
           "events": [[e.t, e.target, e.x_plus.tolist()] for e in sol.events]}, sys.stdout)
"""
CONFORMANCE = """
import json, sys
from hybridsim.testing import SCENES, conformance_failures
scenes = [scene for scene in SCENES if scene.name != "TORR"]  # right too, in some 40 s: order five at rtol 1e-12
json.dump(conformance_failures("tsitouras", scenes), sys.stdout)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a process in which a package with an entry point is installed."""
    site = tmp_path_factory.mktemp("site")
    (site / "tsitouras.py").write_text((HERE / "tsitouras.py").read_text())
    record = site / "tsitouras-1.0.dist-info"
    record.mkdir()
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: tsitouras\nVersion: 1.0\n")
    (record / "entry_points.txt").write_text("[hybridsim.integrators]\ntsitouras = tsitouras:Tsitouras\n")
    paths = [str(site), str(HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def run(code: str, environment: dict[str, str], *arguments: str) -> object:
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_it_is_short() -> None:
    assert len((HERE / "tsitouras.py").read_text().splitlines()) <= 45


def test_it_runs_the_oscillator_as_the_closed_form_does(installed: dict[str, str]) -> None:
    """P1 over 100 periods: 401 mode changes in order, times within 1e-6 T."""
    p = hs.load("dfcs").with_(omega="0.6*sqrt(k/m)", F0=30).parameter_values()
    period, limit = 2 * math.pi / p["omega"], p["mu"] * p["N"]
    motion = Oscillator(p["m"], p["c"], p["k"], limit, limit, p["F0"], p["omega"]).run(0, 100 * period, 0)
    sol = run(RUN, installed, repr(100 * period))
    assert (sol["status"], sol["warnings"], sol["integrator"]) == ("finished", [], "tsitouras")
    assert [e[1] for e in sol["events"]] == [MODES[c.mode] for c in motion.changes]
    assert len(sol["events"]) == 401
    for (t, _, (x, v)), change in zip(sol["events"], motion.changes, strict=True):
        assert abs(t - change.t) <= 1e-6 * period
        assert abs(x - change.x) <= 1e-6 * limit / p["k"]
        assert v == 0.0


def test_it_is_on_the_command_line(installed: dict[str, str]) -> None:
    command = [sys.executable, "-m", "hybridsim", "integrators"]
    done = subprocess.run(command, env=installed, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "tsitouras" in done.stdout
    assert "Tsitouras 5(4)" in done.stdout


@pytest.mark.slow
def test_it_passes_the_conformance_suite(installed: dict[str, str]) -> None:
    assert run(CONFORMANCE, installed) == []


# -- in this process --------------------------------------------------------------------------------------------


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    from integrators.tsitouras import Tsitouras

    add(monkeypatch, Tsitouras)


def add(monkeypatch: pytest.MonkeyPatch, *classes: object) -> None:
    """Put classes where entry points are looked up."""

    class Entry(EntryPoint):
        def load(self) -> object:
            return classes[int(self.name)]

    entries = [Entry(str(k), "somewhere:Something", registry.ENTRY_POINT) for k in range(len(classes))]
    monkeypatch.setattr(
        registry, "entry_points", lambda group: entries if group == registry.ENTRY_POINT else []
    )
    registry._registered.cache_clear()


@pytest.fixture(autouse=True)
def _fresh_registry() -> object:
    yield
    registry._registered.cache_clear()


PUMPED = Model("pumped", states=(State("x", 1, "y"), State("y", 0, "(1 - x*x)*y - x + cos(3*t)")))
LINEAR = Model("linear", states=(State("x", 1, "v"), State("v", 0, "-x + sin(5*t)")))


def linear_motion(t: float) -> list[float]:
    """x'' + x = sin(5 t) from (1, 0)."""
    x = math.cos(t) + 5 / 24 * math.sin(t) - math.sin(5 * t) / 24
    return [x, -math.sin(t) + 5 / 24 * math.cos(t) - 5 / 24 * math.cos(5 * t)]


def end_error(model: Model, h: float, end: float, truth: list[float], integrator: str) -> float:
    """Error at the end with steps of one length: the tolerances accept everything."""
    sol = hs.simulate(model, (0.0, end), integrator=integrator, rtol=0.9, atol=1e9, max_step=h, first_step=h)
    assert sol.stats["steps"] == round(end / h)
    return max(abs(a - b) for a, b in zip(sol.y[:, -1], truth, strict=True))


def test_the_observed_order_is_the_claimed_one(registered: None) -> None:
    errors = [end_error(LINEAR, 4.0 / n, 4.0, linear_motion(4.0), "tsitouras") for n in (32, 64, 128)]
    orders = [math.log2(a / b) for a, b in pairwise(errors)]
    assert orders == pytest.approx([5.0, 5.0], abs=0.1), errors


def test_the_order_holds_on_a_nonlinear_problem(registered: None) -> None:
    """The truth from mpmath; a wrong coefficient of the higher order conditions shows only here.

    This pair's error is mostly of order six until steps are very short: the order may come out larger.
    """
    import mpmath

    with mpmath.workdps(25):
        pumped = mpmath.odefun(
            lambda t, w: [w[1], (1 - w[0] ** 2) * w[1] - w[0] + mpmath.cos(3 * t)], 0, [1, 0]
        )
        truth = [float(value) for value in pumped(3)]
    errors = [end_error(PUMPED, 3.0 / n, 3.0, truth, "tsitouras") for n in (12, 24, 48, 96)]
    assert all(math.log2(a / b) >= 4.9 for a, b in pairwise(errors)), errors


def test_the_error_follows_the_tolerance(registered: None) -> None:
    for rtol in (1e-4, 1e-6, 1e-8, 1e-10):
        sol = hs.simulate(LINEAR, (0.0, 20.0), integrator="tsitouras", rtol=rtol, atol=rtol)
        assert rtol * 1e-3 < abs(sol.y[0, -1] - linear_motion(20.0)[0]) < 100 * rtol


def test_what_is_no_integrator_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    add(monkeypatch, dict)
    with pytest.raises(UsageError, match="does not name an Integrator class"):
        hs.list_integrators()


def test_a_name_that_is_taken_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from integrators.tsitouras import Tsitouras

    add(monkeypatch, type("Other", (Tsitouras,), {"name": "dop853"}))
    with pytest.raises(UsageError, match="'dop853'"):
        hs.list_integrators()


def test_its_options_are_checked_like_any_other(registered: None) -> None:
    with pytest.raises(UsageError, match="stages"):
        hs.simulate(LINEAR, (0.0, 1.0), integrator="tsitouras", stages=3)
