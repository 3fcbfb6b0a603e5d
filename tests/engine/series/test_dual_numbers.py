"""Dual numbers and arrays are combined in each order, with derivatives in closed form."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridsim.engine.series.dual_numbers import Dual

ARRAY, AT = np.array([3.0, 5.0]), np.array([2.0, 4.0])


@pytest.mark.parametrize(
    ("combine", "slope"),
    [
        (operator.add, np.ones(2)),
        (operator.sub, -np.ones(2)),
        (operator.mul, ARRAY),
        (operator.truediv, -ARRAY / AT**2),
    ],
)
def test_an_array_on_the_left(combine: Callable[[Any, Any], Any], slope: np.ndarray) -> None:
    found = combine(ARRAY, Dual(AT, np.ones((1, 2))))
    assert isinstance(found, Dual)
    assert found.value.tolist() == combine(ARRAY, AT).tolist()
    assert found.slope[0] == pytest.approx(slope)


def test_comparisons_with_an_array_on_the_left() -> None:
    number = Dual(AT, np.ones((1, 2)))
    assert operator.gt(ARRAY, number) is True
    assert operator.lt(ARRAY, number) is False
