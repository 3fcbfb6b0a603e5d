"""A constant force within rounding of the limit of stick holds, and the run comes to its end."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs


def pulled(forcing: object, stiffness: float = 0.0) -> hs.MechanicalSystem:
    contact = hs.MechanicalContact("f", {0: 1.0}, 3, "coulomb", {"mu": 0.1})
    return hs.MechanicalSystem([[1.0]], [[0.0]], [[stiffness]], forcing=forcing, contacts=[contact])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("force", [0.3, 3 * 0.1, math.nextafter(0.3, 0.0), math.nextafter(3 * 0.1, 1.0)])
def test_a_constant_force_at_the_limit_holds(force: float, sign: float) -> None:
    solution = hs.simulate(pulled([sign * force]), (0, 10))
    assert solution.status == "finished"
    assert solution.y[:, -1].tolist() == [0.0, 0.0]
    assert len(solution.t) < 100


def test_a_constant_force_beyond_the_limit_moves_the_body() -> None:
    solution = hs.simulate(pulled([0.31]), (0, 1))
    assert solution.y[:, -1] == pytest.approx([0.005, 0.01], rel=1e-12)


def test_a_force_that_comes_to_its_limit_and_stays_below_is_a_touch() -> None:
    solution = hs.simulate(pulled({0: hs.Harmonic(omega=1.0, sin=0.3)}), (0, 20))
    assert solution.status == "finished"
    assert solution.y[:, -1].tolist() == [0.0, 0.0]
    assert len(solution.t) < 2000
