"""Pairs of doubles for time, against exact fractions and mpmath."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.engine.system.instant import _TWO_PI, Instant, multiple, phase, times, two_product, two_sum

# far from overflow and underflow, where the error of a sum or a product is itself a double
doubles = st.floats(-1e100, 1e100, allow_subnormal=False).filter(lambda a: a == 0.0 or abs(a) > 1e-100)
seconds = st.floats(-1e9, 1e9, allow_subnormal=False).filter(lambda a: a == 0.0 or abs(a) > 1e-12)
# two roundings of the low part, each of 2**-53 of at most half an ulp of the high one
PAIR = Fraction(1, 2**104)


@st.composite
def instants(draw: st.DrawFn) -> Instant:
    high = draw(seconds)
    return Instant(high, draw(st.floats(-0.5, 0.5)) * math.ulp(high))


def exact(instant: Instant) -> Fraction:
    return Fraction(instant.high) + Fraction(instant.low)


def is_normal(instant: Instant) -> bool:
    return instant.high == instant.high + instant.low


@given(doubles, doubles)
def test_a_sum_and_its_error_are_the_exact_sum(a: float, b: float) -> None:
    high, low = two_sum(a, b)
    assert high == a + b
    assert Fraction(high) + Fraction(low) == Fraction(a) + Fraction(b)


@given(doubles, doubles)
def test_a_product_and_its_error_are_the_exact_product(a: float, b: float) -> None:
    high, low = two_product(a, b)
    assert high == a * b
    assert Fraction(high) + Fraction(low) == Fraction(a) * Fraction(b)


@given(instants(), seconds)
def test_moving_an_instant_rounds_to_the_pair(instant: Instant, step: float) -> None:
    moved = instant.plus(step)
    assert is_normal(moved)
    error = abs(exact(moved) - exact(instant) - Fraction(step))
    assert error <= PAIR * (abs(Fraction(instant.high)) + abs(Fraction(step)))


@given(instants(), instants())
def test_a_difference_of_instants_is_rounded_once_where_they_are_near(a: Instant, b: Instant) -> None:
    true = exact(a) - exact(b)
    assert abs(Fraction(a.minus(b)) - true) <= abs(true) / 2**52 + PAIR * abs(Fraction(a.high))


@given(instants(), st.floats(-1e3, 1e3, allow_subnormal=False).filter(lambda h: h == 0.0 or abs(h) > 1e-9))
def test_a_step_is_found_again_in_the_difference(instant: Instant, step: float) -> None:
    """Local times survive the trip through the origin: what the mode loop relies on when it starts a segment."""
    back = instant.plus(step).minus(instant)
    assert abs(Fraction(back) - Fraction(step)) <= Fraction(math.ulp(step)) + PAIR * abs(
        Fraction(instant.high)
    )


@given(st.integers(-(2**53), 2**53), doubles)
def test_a_multiple_from_zero_is_exact(k: int, period: float) -> None:
    assert exact(multiple(0.0, k, period)) == k * Fraction(period)


@given(seconds, st.integers(0, 10**12), seconds)
def test_a_scheduled_time_is_the_exact_one_rounded_to_the_pair(start: float, k: int, period: float) -> None:
    true = Fraction(start) + k * Fraction(period)
    found = multiple(start, k, period)
    assert is_normal(found)
    assert abs(exact(found) - true) <= PAIR * (abs(Fraction(start)) + k * abs(Fraction(period)))


def test_a_clock_of_a_tenth_is_not_a_running_sum() -> None:
    """Ten million tenths added up are off by 1e-4; the ten-millionth tick is right to the pair."""
    assert exact(multiple(0.0, 10**7, 0.1)) == 10**7 * Fraction(0.1)


def test_two_pi_is_right_to_three_doubles() -> None:
    with mpmath.workprec(400):
        for parts in range(1, 4):
            error = abs(sum(map(mpmath.mpf, _TWO_PI[:parts])) - 2 * mpmath.pi)
            assert error <= mpmath.mpf(math.ulp(_TWO_PI[parts - 1])) / 2


@given(instants(), st.floats(1e-3, 1e3), st.floats(-7, 7))
def test_a_phase_is_right_to_two_ulps_of_pi(instant: Instant, rate: float, offset: float) -> None:
    check_phase(instant, rate, offset)


@pytest.mark.parametrize("turns", [0.5, 1.0, 1e3 + 0.5, 1e6, 1e6 + 0.25, 1e9 - 0.5, 1e9])
@pytest.mark.parametrize("rate", [1.0, 0.6 * math.sqrt(1e5 / 0.2), 2 * math.pi, 1e-5, 7e8])
def test_a_phase_stays_right_over_a_billion_turns(turns: float, rate: float) -> None:
    """Also where the angle is as near to a whole or half turn as doubles come."""
    with mpmath.workdps(60):
        t = 2 * mpmath.pi * mpmath.mpf(turns) / mpmath.mpf(rate)
        high = float(t)
        near = Instant(high, float(t - high))
    for instant in (
        near,
        Instant(near.high),
        Instant(math.nextafter(near.high, math.inf)),
        Instant(-near.high),
    ):
        for offset in (0.0, 1e-9, math.pi, -math.pi):
            check_phase(instant, rate, offset)


def check_phase(instant: Instant, rate: float, offset: float) -> None:
    found = phase(instant, rate, offset)
    with mpmath.workdps(80):
        angle = mpmath.mpf(rate) * (mpmath.mpf(instant.high) + mpmath.mpf(instant.low)) + mpmath.mpf(offset)
        gap = (mpmath.mpf(found) - angle) / (2 * mpmath.pi)
        error = abs(gap - mpmath.nint(gap)) * 2 * mpmath.pi
    assert error <= 2 * math.ulp(math.pi)
    # the number of turns is that of the rounded angle, so a result may pass half a turn by that rounding
    assert abs(found) <= math.pi + 4 * math.ulp(float(abs(angle)))


def test_a_phase_of_no_finite_angle_is_not_a_number() -> None:
    assert math.isnan(phase(Instant(math.inf), 1.0, 0.0))
    assert math.isnan(phase(Instant(1e300), 1e300, 0.0))


@given(instants(), st.floats(-1e3, 1e3, allow_subnormal=False).filter(lambda r: r == 0.0 or abs(r) > 1e-9))
def test_an_instant_times_a_rate_is_right_to_the_pair(instant: Instant, rate: float) -> None:
    true = exact(instant) * Fraction(rate)
    assert abs(exact(times(instant, rate)) - true) <= 2 * PAIR * abs(true)
