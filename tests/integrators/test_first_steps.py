"""Where a multistep method begins with steps of high order: the last of infinitely many bounces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.integrators.first_steps import throws
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.suite import outcome

BY_NAME = {scene.name: scene for scene in SCENES}
FILES = Path(hs.__file__).parent / "testing" / "scenes"
MULTISTEP = ("cvode-adams", "cvode-bdf", "scipy-bdf")


@pytest.mark.parametrize("integrator", MULTISTEP)
@pytest.mark.parametrize(
    "scene", ["ball-accumulation", "bounce", "bar-on-two-supports", "monitors-at-bounces", "rubbing-stop"]
)
def test_bounces_end_at_their_limit(scene: str, integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bounces of these scenes are geometric series, whose limits are known at every tolerance of the study."""
    method = next(one for one in hs.list_integrators() if one.name == integrator)
    others = {capability: why for capability, why in method.lacks.items() if capability != "accumulation"}
    monkeypatch.setattr(method, "lacks", others)
    result = outcome(integrator, BY_NAME[scene])
    assert result.verdict == "right", "\n".join(result.reasons)


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("integrator", MULTISTEP)
def test_the_limit_of_bounces_is_as_accurate_as_the_tolerance(integrator: str, rtol: float) -> None:
    """Each flight lasts e times the one before, so they end at sqrt(2 h / g) (1 + e)/(1 - e)."""
    solution = hs.simulate(
        FILES / "ball.toml", t_span=(0, 3), params={"v_min": 0.0}, integrator=integrator, rtol=rtol
    )
    assert solution.status == "accumulation"
    assert abs(solution.t_end - np.sqrt(2 / 9.81) * 1.7 / 0.3) < rtol


def test_throws_are_those_of_the_first_three_terms() -> None:
    """t - t**2 rises to 1/4 and returns at 1; 1 - t**2 falls at once, and t + t**2 and t**3 are not pulled back."""
    terms = np.array([[0, 1, -1, 0], [1, 0, -1, 0], [0, 1, 1, 0], [0, 0, 0, 1.0]])
    peaks, times = throws(terms, 1.0)
    assert peaks == pytest.approx([0.25, 1.0, np.inf, np.inf])
    assert times[:2] == pytest.approx([1.0, 1.0])
    assert throws(terms, -1.0)[0] == pytest.approx([np.inf, 1.0, np.inf, np.inf])
