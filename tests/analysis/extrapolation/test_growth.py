"""The growth of a small change of a periodic motion is the size of the largest multiplier, also of a complex one."""

from __future__ import annotations

import numpy as np
import pytest

from hybridsim.analysis.extrapolation.growth import grows


class LinearMap:
    """The period map x -> A x, with the fixed point 0."""

    def __init__(self, matrix: np.ndarray) -> None:
        self.matrix, self.x = matrix, np.zeros(len(matrix))

    def snapshot(self) -> np.ndarray:
        return self.x

    def restore(self, snapshot: np.ndarray) -> None:
        self.x = snapshot

    def put(self, x: np.ndarray) -> None:
        self.x = x

    def advance(self) -> None:
        self.x = self.matrix @ self.x


def maps(size: float) -> list[LinearMap]:
    """200 maps with a pair of multipliers of this size at a random angle, in stretched coordinates, and 0.7."""
    rng = np.random.default_rng(5)
    found = []
    for angle in rng.uniform(0.05, 3.1, 200):
        c, s = np.cos(angle), np.sin(angle)
        turn = size * np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 0.7 / size]])
        basis = np.linalg.qr(rng.normal(size=(3, 3)))[0] * np.array([1.0, rng.uniform(0.05, 1.0), 1.0])
        found.append(LinearMap(basis @ turn @ np.linalg.inv(basis)))
    return found


@pytest.mark.parametrize(("size", "expected"), [(1.016, True), (1.2, True), (0.99, False), (0.8, False)])
def test_a_change_that_turns_grows_with_the_size_of_its_multipliers(size: float, expected: bool) -> None:
    rng = np.random.default_rng(6)
    decided = [grows(each, np.ones(3), 1, rng.normal(size=3)) for each in maps(size)]  # type: ignore[arg-type]  # a stub
    assert decided == [expected] * 200
