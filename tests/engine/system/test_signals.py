"""Inputs, piece by piece, against exact fractions, splines solved in fractions, and mpmath, near and far out."""

from __future__ import annotations

import math
import sys
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hybridsim.engine.system.instant import Instant, multiple
from hybridsim.engine.system.signals import Signal
from hybridsim.engine.system.system import System
from hybridsim.model import Input, Model, State

EPS = 2.0**-52
periods = st.floats(1e-3, 1e3)
turns = st.sampled_from([0, 1, 7, -3, 1000, 10**6, 10**9])


def value(slots: tuple[float, ...], s: float) -> float:
    """A piece at local time s, as the generated code evaluates it."""
    c0, c1, c2, c3, c4 = slots
    d = s - c4
    return c0 + d * (c1 + d * (c2 + d * c3))


def angle_value(slots: tuple[float, ...], s: float) -> float:
    c0, c1, c2, c3, c4 = slots
    d = s - c4
    return c3 * math.sin(c0 + d * (c1 + d * c2))


def exact(instant: Instant) -> Fraction:
    return Fraction(instant.high) + Fraction(instant.low)


# -- waves ------------------------------------------------------------------------------------------------------

SHAPES = {
    "square": lambda tau, duty: Fraction(1 if tau < duty else -1),
    "triangle": lambda tau, duty: 4 * tau if tau <= Fraction(1, 4) else abs(4 * tau - 3) - 1,
    "sawtooth": lambda tau, duty: 2 * tau - 1,
}
CORNERS = {"square": (0.0, None), "triangle": (0.25, 0.75), "sawtooth": (0.0,)}


def wave(
    shape: str,
    period: float,
    delay: float = 0.0,
    amplitude: float = 1.0,
    offset: float = 0.0,
    duty: float = 0.5,
):
    given = {"duty": duty} if shape == "square" else {}
    return Signal(
        Input(
            "u", "wave", shape=shape, period=period, phase=delay, amplitude=amplitude, offset=offset, **given
        ),
        {},
    )


@pytest.mark.parametrize("shape", SHAPES)
@given(
    period=periods,
    k=turns,
    at=st.fractions(0, 1, max_denominator=1000),
    delay=st.floats(-5, 5),
    amplitude=st.floats(0.1, 10),
    duty=st.floats(0.05, 0.95),
    forward=st.booleans(),
)
def test_waves_are_exact_over_a_billion_periods(
    shape: str,
    period: float,
    k: int,
    at: Fraction,
    delay: float,
    amplitude: float,
    duty: float,
    forward: bool,
) -> None:
    """The phase of an instant is found in fractions, and no digit is lost far out."""
    origin = multiple(delay, k, period).plus(float(at) * period)
    tau = (exact(origin) - Fraction(delay)) / Fraction(period)
    tau -= math.floor(tau)
    corners = [duty if c is None else c for c in CORNERS[shape]] + [1.0]
    assume(all(abs(tau - Fraction(c)) > Fraction(1, 10**9) for c in [*corners, 0.0]))
    signal = wave(shape, period, delay, amplitude, 0.5, duty)
    true = Fraction(0.5) + Fraction(amplitude) * SHAPES[shape](tau, Fraction(duty))
    # the knot, its distance and the straight line from it: each rounded a time or two
    assert abs(Fraction(value(signal.piece(origin, forward), 0.0)) - true) <= 40 * Fraction(EPS) * Fraction(
        amplitude
    )


@pytest.mark.parametrize("shape", SHAPES)
@given(period=periods, k=turns, at=st.floats(0, 1), duty=st.floats(0.05, 0.95))
def test_the_next_knot_is_the_nearest_corner(
    shape: str, period: float, k: int, at: float, duty: float
) -> None:
    signal = wave(shape, period, 0.0, duty=duty)
    origin = multiple(0.0, k, period).plus(at * period)
    corners = [Fraction(duty) if c is None else Fraction(c) for c in CORNERS[shape]]
    tau = exact(origin) / Fraction(period)
    for forward in (True, False):
        knot = signal.next_knot(origin, forward)
        assert (knot.minus(origin) > 0.0) == forward
        found = exact(knot) / Fraction(period)
        base = math.floor(tau)
        expected = [n + c for n in range(base - 2, base + 3) for c in corners]
        slack = Fraction(EPS)
        ahead = [e for e in expected if (e > tau + slack if forward else e < tau - slack)]
        nearest = min(ahead) if forward else max(ahead)
        # a corner that coincides with the origin within rounding may count as ahead or behind
        assert abs(found - nearest) <= slack or abs(found - tau) <= slack


@pytest.mark.parametrize("k", [0, 5, -7, 10**6])
def test_a_square_wave_is_right_continuous_forward_and_left_continuous_backward(k: int) -> None:
    signal = wave("square", 0.1, duty=0.25)
    jump = multiple(0.0, k, 0.1)
    assert value(signal.piece(jump, True), 0.0) == 1.0
    assert value(signal.piece(jump, False), 0.0) == -1.0
    drop = signal.next_knot(jump, True)
    assert drop.minus(jump) == pytest.approx(0.025, rel=1e-15)
    assert value(signal.piece(drop, True), 0.0) == -1.0
    assert value(signal.piece(drop, False), 0.0) == 1.0
    assert signal.next_knot(drop, False) == jump


def test_knots_of_a_wave_follow_each_other_for_ever() -> None:
    """A thousand knots, each found from the one before it, a million periods out: none is skipped or doubled."""
    signal = wave("square", 0.7, delay=0.3, duty=0.3)
    instant = multiple(0.3, 10**6, 0.7)
    for j in range(1000):
        k, drop = divmod(j + 1, 2)
        instant = signal.next_knot(instant, True)
        true = Fraction(0.3) + (10**6 + k) * Fraction(0.7) + drop * Fraction(0.3) * Fraction(0.7)
        assert abs(exact(instant) - true) <= Fraction(math.ulp(0.7))


@given(period=periods, k=turns, at=st.floats(0, 1), delay=st.floats(-5, 5), local=st.floats(0, 3))
def test_a_sine_is_right_to_rounding_over_a_billion_periods(
    period: float, k: int, at: float, delay: float, local: float
) -> None:
    model = Model(
        "m",
        states=(State("x", 0.0, "u"),),
        inputs=(Input("u", "wave", shape="sine", period="T", phase=delay, amplitude=2.0, offset=1.0),),
        parameters={"T": period},
    )
    system = System(model)
    origin, s = multiple(delay, k, period).plus(at * period), local * period
    with mpmath.workdps(60):
        t = mpmath.mpf(origin.high) + mpmath.mpf(origin.low) + mpmath.mpf(s)
        true = 1 + 2 * mpmath.sin(2 * mpmath.pi * (t - mpmath.mpf(delay)) / mpmath.mpf(period))
        p = system.vector(origin, np.zeros(0))
        # an angle of up to four turns, each of its terms rounded
        assert abs(system.flow(s, np.zeros(1), p, np.zeros(0, dtype=np.int64))[0] - true) <= 2 * 60 * EPS
    assert system.signals[0].next_knot(origin, True) is None


@given(
    f0=st.floats(0.1, 50),
    f1=st.floats(0.1, 50),
    duration=st.floats(0.5, 100),
    at=st.floats(-1, 3),
    angle=st.floats(-3, 3),
)
def test_a_chirp_is_right_inside_and_outside_its_sweep(
    f0: float, f1: float, duration: float, at: float, angle: float
) -> None:
    signal = Signal(Input("u", "chirp", f0=f0, f1=f1, duration=duration, amplitude=3.0, phase=angle), {})
    origin = Instant(at * duration)
    knot = signal.next_knot(origin, True)
    length = duration if knot is None else knot.minus(origin)
    for share in (0.0, 0.25, 0.999):
        s = share * min(length, 2.0 / max(f0, f1))
        with mpmath.workdps(40):
            t = mpmath.mpf(origin.high) + mpmath.mpf(s)
            true = 3 * mpmath.sin(mpmath.mpf(angle) + 2 * mpmath.pi * chirp_turns(t, f0, f1, duration))
            error = abs(angle_value(signal.piece(origin, True), s) - true)
        assert error <= 3 * 100 * EPS


def chirp_turns(t: mpmath.mpf, f0: float, f1: float, duration: float) -> mpmath.mpf:
    """f0 t + (f1 - f0) t**2/(2 duration) inside; straight on with f0 before and f1 after."""
    a, b, end = map(mpmath.mpf, (f0, f1, duration))
    if t < 0:
        return a * t
    if t <= end:
        return a * t + (b - a) * t**2 / (2 * end)
    return (a + b) / 2 * end + b * (t - end)


def test_a_chirp_ends_at_its_duration_and_stays_exact_far_beyond() -> None:
    signal = Signal(Input("u", "chirp", f0=2, f1=30, duration=4.5), {})
    assert signal.next_knot(Instant(1.0), True) == Instant(4.5)
    assert signal.next_knot(Instant(4.5), True) is None
    assert signal.next_knot(Instant(4.5), False) == Instant(0.0)
    with mpmath.workdps(60):
        for t in (4.5, 1e3 + 1 / 3, 1e6 + 1 / 7, 1e8 + 0.1):
            true = mpmath.sin(2 * mpmath.pi * chirp_turns(mpmath.mpf(t), 2, 30, 4.5))
            assert abs(angle_value(signal.piece(Instant(t), True), 0.0) - true) <= 8 * EPS


# -- tables -----------------------------------------------------------------------------------------------------


@st.composite
def tables(draw: st.DrawFn) -> tuple[list[float], list[float]]:
    steps = draw(st.lists(st.floats(0.01, 10), min_size=1, max_size=6))
    start = draw(st.sampled_from([0.0, -3.25, 1e6, 123.456]))
    times = [start]
    for step in steps:
        times.append(times[-1] + step)
    values = draw(st.lists(st.floats(-10, 10), min_size=len(times), max_size=len(times)))
    return times, values


@given(tables(), st.floats(-0.3, 1.3), st.booleans(), st.data())
def test_a_linear_table_is_the_exact_chord(
    table: tuple[list[float], list[float]], at: float, forward: bool, data: st.DataObject
) -> None:
    times, values = table
    signal = Signal(Input("u", "table", times=times, values=values), {})
    origin = Instant(times[0] + at * (times[-1] - times[0]))
    s = data.draw(st.floats(0, 1)) * local_span(signal, origin, forward)
    t = exact(origin) + Fraction(s)
    error = abs(Fraction(value(signal.piece(origin, forward), s)) - chord(times, values, t))
    assert error <= 8 * Fraction(EPS) * Fraction(max(map(abs, values)) + 1e-300)


def local_span(signal: Signal, origin: Instant, forward: bool) -> float:
    knot = signal.next_knot(origin, forward)
    return (1.0 if forward else -1.0) if knot is None else knot.minus(origin)


def chord(times: list[float], values: list[float], t: Fraction) -> Fraction:
    if t <= times[0]:
        return Fraction(values[0])
    for (a, u), (b, v) in pairwise(zip(map(Fraction, times), map(Fraction, values), strict=True)):
        if t <= b:
            return u + (v - u) * (t - a) / (b - a)
    return Fraction(values[-1])


@given(tables(), st.floats(0, 1), st.data())
def test_a_cubic_table_is_the_natural_spline(
    table: tuple[list[float], list[float]], at: float, data: st.DataObject
) -> None:
    """Moments solved in fractions: S'' continuous, zero at both ends."""
    times, values = table
    signal = Signal(Input("u", "table", times=times, values=values, interpolation="cubic"), {})
    origin = Instant(times[0] + at * (times[-1] - times[0]))
    s = data.draw(st.floats(0, 1)) * local_span(signal, origin, True)
    t = exact(origin) + Fraction(s)
    true, size = natural_spline(times, values, min(max(t, Fraction(times[0])), Fraction(times[-1])))
    assert abs(Fraction(value(signal.piece(origin, True), s)) - true) <= 400 * Fraction(EPS) * size


def natural_spline(times: list[float], values: list[float], t: Fraction) -> tuple[Fraction, Fraction]:
    """The spline at t, and the size of its terms: what rounding is relative to."""
    x, y = list(map(Fraction, times)), list(map(Fraction, values))
    h = [b - a for a, b in pairwise(x)]
    n = len(x)
    moments = [Fraction(0)] * n
    # Thomas algorithm for h[i-1] M[i-1] + 2 (h[i-1] + h[i]) M[i] + h[i] M[i+1] = 6 (slope[i] - slope[i-1])
    upper, right = [Fraction(0)] * n, [Fraction(0)] * n
    for i in range(1, n - 1):
        pivot = 2 * (h[i - 1] + h[i]) - h[i - 1] * upper[i - 1]
        upper[i] = h[i] / pivot
        bend = 6 * ((y[i + 1] - y[i]) / h[i] - (y[i] - y[i - 1]) / h[i - 1])
        right[i] = (bend - h[i - 1] * right[i - 1]) / pivot
    for i in range(n - 2, 0, -1):
        moments[i] = right[i] - upper[i] * moments[i + 1]
    i = max(k for k in range(n - 1) if x[k] <= t) if t > x[0] else 0
    a, b = (x[i + 1] - t) / h[i], (t - x[i]) / h[i]
    bend = ((a**3 - a) * moments[i] + (b**3 - b) * moments[i + 1]) * h[i] ** 2 / 6
    size = max(map(abs, y)) + max(map(abs, moments)) * max(h) ** 2 + Fraction(1, 10**300)
    return a * y[i] + b * y[i + 1] + bend, size


def test_a_cubic_table_agrees_with_scipy() -> None:
    from scipy.interpolate import CubicSpline

    rng = np.random.default_rng(5)
    times, values = np.cumsum(rng.uniform(0.1, 2, 30)), rng.normal(size=30)
    signal = Signal(Input("u", "table", times=times, values=values, interpolation="cubic"), {})
    spline = CubicSpline(times, values, bc_type="natural")
    for t in rng.uniform(times[0], times[-1], 200):
        assert value(signal.piece(Instant(t), True), 0.0) == pytest.approx(float(spline(t)), abs=1e-13)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_the_end_values_hold_beyond_a_table(kind: str) -> None:
    signal = Signal(Input("u", "table", times=(1, 2, 4), values=(3, -1, 7), interpolation=kind), {})
    for t, expected in ((-100.0, 3.0), (0.999, 3.0), (4.0, 7.0), (1e9, 7.0)):
        piece = signal.piece(Instant(t), True)
        assert value(piece, 0.0) == expected
        assert value(piece, 0.0005) == expected
    assert value(signal.piece(Instant(1.0), False), -0.5) == 3.0


def test_the_knots_of_a_table_both_ways() -> None:
    signal = Signal(Input("u", "table", times=(1, 2, 4), values=(3, -1, 7)), {})
    forward = {0.0: 1.0, 1.0: 2.0, 1.5: 2.0, 2.0: 4.0, 4.0: None, 9.0: None}
    backward = {0.0: None, 1.0: None, 1.5: 1.0, 2.0: 1.0, 4.0: 2.0, 9.0: 4.0}
    for ahead, table in ((True, forward), (False, backward)):
        for t, knot in table.items():
            assert signal.next_knot(Instant(t), ahead) == (None if knot is None else Instant(knot))


def test_walking_a_table_meets_each_knot_once_both_ways() -> None:
    """A record of ten thousand knots, uneven, far from the origin of time."""
    times = 1e6 + np.cumsum(np.random.default_rng(2).uniform(1e-3, 0.1, 10_000))
    signal = Signal(Input("u", "table", times=times, values=np.zeros(10_000)), {})
    for forward in (True, False):
        met, instant = [], Instant(0.0 if forward else 1e7)
        while (knot := signal.next_knot(instant, forward)) is not None:
            met.append(float(knot))
            instant = knot
        assert met == (times.tolist() if forward else times[::-1].tolist())


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_a_knot_costs_the_same_in_a_long_table(kind: str) -> None:
    """The work for one knot, counted in function calls, does not grow with the table."""

    def calls(knots: int) -> int:
        times = np.arange(knots) * 0.02
        signal = Signal(Input("u", "table", times=times, values=times, interpolation=kind), {})
        counted: list[str] = []
        sys.setprofile(lambda _frame, event, _argument: counted.append(event))
        try:
            signal.next_knot(Instant(0.09), True)
            signal.piece(Instant(0.09), True)
        finally:
            sys.setprofile(None)
        return len(counted)

    assert calls(10_000) == calls(10)


def test_a_jump_in_a_table_has_two_sides() -> None:
    signal = Signal(Input("u", "table", times=(0, 1, 1, 2), values=(0, 1, 5, 6)), {})
    assert value(signal.piece(Instant(1.0), True), 0.0) == 5.0
    assert value(signal.piece(Instant(1.0), False), 0.0) == 1.0
    assert value(signal.piece(Instant(0.5), True), 0.25) == 0.75
    assert value(signal.piece(Instant(1.5), False), -0.25) == 5.25
    assert signal.next_knot(Instant(0.5), True) == signal.next_knot(Instant(1.5), False) == Instant(1.0)


def test_numbers_of_an_input_may_be_parameters() -> None:
    signal = Signal(Input("u", "wave", shape="square", period="2*T", amplitude="A"), {"T": 0.25, "A": 4.0})
    assert value(signal.piece(Instant(0.3), True), 0.0) == -4.0
    assert signal.next_knot(Instant(0.3), True) == Instant(0.5)
