"""Fits repeat no run, and choose the derivatives by the measured costs."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.fit.derivative_costs import DerivativeCosts
from hybridsim.analysis.fit.residuals import Residuals

TICKS, PERIOD = 50, 0.01


def sampled() -> hs.Model:
    """x' = u - k x, with u = r - 2 x from each tick on."""
    return hs.Model(
        "sampled",
        parameters={"k": 1.0, "r": 2.0},
        states=[hs.State("x", 1, "u - k*x", nominal=1)],
        discrete=[hs.Discrete("u", 0)],
        outputs={"y": "2*x"},
        schedules=[hs.Schedule("control", start=0, period=PERIOD, reset={"u": "r - 2*x"})],
    )


def samples(k: float, r: float) -> dict[str, np.ndarray]:
    """x after each period: with constant u, x(t + T) = exp(-k T) x(t) + (1 - exp(-k T))/k u."""
    decay, found = math.exp(-k * PERIOD), [1.0]
    for _ in range(TICKS):
        found.append(decay * found[-1] + (1.0 - decay) / k * (r - 2.0 * found[-1]))
    return {"t": PERIOD * np.arange(1, TICKS + 1), "x": np.array(found[1:])}


@pytest.fixture
def points(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, ...]]:
    """The values of the unknowns in each run."""
    found: list[tuple[float, ...]] = []
    solution = Residuals.solution

    def counted(self: Residuals, record: Any, values: dict[str, float]) -> hs.Solution:
        found.append(tuple(values.values()))
        return solution(self, record, values)

    monkeypatch.setattr(Residuals, "solution", counted)
    return found


def measured_as(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """Replace the measured time of every run."""
    add = DerivativeCosts.add_run
    monkeypatch.setattr(DerivativeCosts, "add_run", lambda self, _: add(self, seconds))


@pytest.mark.parametrize(
    ("seconds", "text"), [(100.0, "exact"), (1e-6, "central differences, because they take")]
)
def test_the_measured_cost_of_a_run_selects_the_derivatives(
    monkeypatch: pytest.MonkeyPatch, points: list[tuple[float, ...]], seconds: float, text: str
) -> None:
    """The estimate from the steps alone would be the same in both cases."""
    measured_as(monkeypatch, seconds)
    found = hs.fit(sampled(), hs.Record(samples(1.3, 2.4), t0=0.0), {"k": (0.5, 2.0), "r": (1.0, 4.0)})
    assert found.derivatives.startswith(text)
    assert [found.values["k"], found.values["r"]] == pytest.approx([1.3, 2.4], rel=1e-5)
    if text == "exact":  # one run of each trial point, and a second run of the guess for its time
        assert found.runs <= 12


def test_no_point_is_simulated_again(
    monkeypatch: pytest.MonkeyPatch, points: list[tuple[float, ...]]
) -> None:
    """Steps, derivatives, the estimate of the noise and the errors share the runs of a point."""
    measured_as(monkeypatch, 1e-6)
    data = samples(1.3, 2.4)
    data["y"] = 2.0 * data["x"] + 1e-3 * np.cos(8.0 * np.arange(TICKS))
    data["x"] = data["x"] + 1e-4 * np.sin(5.0 * np.arange(TICKS))
    hs.fit(sampled(), hs.Record(data, t0=0.0), {"k": (0.5, 2.0), "r": (1.0, 4.0)})
    assert len(points) == len(set(points))


def test_the_costs_of_both_derivatives_are_measured() -> None:
    solution: Any = SimpleNamespace(stats={"steps": 572}, _segments=range(502))
    costs, repeated = DerivativeCosts(), []

    def run_again() -> None:
        repeated.append(True)
        costs.add_run(0.36)

    costs.add_run(1.9)  # the first run of a process
    assert costs.is_exact_cheaper(solution, 2, run_again)  # four runs take 1.44 s
    assert repeated == [True]
    costs.add_exact(40.0)  # with preparations that later calls do not repeat
    assert costs.is_exact_cheaper(solution, 2, run_again)
    costs.add_exact(3.0)
    assert not costs.is_exact_cheaper(solution, 2, run_again)
    assert costs.is_exact_cheaper(solution, 5, run_again)  # ten runs take 3.6 s
    assert repeated == [True]
