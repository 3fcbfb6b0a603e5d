"""Distances of completed graphs that are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plot.fake_solution import ball

from hybridsim.analysis.compare.graph_distance import CompletedGraph, graph_distance
from hybridsim.analysis.compare.trajectory import trajectory_of
from hybridsim.reference.trajectory import Trajectory

SPAN = 2.0


def graph(states, jumps=(), time=SPAN, amplitude=(0.5,)) -> CompletedGraph:
    return CompletedGraph(Trajectory(states, (0.0, SPAN)), jumps, time, np.array(amplitude))


def step(at: float, height: float = 1.0) -> CompletedGraph:
    """0 before a time, `height` from it on."""

    def states(t, side):
        return np.where((t >= at) if side == "+" else (t > at), height, 0.0)[None, :]

    return graph(states, [at])


@pytest.mark.parametrize("late", [0.1, 1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("higher", [0.0, 1e-2, 1e-7])
def test_two_steps(late: float, higher: float) -> None:
    """The end of the higher step is `higher` above the other one, its line `late` beside the other's."""
    expected = max(late / SPAN, higher / 0.5)
    assert graph_distance(step(1.0), step(1.0 + late, 1.0 + higher)) == pytest.approx(expected, rel=1e-5)
    assert graph_distance(step(1.0 + late, 1.0 + higher), step(1.0)) == pytest.approx(expected, rel=1e-5)


def test_a_jump_that_is_missed_counts_in_full() -> None:
    still = graph(lambda t, side: np.zeros((1, len(t))))
    assert graph_distance(step(1.0), still) == pytest.approx(1.0 / 0.5, rel=1e-12)


def test_a_graph_beside_a_slope_is_nearer_than_it_is_above() -> None:
    """From a point at height e over x = s t, both in units of the scaling: the nearest is e/(1 + s) away."""
    slope = 3.0
    line = graph(lambda t, side: (slope * t)[None, :], time=1.0, amplitude=(1.0,))
    for height in (0.5, 1e-3, 1e-8):
        at = np.array([1.0])
        found = line.distance_from(at, slope * at[:, None] + height, SPAN)
        assert found == pytest.approx(height / (1.0 + slope), rel=1e-6)


def ball_graphs(late: float = 0.0, larger: float = 0.0) -> tuple[CompletedGraph, CompletedGraph, float]:
    """A bouncing ball, the same one later by `late` and in all states larger by a factor, and the span."""
    exact = trajectory_of(ball())
    t0, end = exact.t_span
    jumps = [event.t for event in exact.events]

    def states(t, side):
        return exact.states(np.clip(t - late, t0, end), side) * (1.0 + larger)

    amplitude = np.array([0.5, 4.0])
    moved = CompletedGraph(Trajectory(states, (t0, end)), [t + late for t in jumps], end, amplitude)
    return CompletedGraph(exact, jumps, end, amplitude), moved, end


@pytest.mark.parametrize("late", [0.05, 1e-3, 1e-6])
def test_two_balls_one_of_them_late(late: float) -> None:
    """The rebound of the first has nothing of the other nearer than the other's own rebound."""
    first, second, end = ball_graphs(late=late)
    assert graph_distance(first, second) == pytest.approx(late / end, rel=1e-6)


@pytest.mark.parametrize("larger", [1e-2, 1e-5, 1e-9])
def test_two_balls_one_of_them_larger(larger: float) -> None:
    """The height of release is two amplitudes, and nothing of the other ball is as high."""
    first, second, _ = ball_graphs(larger=larger)
    assert graph_distance(first, second) == pytest.approx(larger / 0.5, rel=1e-6)
    speed = math.sqrt(2 * 9.81)  # at the first impact: less of its amplitude than the height
    assert larger * speed / 4.0 < larger / 0.5


def test_the_shorter_of_two_runs_decides_how_far_to_look() -> None:
    whole = step(1.5)
    cut = CompletedGraph(
        Trajectory(lambda t, side: np.zeros((1, len(t))), (0.0, 1.0)), [], SPAN, np.array([0.5])
    )
    assert graph_distance(whole, cut) == 0.0
