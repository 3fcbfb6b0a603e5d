"""Dense output from Taylor coefficients at both ends, against the polynomial itself and the error formula."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.engine.record.hermite import hermite, middle_weights


def taylor(coefficients: list[Fraction], at: Fraction, count: int) -> list[Fraction]:
    """The first coefficients of a polynomial about another point, exactly."""
    return [
        sum(math.comb(j, k) * c * at ** (j - k) for j, c in enumerate(coefficients) if j >= k)
        for k in range(count)
    ]


@pytest.mark.parametrize("count", [2, 3, 4])
@given(data=st.data(), s0=st.floats(-10, 10), h=st.sampled_from([1e-6, 0.1, 1.0, -0.5, 7.0]))
def test_a_polynomial_of_degree_2k_minus_1_is_its_own_interpolant(
    count: int, data: st.DataObject, s0: float, h: float
) -> None:
    """The polynomial is given in (s - s0)/h, so that every case is of the same difficulty."""
    whole = st.integers(-9, 9).map(Fraction)
    rows = data.draw(
        st.lists(st.lists(whole, min_size=2 * count, max_size=2 * count), min_size=1, max_size=3)
    )
    s1 = s0 + h
    width = Fraction(s1) - Fraction(s0)
    powers = np.array([float(1 / width**k) for k in range(count)])
    left = np.array([[float(c) for c in taylor(row, Fraction(0), count)] for row in rows]) * powers
    right = np.array([[float(c) for c in taylor(row, Fraction(1), count)] for row in rows]) * powers
    dense = hermite(s0, s1, left, right)
    times = np.array([s0, s1, *(s0 + h * np.array([0.125, 0.3, 0.77]))])
    found = dense(times)
    assert (found[0] == left[:, 0]).all()
    assert (found[1] == right[:, 0]).all()
    for s, values in zip(times, found, strict=True):
        theta = (Fraction(float(s)) - Fraction(s0)) / width
        for row, value in zip(rows, values, strict=True):
            true = float(sum(c * theta**j for j, c in enumerate(row)))
            # theta is rounded to an ulp of s over h, and the polynomial has a slope of up to some 9*36
            assert value == pytest.approx(true, abs=1e-11 + 400 * math.ulp(abs(s0) + abs(h)) / abs(h))


def test_the_error_is_the_known_one() -> None:
    """exp on [0, h] with four coefficients: h**8 exp(xi)/(256 8!) at the middle."""
    for h in (1.0, 0.5):
        left = np.array([[1 / math.factorial(k) for k in range(4)]])
        dense = hermite(0.0, h, left, left * math.exp(h))
        error = abs(dense(np.array([h / 2]))[0, 0] - math.exp(h / 2))
        assert h**8 / (256 * math.factorial(8)) <= error <= math.exp(h) * h**8 / (256 * math.factorial(8))


def test_it_meets_its_ends_where_the_local_times_are_not_representable_multiples() -> None:
    s0, s1 = 0.1, 0.1 + 1e-9
    dense = hermite(s0, s1, np.array([[0.3, 1.0]]), np.array([[0.7, -1.0]]))
    assert dense(np.array([s0]))[0, 0] == 0.3
    assert dense(np.array([s1]))[0, 0] == 0.7


def test_the_middle() -> None:
    """Weights of both ends in value and slope there, against the polynomial of random ends."""
    draw = np.random.default_rng(5)
    for count in (2, 3, 4):
        left, right = draw.normal(size=(2, 1, count))
        h, signs = 0.7, (-1.0) ** np.arange(count)
        value, slope = middle_weights(count) @ (h ** np.arange(count) * left[0])
        value += middle_weights(count)[0] @ (h ** np.arange(count) * signs * right[0])
        slope -= middle_weights(count)[1] @ (h ** np.arange(count) * signs * right[0])
        dense = hermite(0.0, h, left, right)
        near = 1e-4
        assert dense(np.array([0.5 * h]))[0, 0] == pytest.approx(value, rel=1e-12)
        difference = np.diff(dense(np.array([0.5 * h - near, 0.5 * h + near]))[:, 0])[0] / (2.0 * near)
        assert slope / h == pytest.approx(difference, rel=1e-5, abs=1e-5)
