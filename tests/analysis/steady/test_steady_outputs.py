"""Outputs that are hard to read off a steady state: fast ones, jumps, kinks, and what is no number on a part of it.

The states are those of a forced oscillator, x = X cos(2 t - p): readings of functions of x have closed forms.
"""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from scipy.special import j0, j1

import hybridsim as hs
from hybridsim.analysis.polynomials.orbit import NODES, POINTS, Orbit
from hybridsim.errors import SimulationError

STATES = 'x = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}'
X = 1.0 / abs(-3.0 + 0.2j)  # (-4 + 1 + 0.2 i) X = -1
METHODS = pytest.mark.parametrize("integrator", ["taylor", "exact"])


def steady(outputs: str, states: str = STATES, integrator: str = "taylor") -> hs.SteadyState:
    text = f'schema = 1\nname = "outputs"\n[states]\n{states}\n[outputs]\n{outputs}\n'
    found = hs.steady_state(hs.Model.from_toml(text), integrator=integrator)
    assert found.success
    return found


@METHODS
def test_a_fast_output_is_not_taken_for_rounding(integrator: str) -> None:
    """sin(a X cos(s)) = 2 J_1(a X) cos(s) - ..., and the mean of its square is (1 - J_0(2 a X))/2."""
    a = 1e5
    found = steady(f'q = "sin({a}*x)"', integrator=integrator)
    rounding = a * X * 1e-12  # of x, which steady_state finds to 1e-10 times the tolerance of its runs
    assert (found.minimum["q"], found.maximum["q"]) == pytest.approx((-1.0, 1.0), abs=1e-9)
    assert found.mean["q"] == pytest.approx(0.0, abs=rounding)
    assert abs(found.harmonic("q")) == pytest.approx(2.0 * abs(j1(a * X)), abs=rounding)
    assert found.energy["q"] == pytest.approx(0.5 * math.pi * (1.0 - j0(2.0 * a * X)), abs=2.0 * rounding)


@METHODS
@pytest.mark.parametrize("a", [1e6, 1e9, 1e12])
def test_what_varies_too_fast_is_named(integrator: str, a: float) -> None:
    found = steady(f'q = "sin({a}*x)"\nsquare = "x**2"', integrator=integrator)
    for measure in (found.amplitude, found.minimum, found.peak, found.mean, found.energy):
        with pytest.raises(SimulationError, match=r"q varies too fast.*\n.*steady\.solution"):
            measure["q"]
    with pytest.raises(SimulationError, match="q varies too fast"):
        found.harmonic("q")
    assert found.amplitude["x"] == pytest.approx(X, rel=1e-10)
    assert found.mean["square"] == pytest.approx(0.5 * X * X, rel=1e-10)
    assert found.too_fast == ("q",)
    record = found.to_dict()
    assert record["too_fast"] == ["q"]
    assert set(record["amplitude"]) == set(record["harmonics"]) == {"x", "v", "square"}


def test_too_fast_an_output_takes_no_memory() -> None:
    found = steady('q = "sin(1e6*x)"\nr = "sin(1e9*v)"')
    found.solution(0.0)
    tracemalloc.start()
    try:
        found.maximum["x"]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 300e6  # 128 MB of values, and what halving them takes


def test_the_period_of_a_limit_cycle_needs_no_outputs() -> None:
    """Of van der Pol's oscillator, whose period at a damping of 1 is 6.66328685932 (known from series)."""
    states = 'x = {start = 2, der = "v"}\nv = {start = 0, der = "(1 - x**2)*v - x"}'
    found = steady('fast = "sin(1e9*x)"\nroot = "sqrt(x)"', states)
    assert found.period == pytest.approx(6.66328685932, rel=1e-11)


def test_what_is_no_number_on_a_part_has_no_readings() -> None:
    found = steady(
        'root = "sqrt(x)"\nlevel = "log(-x - 0.1)"\npole = "1/max(x, 0)"\nsquare = "x**2"\nside = "sign(x)"'
    )
    assert len(found._orbit.starts) < 200
    for name in ("root", "level", "pole"):
        for measure in (found.amplitude, found.minimum, found.maximum, found.peak, found.mean, found.energy):
            assert math.isnan(measure[name])
        assert math.isnan(abs(found.harmonic(name)))
    assert found.amplitude["x"] == pytest.approx(X, rel=1e-10)
    assert found.maximum["square"] == pytest.approx(X * X, rel=1e-10)
    assert found.mean["side"] == pytest.approx(0.0, abs=1e-7)
    assert (found.minimum["side"], found.maximum["side"]) == (-1.0, 1.0)


def test_looking_for_extremes_takes_little_memory() -> None:
    """A sine of 4 * 2^15 turns on as many pieces: slopes at 65 points of all of them at once would be 136 MB."""
    count, length = 2**17, 0.25 * 2.0 * math.pi
    starts = length * np.arange(count)
    phases = 0.5 * length * (1.0 + NODES) + 0.5 * math.pi * (np.arange(count) % 4)[:, None]
    values = np.stack([np.sin(phases), 3.0 * np.cos(phases)], axis=2)
    assert values.shape == (count, POINTS, 2)
    orbit = Orbit(
        ("a", "b"),
        starts,
        np.full(count, length),
        np.zeros(count, dtype=int),
        values,
        np.ones((count, 2), np.bool_),
    )
    tracemalloc.start()
    try:
        low, high = orbit.extremes
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 100e6
    assert low == pytest.approx([-1.0, -3.0], rel=1e-13)
    assert high == pytest.approx([1.0, 3.0], rel=1e-13)


@METHODS
def test_behind_a_kink_nothing_is_beyond_what_there_is(integrator: str) -> None:
    """max(x - c, 0) is never negative and at most X - c; its mean is (X sin(a) - c a)/pi with cos(a) = c/X."""
    levels = np.linspace(-0.99 * X, 0.999 * X, 60).tolist()
    outputs = "\n".join(f'q{i} = "max(x - ({c!r}), 0)"' for i, c in enumerate(levels))
    found = steady(outputs, integrator=integrator)
    for i, c in enumerate(levels):
        assert -1e-9 <= found.minimum[f"q{i}"] <= 0.0
        assert found.maximum[f"q{i}"] == pytest.approx(X - c, abs=1e-10)
        a = math.acos(c / X)
        assert found.mean[f"q{i}"] == pytest.approx((X * math.sin(a) - c * a) / math.pi, abs=1e-10)


@METHODS
def test_a_quantity_that_jumps_has_its_own_values(integrator: str) -> None:
    found = steady('side = "sign(x)"\nstair = "sign(v - 0.1) + 2*sign(v + 0.2)"', integrator=integrator)
    assert (found.minimum["side"], found.maximum["side"]) == (-1.0, 1.0)
    assert (found.minimum["stair"], found.maximum["stair"]) == (-3.0, 3.0)
    assert found.amplitude["side"] == 1.0
