"""Straight lines between the drawn points show the true curve: no chord departs from it visibly."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

import hybridsim as hs
from hybridsim.plot import friction_law, friction_loop, phase_portrait, time_history
from hybridsim.plot.shared.curve_samples import sample_curves

PERIODS, SLOWEST, WIDTH = 20, 0.001, 0.004
SPAN = (0.0, 2 * math.pi * PERIODS)
VISIBLE = 2e-3  # of the range of an axis
LAW = hs.FrictionLaw("steep", slip=f"(0.3 + 0.3*exp(-v/{WIDTH}))*N", stick="0.6*N")


def speed(t: np.ndarray) -> np.ndarray:
    return SLOWEST + 1 - np.cos(t)


def force(v: np.ndarray) -> np.ndarray:
    return 0.3 + 0.3 * np.exp(-np.abs(v) / WIDTH)


@pytest.fixture(scope="module")
def solution() -> hs.Solution:
    """A contact whose speed is prescribed and nearly vanishes once per period: its force is steep and short."""
    states = [hs.State("x", 0, "v"), hs.State("v", SLOWEST, "sin(t) - 1e-9*f")]
    contacts = [hs.Contact("f", velocity="v", normal=1, law=LAW)]
    return hs.simulate(hs.Model("driven", states, contacts=contacts), SPAN)


def curves(axes: Axes) -> list[np.ndarray]:
    """All drawn curves of axes with more than two points, each (k, 2)."""
    collections = [one for one in axes.collections if isinstance(one, LineCollection)]
    found = [line.get_xydata() for line in axes.get_lines() if line.get_linestyle() != "None"]
    found += [segment for one in collections for segment in one.get_segments()]
    return [curve for curve in map(np.asarray, found) if len(curve) > 2]


def departure(curve: np.ndarray, true: Callable[[np.ndarray], np.ndarray]) -> float:
    """Return the largest distance of chords from y = true(x), relative to the range of y.

    A steep curve may be met beside the point instead of above it, so that a chord is compared with the least and
    largest value of the curve around each of its points.
    """
    x, y = curve.T
    shares = np.linspace(0, 1, 9)[1:-1, None]
    along, up = x[:-1] + shares * np.diff(x), y[:-1] + shares * np.diff(y)
    near = [true(along + side * VISIBLE * np.ptp(x)) for side in (-1, 0, 1)]
    outside = np.maximum(up - np.max(near, axis=0), np.min(near, axis=0) - up)
    return float(np.max(outside)) / float(np.ptp(y))


def test_a_loop_over_the_sliding_speed_is_the_law(solution: hs.Solution) -> None:
    (curve,) = curves(friction_loop(solution, "f", "v", t_span=SPAN))
    assert np.ptp(curve[:, 1]) > 0.2
    assert departure(curve, force) < VISIBLE


def test_a_loop_over_the_displacement_follows_the_force(solution: hs.Solution) -> None:
    (curve,) = curves(friction_loop(solution, t_span=(0, 2 * math.pi)))
    t = np.linspace(0, 2 * math.pi, 200_001)
    x = (1 + SLOWEST) * t - np.sin(t)
    assert departure(curve, lambda at: np.interp(at, x, force(speed(t)))) < VISIBLE


@pytest.mark.parametrize("span", [SPAN, (0.0, 1.0)])
def test_a_time_history_follows_each_quantity(solution: hs.Solution, span: tuple[float, float]) -> None:
    of_speed, of_force = time_history(solution, ["v", "f"], t_span=span).quantities
    for axes, true in ((of_speed, speed), (of_force, lambda t: force(speed(t)))):
        (curve,) = curves(axes)
        assert departure(curve, true) < VISIBLE


def test_a_portrait_has_no_corners() -> None:
    """Of x = cos(t**2): the last turns are as round as the first."""
    states = [hs.State("x", 1, "-2*t*sin(t**2)"), hs.State("y", 0, "2*t*cos(t**2)")]
    (curve,) = curves(phase_portrait(hs.simulate(hs.Model("chirp", states), (0, 30)), "x", "y"))
    middles = 0.5 * (curve[1:] + curve[:-1])
    assert abs(np.hypot(*middles.T) - 1).max() < VISIBLE


def test_a_comparison_of_laws_draws_each_loop(solution: hs.Solution) -> None:
    other = hs.FrictionLaw("flat", slip="0.3*N", stick="0.6*N")
    loops, _ = hs.compare_laws(solution.model, [LAW, other], (0, 2 * math.pi)).plot()
    steep, flat = curves(loops)
    t = np.linspace(0, 2 * math.pi, 200_001)
    x = (1 + SLOWEST) * t - np.sin(t)
    assert departure(steep, lambda at: np.interp(at, x, force(speed(t)))) < VISIBLE
    assert flat[:, 1] == pytest.approx(0.3)


def test_a_law_is_drawn_from_the_first_speed_on() -> None:
    """The force falls within 4e-6 of the drawn speeds."""
    (axes,) = friction_law(LAW, speed=1000)
    for curve, sign in zip(curves(axes), (1, -1), strict=True):
        assert departure(curve, lambda v, sign=sign: sign * force(v)) < VISIBLE


def test_a_curve_that_meets_its_chord_in_the_middle() -> None:
    """Of one period of a sine between two knots, the first and last point and the middle are on one line."""
    t, (y,), _ = sample_curves(
        lambda at, _: np.sin(at)[None], np.array([0, 2 * math.pi]), np.zeros(1, dtype=bool)
    )
    assert departure(np.column_stack([t, y]), np.sin) < VISIBLE


@pytest.mark.parametrize("most", [500, 5000])
def test_the_number_of_samples_is_bounded(most: int) -> None:
    """With fewer samples than the curve needs, the flat part has no more than its first ones."""
    knots = np.linspace(0, 1, 101)
    t, (y,), firsts = sample_curves(
        lambda at, _: np.sin(1000 * at**8)[None], knots, np.zeros(100, dtype=bool), most=most
    )
    assert len(t) <= most + 1 and firsts.tolist() == [0, len(t)]
    assert np.all(np.diff(t) >= 0) and np.array_equal(y, np.sin(1000 * t**8))
    assert np.sum(t < 0.3) == 60


def test_both_sides_of_a_jump_are_samples() -> None:
    knots = np.array([0.0, 1.0, 2.0])
    t, (y,), firsts = sample_curves(
        lambda at, is_after: np.where(at > 1.0 - is_after * 1e-12, 7.0, at)[None],
        knots,
        np.array([True, False]),
    )
    assert t[firsts[1] - 1 : firsts[1] + 1].tolist() == [1.0, 1.0]
    assert y[firsts[1] - 1 : firsts[1] + 1].tolist() == [1.0, 7.0]


def test_a_strip_of_modes_without_curves_has_samples() -> None:
    t, values, firsts = sample_curves(
        lambda at, _: np.zeros((0, len(at))), np.array([0.0, 1.0]), np.zeros(1, dtype=bool)
    )
    assert values.shape == (0, len(t)) and firsts.tolist() == [0, len(t)]
