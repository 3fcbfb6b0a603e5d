"""Absolute values and maxima that are written as conditionals of something with corners of its own."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs
from hybridsim.model.parts.component import Corner
from hybridsim.model.smoothing.explicit_corners import smoothed


def moving(rate: str, start: float) -> hs.Model:
    return hs.Model("m", states=[hs.State("x", start, rate)], definitions={"e": "max(x, -x) - 1"})


SIZES = [
    "abs(abs(x) - 1)",
    "(abs(x) - 1 if abs(x) - 1 > 0 else -(abs(x) - 1))",
    "(1 - max(-x, x) if max(x, -x) < 1 else max(x, -x) - 1)",
    "(-e if e < 0 else e)",
    "(sign(x)*x - 1 if not sign(x)*x - 1 <= 0 else 1 - sign(x)*x)",
    "(-e + (2*e if 0 < e else 0))",
]


@pytest.mark.parametrize("method", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize("size", SIZES)
def test_the_size_of_what_has_a_corner(size: str, method: str) -> None:
    """x' = -1 - ||x| - 1| from 2: between the corners, which come ln(2) apart, x, 2 - x, x + 2 and -x go by exp."""
    sol = hs.simulate(moving(f"-1 - {size}", 2.0), (0.0, 3.0), integrator=method)
    assert sol.success and not sol.warnings
    for t, x in ((0.5, 2 * math.exp(-0.5)), (1.0, 2 - math.e / 2), (2.0, 8 * math.exp(-2) - 2)):
        assert sol(t)[0] == pytest.approx(x, abs=1e-8)
    assert sol(3.0)[0] == pytest.approx(-math.exp(3) / 8, abs=1e-8)


@pytest.mark.parametrize(
    "larger", ["max({0}, 0.5)", "({0} if {0} > 0.5 else 0.5)", "(0.5 if {0} <= 0.5 else {0})"]
)
def test_the_larger_of_two(larger: str) -> None:
    """x' = -max(|x| - 1, 1/2) from 2.5: x - 1 = 1.5 exp(-t) down to 1/2, then at the speed 1/2."""
    sol = hs.simulate(moving(f"-{larger.format('(abs(x) - 1)')}", 2.5), (0.0, 3.0), integrator="exact")
    assert sol.success and not sol.warnings
    assert sol(3.0)[0] == pytest.approx(1.5 - (3 - math.log(3)) / 2, abs=1e-10)


def spelled(text: str) -> str:
    return f"({text} if {text} > 0 else -{text})"


def test_sizes_inside_each_other_are_one_corner_each() -> None:
    """x' = -1 - |||x| - 2| - 1| from 4 comes to a whole number each ln(2)."""
    size = spelled(f"({spelled('(' + spelled('x') + ' - 2)')} - 1)")
    model = moving(f"-1 - {size}", 4.0)
    assert sum(isinstance(component, Corner) for component in smoothed(model).components) == 3
    sol = hs.simulate(model, (0.0, 4.5), integrator="exact")
    for k in range(7):
        assert sol(k * math.log(2))[0] == pytest.approx(4 - k, abs=1e-10)
