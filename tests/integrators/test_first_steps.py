"""Where a multistep method begins with steps of high order: a gap that opens late, and bounces that accumulate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.integrators.first_steps import peaks

SCENES = Path(hs.__file__).parent / "testing" / "scenes"
MULTISTEP = ("cvode-adams", "cvode-bdf", "scipy-bdf", "scipy-lsoda")


@pytest.mark.parametrize("integrator", MULTISTEP)
def test_a_ball_without_a_rule_of_rest_accumulates(integrator: str) -> None:
    """Each flight lasts e times the one before, so they end at sqrt(2 h / g) (1 + e)/(1 - e)."""
    solution = hs.simulate(
        SCENES / "ball.toml", t_span=(0, 3), params={"v_min": 0.0}, integrator=integrator, rtol=1e-6
    )
    assert solution.status == "accumulation"
    assert abs(solution.t[-1] - np.sqrt(2 / 9.81) * 1.7 / 0.3) < 1e-5


@pytest.mark.parametrize(
    ("integrator", "bound"), [("cvode-adams", 1e-7), ("cvode-bdf", 1e-6), ("scipy-bdf", 1e-6)]
)
@pytest.mark.parametrize("model", ["bounce", "bar"])
def test_a_body_comes_to_rest_when_its_bounces_end(model: str, integrator: str, bound: float) -> None:
    """The first fall lasts 1/2 and the n-th flight 2**(1 - n), so that both are at rest at t = 3/2."""
    solution = hs.simulate(SCENES / f"{model}.toml", t_span=(0, 2), integrator=integrator, rtol=1e-6)
    assert abs(solution.events[-1].t - 1.5) < bound


def test_peaks_are_those_of_the_first_two_terms() -> None:
    """t - t**2 rises to 1/4, 3 t**2 - t**3 to 4, t**3 + t**4 for good, and a single term, too."""
    series = np.array([[0, 1, -1, 0, 0], [0, 0, 3, -1, 0], [0, 0, 0, 1, 1], [0, 0, 0, 0, 1.0]])
    assert peaks(series, np.array([1, 2, 3, 4])) == pytest.approx([0.25, 4.0, np.inf, np.inf])
