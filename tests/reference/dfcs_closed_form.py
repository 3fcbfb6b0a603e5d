"""Closed-form, event-by-event solution of a dry friction oscillator, independent of the package.

    m x'' + c x' + k x + f = F0 sin(w t),   k > 0, w > 0, c >= 0
    slip  x' > 0: f = Fk,  x' < 0: f = -Fk
    stick x' = 0: f = e = F0 sin(w t) - k x,  |e| <= Fs,  Fs >= Fk >= 0

Every slip phase has a closed form (slip.py), so only its end is searched for; stick ends at an arcsine.
Time is kept as a number of turns of the forcing and a phase, so a million periods cost no digits.
A decision that falls within rounding raises `Undecided`: run it again with `multiprecision(digits)`.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

from reference.arithmetic import FLOAT, Numbers, Real
from reference.slip import Slip, Undecided

__all__ = ["Change", "Motion", "Oscillator", "Stick", "Undecided"]


@dataclass(frozen=True)
class Stick:
    """A stick phase at displacement x, from (turns, phase) on."""

    turns: int
    phase: Real
    x: Real
    mode: int = 0

    def state(self, tau: Real) -> tuple[Real, Real]:
        """(x, 0) at any local time tau."""
        return self.x, 0 * tau


@dataclass(frozen=True)
class Change:
    """A mode change: time, the mode that begins (+1, -1, 0 for stick), displacement, and the exact phase."""

    t: Real
    mode: int
    x: Real
    turns: int
    phase: Real


@dataclass(frozen=True)
class Motion:
    """The pieces of one motion and the times at which they start; `state(t)` is its value anywhere."""

    system: Oscillator
    pieces: tuple[Stick | Slip, ...]
    starts: tuple[Real, ...]
    t1: Real

    @property
    def changes(self) -> tuple[Change, ...]:
        """Mode changes after the start, the first release from a stick start included."""
        after = zip(self.starts[1:], self.pieces[1:], strict=True)
        return tuple(Change(t, p.mode, p.x, p.turns, p.phase) for t, p in after)

    def state(self, t: Real) -> tuple[Real, Real, int]:
        """(x, v, mode) at t, right-continuous at a change."""
        num = self.system.numbers
        piece = self.pieces[max(0, bisect_right(self.starts, num.number(t)) - 1)]
        tau = self.system.elapsed((piece.turns, piece.phase), num.phase(self.system.w, t))
        return (*piece.state(max(tau, num.number(0))), piece.mode)

    def amplitude(self, t0: Real, t1: Real) -> Real:
        """(max x - min x)/2 over [t0, t1]: extremes are at mode changes or at the ends."""
        inside = [p.x for t, p in zip(self.starts, self.pieces, strict=True) if t0 <= t <= t1]
        values = [*inside, self.state(t0)[0], self.state(t1)[0]]
        return (max(values) - min(values)) / 2


@dataclass(frozen=True)
class Oscillator:
    """The parameters; `numbers` is the arithmetic everything is done in."""

    m: Real
    c: Real
    k: Real
    Fs: Real
    Fk: Real
    F0: Real
    w: Real
    numbers: Numbers = FLOAT

    def __post_init__(self) -> None:
        for name in ("m", "c", "k", "Fs", "Fk", "F0", "w"):
            object.__setattr__(self, name, self.numbers.number(getattr(self, name)))

    def run(self, t0: Real, t1: Real, x0: Real, v0: Real = 0) -> Motion:
        """Follow the motion from (x0, v0) at t0 to t1 > t0."""
        num = self.numbers
        x, v = num.number(x0), num.number(v0)
        turns, phase = num.phase(self.w, t0)
        end = num.phase(self.w, t1)
        mode, accel = self._mode_at_start(phase, x, v)
        pieces: list[Stick | Slip] = []
        while (left := self.elapsed((turns, phase), end)) >= 0:
            if mode == 0:
                pieces.append(Stick(turns, phase, x))
                angle, mode = self._release(phase, x)
                if mode == 0:
                    break
                turns, phase = num.wrap(turns, phase + angle)
                v, accel = num.number(0), mode * (self.Fs - self.Fk) / self.m
            else:
                pieces.append(Slip.begin(self, turns, phase, x, v, mode, accel))
                tau = pieces[-1].first_stop(left)
                if tau is None:
                    break
                x, v = pieces[-1].state(tau)[0], num.number(0)
                turns, phase = num.wrap(turns, phase + self.w * tau)
                mode, accel = self._mode_at_stop(phase, x)
        period = num.turn_hi / self.w
        starts = [p.turns * period + p.phase / self.w for p in pieces]
        return Motion(self, tuple(pieces), (num.number(t0), *starts[1:]), num.number(t1))

    def elapsed(self, a: tuple[int, Real], b: tuple[int, Real]) -> Real:
        """Time from one (turns, phase) to another."""
        return ((b[0] - a[0]) * self.numbers.turn_hi + (b[1] - a[1])) / self.w

    def _mode_at_start(self, phase: Real, x: Real, v: Real) -> tuple[int, Real]:
        """Mode and acceleration at the start; on the border of the cone the slope of the force decides."""
        num = self.numbers
        e = self.F0 * num.sin(phase) - self.k * x
        if v != 0:
            mode = 1 if v > 0 else -1
            return mode, (e - self.c * v - mode * self.Fk) / self.m
        mode = 1 if e > 0 else -1
        leaves = abs(e) == self.Fs and mode * self.F0 * num.cos(phase) > 0
        if abs(e) <= self.Fs and not leaves:
            return 0, num.number(0)
        return mode, (e - mode * self.Fk) / self.m

    def _mode_at_stop(self, phase: Real, x: Real) -> tuple[int, Real]:
        """Stick if the force is inside the cone, else slip the way it pulls."""
        num = self.numbers
        e = self.F0 * num.sin(phase) - self.k * x
        if abs(abs(e) - self.Fs) <= 64 * num.eps * (self.F0 + self.k * abs(x) + self.Fs):
            raise Undecided(f"stop at phase {phase} with |e| = {abs(e)} and Fs = {self.Fs}")
        if abs(e) < self.Fs:
            return 0, num.number(0)
        mode = 1 if e > 0 else -1
        return mode, (e - mode * self.Fk) / self.m

    def _release(self, phase: Real, x: Real) -> tuple[Real, int]:
        """Angle to the next release and the slip that begins, or mode 0 for never; a touch is no release."""
        num = self.numbers
        angle, mode = num.turn_hi, 0
        for way, top in ((1, num.turn_hi / 4), (-1, 3 * num.turn_hi / 4)):
            short = self.F0 - self.Fs - way * self.k * x  # F0 (1 - sin) at the release, without cancellation
            if 0 < short <= 2 * self.F0:
                _, after = num.wrap(0, (top - phase) - 2 * num.asin(num.sqrt(short / (2 * self.F0))))
                angle, mode = min((angle, mode), (after, way))
        return angle, mode
