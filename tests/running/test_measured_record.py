"""The scene driven by a record: the record itself, its knots, and the motion against matrix exponentials."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from reference.shaken_storey import ShakenStorey
from scipy.interpolate import PPoly, make_interp_spline

import hybridsim as hs

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs" / "make" / "make_ground_motion.py"


def scene(interpolation: str = "linear") -> hs.Model:
    model = hs.load("base-isolation")
    (record,) = model.inputs
    return replace(model, inputs=(replace(record, interpolation=interpolation),))


@pytest.fixture(scope="module")
def script() -> ModuleType:
    specification = importlib.util.spec_from_file_location("make_ground_motion", SCRIPT)
    assert specification and specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


# -- the record -------------------------------------------------------------------------------------------------


def test_the_script_makes_the_record_that_is_shipped(script: ModuleType) -> None:
    assert script.text() == script.FILE.read_text(encoding="utf-8")
    assert "seed 1" in script.text()


def test_the_scene_reads_all_of_it() -> None:
    (record,) = hs.load("base-isolation").inputs
    assert record.times == tuple(round(0.02 * k, 2) for k in range(1001))
    assert max(map(abs, record.values)) == pytest.approx(0.35 * 9.81, abs=1e-5)
    assert record.values[0] == record.values[-1] == 0.0, "the end values hold for ever"


def test_the_ground_ends_at_rest_where_it_began() -> None:
    """The record integrated twice in fractions; what is left comes from the five decimals of the file."""
    (record,) = hs.load("base-isolation").inputs
    knots = [(Fraction(round(100 * t), 100), Fraction(str(a))) for t, a in zip(record.times, record.values)]
    v = x = Fraction(0)
    for (t0, a0), (t1, a1) in pairwise(knots):
        h = t1 - t0
        x += h * v + h * h * (2 * a0 + a1) / 6
        v += h * (a0 + a1) / 2
    rounding, length = Fraction(1, 2 * 10**5), knots[-1][0]
    assert abs(v) <= rounding * length
    assert abs(x) <= rounding * length**2 / 2


def test_the_spectrum_has_the_ground_and_no_drift(script: ModuleType) -> None:
    """Kanai and Tajimi's: (1 + 4 z^2)/(4 z^2) at the ground's own frequency; Clough and Penzien's: none at zero."""
    z, ratio = script.GROUND_DAMPING, script.GROUND / script.FILTER
    low = ratio**4 / ((1 - ratio**2) ** 2 + (2 * script.FILTER_DAMPING * ratio) ** 2)
    assert script.spectrum(script.GROUND) == pytest.approx((1 + 4 * z**2) / (4 * z**2) * low, rel=1e-12)
    assert script.spectrum(1e-3) < 1e-12


# -- its knots --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("integrator", ["dop853", "exact", "taylor", "scipy-dop853", "cvode-adams"])
def test_every_knot_is_a_boundary(integrator: str, interpolation: str) -> None:
    """Stepped to, not over: each knot stands twice in the times, to the last bit."""
    end = 2.5  # six events
    sol = hs.simulate(scene(interpolation), (0.0, end), integrator=integrator, rtol=1e-6)
    knots = [t for t in sol.model.inputs[0].times if 0.0 < t < end]
    assert len(knots) == 124
    times, counts = np.unique(sol.t, return_counts=True)
    twice = set(times[counts == 2])
    assert twice >= set(knots)
    assert len(twice) == len(knots) + len({e.t for e in sol.events if e.t > 0.0})


def test_an_output_grid_changes_no_event() -> None:
    """On no grid, on one and on half of it: the same events and the same motion, bit for bit."""
    model = scene()
    free = hs.simulate(model, (0.0, 20.0), rtol=1e-8)
    assert len(free.events) == 64
    for points in (2001, 1001, 7):
        gridded = hs.simulate(model, (0.0, 20.0), rtol=1e-8, t_eval=np.linspace(0.0, 20.0, points))
        assert [(e.t, e.source, e.target) for e in gridded.events] == [
            (e.t, e.source, e.target) for e in free.events
        ]
        assert all((a.x_plus == b.x_plus).all() for a, b in zip(gridded.events, free.events, strict=True))
        assert gridded.modes == free.modes
        assert len(gridded.t) == points and (gridded.y == free(gridded.t)).all()


# -- the motion -------------------------------------------------------------------------------------------------


def pieces(times: tuple[float, ...], values: tuple[float, ...], interpolation: str) -> PPoly:
    """The record as polynomials, by way of B-splines."""
    degree, ends = (1, None) if interpolation == "linear" else (3, "natural")
    whole = PPoly.from_spline(make_interp_spline(times, values, k=degree, bc_type=ends))
    real = np.flatnonzero(np.diff(whole.x) > 0.0)  # B-splines repeat the end knots
    return PPoly(whole.c[:, real], np.append(whole.x[real], whole.x[-1]))


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_motion_is_that_of_matrix_exponentials(interpolation: str) -> None:
    end = 20.0
    model = scene(interpolation)
    (record,) = model.inputs
    true = ShakenStorey(model.parameter_values(), pieces(record.times, record.values, interpolation)).run(end)
    assert len(true.events) > 60
    for rtol in (1e-9, 1e-12):
        sol = hs.simulate(model, (0.0, end), rtol=rtol)
        assert [e.target for e in sol.events] == [mode for _, mode in true.events]
        # in seconds and metres, both of order one
        assert [e.t for e in sol.events] == pytest.approx([t for t, _ in true.events], abs=rtol)
        assert pytest.approx(true.states, abs=rtol) == sol(true.knots).T


@pytest.mark.parametrize("integrator", ["scipy-rk45", "cvode-bdf"])
def test_other_integrators_find_the_same_motion(integrator: str) -> None:
    end = 2.5
    model = scene()
    (record,) = model.inputs
    true = ShakenStorey(model.parameter_values(), pieces(record.times, record.values, "linear")).run(end)
    sol = hs.simulate(model, (0.0, end), integrator=integrator, rtol=1e-8)
    assert [e.target for e in sol.events] == [mode for _, mode in true.events]
    assert [e.t for e in sol.events] == pytest.approx([t for t, _ in true.events], abs=1e-6)
