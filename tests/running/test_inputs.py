"""Every kind of input in a run: its integral and the times at which it crosses a level, in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim import Input

LEVEL = 0.3
END = 6.9


@dataclass(frozen=True)
class Case:
    """An input, its integral from 0, the times in (0, END) at which it crosses LEVEL, its knots in (0, END)."""

    signal: Input
    integral: Callable[[float], float]
    crossings: list[float]
    knots: list[float]


def wave(shape: str, **more: float) -> Input:
    return Input("u", "wave", shape=shape, period=1.5, amplitude=2, offset=0.25, phase=0.1, **more)


def turns(t: float) -> tuple[int, float]:
    """Whole periods and the rest of one, of the waves above."""
    tau = (t - 0.1) / 1.5
    return math.floor(tau), tau - math.floor(tau)


def repeated(*taus: float) -> list[float]:
    """Times in (0, END) of these places in the period, in order."""
    times = [0.1 + 1.5 * (k + tau) for k in range(-1, 6) for tau in taus]
    return sorted(t for t in times if 0 < t < END)


def periodic(primitive: Callable[[float], float]) -> Callable[[float], float]:
    """Integral of 0.25 + 2 s over time, out of the integral of s over one period up to tau."""

    def up_to(t: float) -> float:
        k, tau = turns(t)
        return 0.25 * t + 2 * 1.5 * (k * primitive(1.0) + primitive(tau))

    return lambda t: up_to(t) - up_to(0.0)


def square() -> Case:
    primitive = periodic(lambda tau: min(tau, 0.3) - max(tau - 0.3, 0.0))
    return Case(wave("square", duty=0.3), primitive, repeated(0.0, 0.3), repeated(0.0, 0.3))


def triangle() -> Case:
    def primitive(tau: float) -> float:
        if tau <= 0.25:
            return 2 * tau**2
        if tau <= 0.75:
            return 0.125 + 2 * (tau - 0.25) - 2 * (tau**2 - 0.0625)
        return 0.125 + 2 * (tau**2 - 0.5625) - 4 * (tau - 0.75)

    at = (LEVEL - 0.25) / 2 / 4
    return Case(wave("triangle"), periodic(primitive), repeated(at, 0.5 - at), repeated(0.25, 0.75))


def sawtooth() -> Case:
    at = ((LEVEL - 0.25) / 2 + 1) / 2
    return Case(wave("sawtooth"), periodic(lambda tau: tau**2 - tau), repeated(0.0, at), repeated(0.0))


def sine() -> Case:
    at = math.asin((LEVEL - 0.25) / 2) / (2 * math.pi)
    primitive = periodic(lambda tau: (1 - math.cos(2 * math.pi * tau)) / (2 * math.pi))
    return Case(wave("sine"), primitive, repeated(at, 0.5 - at), [])


def chirp() -> Case:
    """phase + 2 pi (f0 t + bend t^2) up to 4, then on at f1; the integral is one of Fresnel's."""
    f0, f1, length, phase, amplitude = 0.5, 3.0, 4.0, 0.4, 1.5
    bend = (f1 - f0) / (2 * length)

    def angle(t: float) -> mpmath.mpf:
        inside = min(t, length)
        whole = f0 * inside + bend * inside**2 + f1 * max(t - length, 0)
        return phase + 2 * mpmath.pi * whole

    def integral(t: float) -> float:
        with mpmath.workdps(30):
            # complete the square: angle = a (t + c)^2 + d, and Fresnel's integrals of sin and cos(pi s^2/2)
            a, c = 2 * mpmath.pi * bend, mpmath.mpf(f0) / (2 * bend)
            d, scale = phase - a * c**2, mpmath.sqrt(2 * a / mpmath.pi)
            inside = min(t, length)
            sines, cosines = (
                f(scale * (inside + c)) - f(scale * c) for f in (mpmath.fresnels, mpmath.fresnelc)
            )
            total = (mpmath.cos(d) * sines + mpmath.sin(d) * cosines) / scale
            if t > length:
                total += (mpmath.cos(angle(length)) - mpmath.cos(angle(t))) / (2 * mpmath.pi * f1)
            return float(amplitude * total)

    at = math.asin(LEVEL / amplitude)
    crossings = []
    for k in range(20):
        for wanted in (at + 2 * math.pi * k, math.pi - at + 2 * math.pi * k):
            whole = (wanted - phase) / (2 * math.pi)
            end = f0 * length + bend * length**2
            if whole <= end:
                t = (-f0 + math.sqrt(f0**2 + 4 * bend * whole)) / (2 * bend)
            else:
                t = length + (whole - end) / f1
            crossings.append(t)
    signal = Input("u", "chirp", f0=f0, f1=f1, duration=length, phase=phase, amplitude=amplitude)
    return Case(signal, integral, sorted(t for t in crossings if 0 < t < END), [length])


TIMES = (0.5, 1.25, 2.0, 3.0, 3.0, 5.0)
VALUES = (-1.0, 2.0, 0.5, -0.25, 1.0, 0.0)


def linear() -> Case:
    def integral(t: float) -> float:
        total = Fraction(VALUES[0]) * Fraction(min(t, TIMES[0]))
        for (a, u), (b, v) in pairwise(zip(TIMES, VALUES, strict=True)):
            if a < t and b > a:
                h = Fraction(min(t, b)) - Fraction(a)
                slope = (Fraction(v) - Fraction(u)) / (Fraction(b) - Fraction(a))
                total += h * Fraction(u) + slope * h**2 / 2
        return float(total + Fraction(VALUES[-1]) * max(Fraction(t) - Fraction(TIMES[-1]), Fraction(0)))

    crossings = [
        a + (b - a) * (LEVEL - u) / (v - u)
        for (a, u), (b, v) in pairwise(zip(TIMES, VALUES, strict=True))
        if (u - LEVEL) * (v - LEVEL) < 0
    ]
    return Case(Input("u", "table", times=TIMES, values=VALUES), integral, crossings, sorted({*TIMES}))


def cubic() -> Case:
    """Three equal steps of 2 through 0, 1, 0, -1 (from t = 0 on): the moments of the natural spline by hand.

    With h = 2 and slopes 1/2, -1/2, -1/2: 8 M1 + 2 M2 = -6 and 2 M1 + 8 M2 = 0, so M1 = -4/5, M2 = 1/5.
    """
    moments = (0.0, -0.8, 0.2, 0.0)
    values = (0.0, 1.0, 0.0, -1.0)

    def piece(i: int) -> np.polynomial.Polynomial:
        bend = (moments[i + 1] - moments[i]) / 2
        slope = (values[i + 1] - values[i]) / 2 - 2 * (2 * moments[i] + moments[i + 1]) / 6
        return np.polynomial.Polynomial([values[i], slope, moments[i] / 2, bend / 6])

    def integral(t: float) -> float:
        total = sum(float(piece(i).integ()(min(t - 2 * i, 2.0))) for i in range(3) if t > 2 * i)
        return total + values[-1] * max(t - 6.0, 0.0)

    crossings = [
        2 * i + root.real
        for i in range(3)
        for root in (piece(i) - LEVEL).roots()
        if abs(root.imag) < 1e-12 and 0 <= root.real < 2
    ]
    signal = Input("u", "table", times=(0, 2, 4, 6), values=values, interpolation="cubic")
    return Case(signal, integral, crossings, [2.0, 4.0, 6.0])


CASES = {"square": square, "triangle": triangle, "sawtooth": sawtooth, "sine": sine, "chirp": chirp}
CASES |= {"linear table": linear, "cubic table": cubic}


@pytest.mark.parametrize("integrator", ["dop853", "scipy-dop853", "cvode-adams"])
@pytest.mark.parametrize("name", CASES)
def test_an_input_in_a_run(name: str, integrator: str) -> None:
    case = CASES[name]()
    model = hs.Model(
        "driven",
        states=(hs.State("x", 0, "u"),),
        inputs=(case.signal,),
        monitors=(hs.Monitor("level", f"u - {LEVEL}"),),
    )
    sol = hs.simulate(model, (0.0, END), integrator=integrator, rtol=1e-10)
    assert sol.event_times("level") == pytest.approx(case.crossings, abs=1e-9)
    boundaries = sol.t[1:][np.diff(sol.t) == 0.0]
    assert all(abs(boundaries - knot).min() <= 4 * math.ulp(knot) for knot in case.knots)
    for t in np.linspace(0.0, END, 41):
        assert sol(t)[0] == pytest.approx(case.integral(t), abs=1e-8)
