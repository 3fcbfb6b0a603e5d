"""Derivatives of runs in which some changes die out much faster than the run goes, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


def relaxing(k: float, integrator: str) -> hs.Sensitivities:
    """x' = -k (x - y), y' = -y: x = (k y0/(k - 1)) (exp(-t) - exp(-k t)) + x0 exp(-k t)."""
    model = hs.Model(
        "relaxing",
        states=[hs.State("x", 0.5, "-k*(x - y)"), hs.State("y", "y0", "-y")],
        parameters={"k": k, "y0": 2.0},
    )
    solution = hs.simulate(model, (0, 1), integrator=integrator, rtol=1e-11)
    found = hs.sensitivities(solution)
    return found


@pytest.mark.parametrize(
    ("k", "integrator"), [(1e9, "exact"), (1e6, "exact"), (1e6, "rodas5p"), (2e4, "exact")]
)
def test_a_fast_relaxation(k: float, integrator: str) -> None:
    found, shared = relaxing(k, integrator), k / (k - 1.0) * math.exp(-1.0)
    expected = np.array([[0.0, shared], [0.0, math.exp(-1.0)]])
    assert found.by_start == pytest.approx(expected, rel=1e-9, abs=1e-10)
    assert found.by_parameter[:, 1] == pytest.approx(expected[:, 1], rel=1e-9)
    by_k = -2.0 * math.exp(-1.0) / (k - 1.0) ** 2
    assert k * found.by_parameter[:, 0] == pytest.approx([k * by_k, 0.0], rel=1e-4, abs=1e-10)


def test_what_dies_out_in_a_nanosecond() -> None:
    model = hs.Model("decay", states=[hs.State("x", 1, "-k*x")], parameters={"k": 1e9})
    found = hs.sensitivities(hs.simulate(model, (0, 1)))
    assert abs(found.by_start[0, 0]) < 1e-10
    assert abs(1e9 * found.by_parameter[0, 0]) < 1e-9
    early = hs.sensitivities(hs.simulate(model, (0, 2e-9)))
    assert early.by_start[0, 0] == pytest.approx(math.exp(-2.0), rel=1e-10)
    assert early.by_parameter[0, 0] == pytest.approx(-2e-9 * math.exp(-2.0), rel=1e-8)


@pytest.mark.parametrize(("end", "error"), [(700.0, 1e-8), (5000.0, 2e-4)])
def test_a_relaxation_oscillator(end: float, error: float) -> None:
    """Moved along its own flow, a run that time does not act on arrives as much later: d(end)/d(start) f = f(end).

    Up to the first jump it is as accurate as the run; at each of the six jumps within three periods what is left of the
    run's error on the slow branches is blown up. Across the orbit all has died out: the derivatives have rank one.
    """
    mu = 1000.0
    model = hs.Model(
        "van-der-Pol",
        states=[hs.State("x", 2, "y"), hs.State("y", 0, "mu*(1 - x*x)*y - x")],
        parameters={"mu": mu},
    )
    solution = hs.simulate(model, (0, end), integrator="rodas5p", rtol=1e-9)
    found = hs.sensitivities(solution)
    assert found.by_start[0] @ [0.0, -2.0] == pytest.approx(solution.y[1, -1], rel=error)
    first, second = found.by_start
    assert second[0] * first[1] == pytest.approx(second[1] * first[0], rel=1e-6)


def test_a_fast_rotation_is_refused_at_once() -> None:
    model = hs.Model(
        "fast", states=[hs.State("x", 1, "v"), hs.State("v", 0, "-w*w*x")], parameters={"w": 1e9}
    )
    solution = hs.simulate(model, (0, 1), integrator="exact")
    with pytest.raises(UsageError, match=r"oscillate through about 1e.09 radians"):
        hs.sensitivities(solution)
    slower = hs.simulate(model, (0, 1), integrator="exact", params={"w": 1e3})
    found = hs.sensitivities(slower)
    assert found.by_start[0] == pytest.approx([math.cos(1e3), 1e-3 * math.sin(1e3)], rel=1e-8)
    assert found.by_parameter[0, 0] == pytest.approx(-math.sin(1e3), rel=1e-8)
