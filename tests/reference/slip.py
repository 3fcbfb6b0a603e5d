"""One slip phase of a dry friction oscillator in closed form, and the first zero of its velocity.

    x = free + forced - mode Fk/k     (free: damped in any degree; forced: also at undamped resonance)

The first zero cannot be missed: from a point with velocity u > 0 and slope d, with |v''| <= M from there on,
there is no zero before the positive root of u + d h - M h**2/2, and stepping from root to root converges
quadratically, from the left, to the first zero. Close to the start the Taylor series is used with its leading
zeros taken out: v = 0 there, and v' = 0 too at a release with Fs = Fk, where evaluating the closed form would
return the sign of a rounding error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from reference.arithmetic import Numbers, Real


class Undecided(ArithmeticError):
    """Two quantities that decide a mode agree to within rounding."""


class Parameters(Protocol):
    """What a slip phase reads: m x'' + c x' + k x = F0 sin(w t) - mode Fk."""

    m: Real
    c: Real
    k: Real
    Fk: Real
    F0: Real
    w: Real
    numbers: Numbers


@dataclass(frozen=True)
class Forced:
    """Forced motion from a given phase of the forcing: position and velocity after a local time tau."""

    o: Parameters
    phase: Real

    @property
    def resonant(self) -> bool:
        """No damping and w**2 = k/m: the motion grows in proportion to time."""
        return self.o.c == 0 and self.o.k == self.o.m * self.o.w * self.o.w

    def __call__(self, tau: Real) -> tuple[Real, Real]:
        o, num = self.o, self.o.numbers
        sin, cos = num.sin(self.phase + o.w * tau), num.cos(self.phase + o.w * tau)
        if self.resonant:
            g = o.F0 / (2 * o.m * o.w)
            return -g * tau * cos, g * (o.w * tau * sin - cos)
        stiff, damp = o.k - o.m * o.w * o.w, o.c * o.w
        g = o.F0 / (stiff * stiff + damp * damp)
        return g * (stiff * sin - damp * cos), g * o.w * (stiff * cos + damp * sin)

    def velocity_size(self, tau: Real) -> Real:
        """A bound of |velocity| up to tau."""
        o, num = self.o, self.o.numbers
        if self.resonant:
            return o.F0 / (2 * o.m) * (tau + 1 / o.w)
        return o.F0 * o.w / num.sqrt((o.k - o.m * o.w * o.w) ** 2 + (o.c * o.w) ** 2)

    def jerk_size(self, tau: Real) -> Real:
        """A bound of |velocity''| from tau on (at resonance: for a turn, and no step is longer than that)."""
        o, num = self.o, self.o.numbers
        if self.resonant:
            return o.F0 / (2 * o.m) * (o.w * o.w * tau + o.w * (3 + num.turn_hi))
        return o.w * o.w * self.velocity_size(tau)


@dataclass(frozen=True)
class Slip:
    """A slip phase from (turns, phase), where it has displacement x, in local time tau >= 0."""

    o: Parameters
    turns: int
    phase: Real
    x: Real
    mode: int
    forced: Forced
    free_start: tuple[Real, Real]
    series: tuple[Real, ...]  # of x at tau = 0, used for tau <= reach
    zeros: int  # leading coefficients of the velocity that are zero by decree
    reach: Real

    @classmethod
    def begin(cls, o: Parameters, turns: int, phase: Real, x: Real, v: Real, mode: int, accel: Real) -> Slip:
        """Start a slip; v and accel are exact zeros where the event that led here made them zero."""
        num, forced = o.numbers, Forced(o, phase)
        x_forced, v_forced = forced(num.number(0))
        rate = o.w + num.sqrt(o.k / o.m) + o.c / o.m
        sin_cos = (num.sin(phase), num.cos(phase))
        series, term, size, n = [x, v, accel / 2], o.F0, num.number(1), 0
        while size > num.eps / 64:  # the remainder, with rate * tau <= 1/2
            n += 1
            term, size = term * o.w / n, size / (2 * n)
            force = term * (sin_cos[n % 2] if n % 4 < 2 else -sin_cos[n % 2])
            rest = force - o.c * (n + 1) * series[n + 1] - o.k * series[n]
            series.append(rest / (o.m * (n + 1) * (n + 2)))
        zeros = 0 if v != 0 else 1 if accel != 0 else 2
        if mode * series[zeros + 1] <= 0:
            raise Undecided(f"slip {mode:+d} at phase {phase} does not move off")
        free_start = (x - x_forced + mode * o.Fk / o.k, v - v_forced)
        return cls(o, turns, phase, x, mode, forced, free_start, tuple(series), zeros, 1 / (2 * rate))

    def state(self, tau: Real) -> tuple[Real, Real]:
        """(x, v) at local time tau."""
        if tau <= self.reach:
            return _horner(self.series, tau), _horner(_slope(self.series), tau)
        free, forced = self._free(tau), self.forced(tau)
        return free[0] + forced[0] - self.mode * self.o.Fk / self.o.k, free[1] + forced[1]

    def first_stop(self, horizon: Real) -> Real | None:
        """First zero of the velocity in (0, horizon], or None."""
        num = self.o.numbers
        start, near = num.number(0), min(self.reach, horizon)
        deflated = [self.mode * u for u in _slope(self.series)[self.zeros :]]
        slope = _slope(deflated)
        bound = _horner([abs(u) for u in _slope(slope)], near)
        floor = 8 * num.eps * _horner([abs(u) for u in deflated], near)

        def series(tau: Real) -> tuple[Real, Real, Real]:
            return _horner(deflated, tau), _horner(slope, tau), bound

        hit = first_zero(series, start, near, floor, num)
        if hit is None and near < horizon:
            y, z = self.free_start
            size = num.sqrt(z * z + self.o.k / self.o.m * y * y) + self.forced.velocity_size(horizon)
            hit = first_zero(self._velocity, near, horizon, 32 * num.eps * size, num)
        return hit

    def _free(self, tau: Real) -> tuple[Real, Real]:
        """Free motion y'' + 2a y' + w0**2 y = 0 and its velocity, for any damping."""
        o, num = self.o, self.o.numbers
        a, square = o.c / (2 * o.m), o.k / o.m
        gap = square - a * a
        y, z = self.free_start
        if gap > 0:
            wd, fade = num.sqrt(gap), num.exp(-a * tau)
            even, odd = fade * num.cos(wd * tau), fade * num.sin(wd * tau) / wd
        elif gap < 0:
            wd = num.sqrt(-gap)
            slow, lost = num.exp(-square / (a + wd) * tau), num.expm1(-2 * wd * tau)
            even, odd = slow * (2 + lost) / 2, -slow * lost / (2 * wd)
        else:
            even = num.exp(-a * tau)
            odd = even * tau
        return y * even + (z + a * y) * odd, z * even - (square * y + a * z) * odd

    def _velocity(self, tau: Real) -> tuple[Real, Real, Real]:
        """Velocity along the slip, its slope, and a bound of its second derivative from tau on."""
        o, num = self.o, self.o.numbers
        free, forced = self._free(tau), self.forced(tau)
        v = free[1] + forced[1]
        kx = o.k * (free[0] + forced[0]) - self.mode * o.Fk
        slope = (o.F0 * num.sin(self.phase + o.w * tau) - self.mode * o.Fk - o.c * v - kx) / o.m
        y = list(free)  # each derivative of a free motion is a free motion, and its energy falls
        for _ in range(3):
            y.append(-(o.c * y[-1] + o.k * y[-2]) / o.m)
        bound = num.sqrt(y[3] * y[3] + y[4] * y[4] * o.m / o.k) + self.forced.jerk_size(tau)
        return self.mode * v, self.mode * slope, bound


def first_zero(
    signal: Callable[[Real], tuple[Real, Real, Real]], start: Real, stop: Real, floor: Real, num: Numbers
) -> Real | None:
    """First zero in (start, stop] of a signal, positive at start, as (value, slope, bound of curvature)."""
    tau, (value, slope, bound) = start, signal(start)
    while value > floor:
        if tau == stop:
            return None
        step = 2 * value / (num.sqrt(slope * slope + 2 * bound * value) - slope)
        tau = min(tau + step, stop)
        value, slope, bound = signal(tau)
    if slope >= 0 or slope * slope <= 16 * bound * floor:
        raise Undecided(f"the velocity touches zero at local time {tau} to within rounding")
    for _ in range(4):
        value, slope, _ = signal(tau)
        tau = tau - value / slope
    return tau if tau <= stop else None


def _horner(coefficients: Sequence[Real], tau: Real) -> Real:
    total = 0 * tau
    for value in reversed(coefficients):
        total = total * tau + value
    return total


def _slope(coefficients: Sequence[Real]) -> list[Real]:
    return [n * value for n, value in enumerate(coefficients)][1:]
