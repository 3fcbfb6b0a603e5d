"""This module gives the exact motion of a forced linear oscillator with Coulomb friction, event by event.

    m x'' + c x' + k x + f = b + F sin(w t + phase),    slip: f = +-slip_force,    stick: |f| <= stick_limit

A slip phase has a closed form, and a stick phase ends when a sine crosses a level; only the end of a slip phase
needs a root search. The module shares no code with the engine.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybridsim.reference.closed_forms.slip_phase import SlipPhase

SLIP_FORWARD, SLIP_BACKWARD, STICK = "slip+", "slip-", "stick"
_DIRECTION = {SLIP_FORWARD: 1.0, SLIP_BACKWARD: -1.0, STICK: 0.0}
_TURN, _TURN_LOW = (
    2 * math.pi,
    2.4492935982947064e-16,
)  # 2 pi as the sum of two doubles, so that thousands of turns lose no digit


@dataclass(frozen=True)
class ForcedCoulombOscillator:
    """A forced linear oscillator with Coulomb friction, where w is `frequency` and b is `offset`.

    Raises ValueError if the closed form does not hold (overdamped) or would lose half of its digits
    (driven at resonance without damping).
    """

    mass: float
    damping: float
    stiffness: float
    slip_force: float
    stick_limit: float
    force: float = 0.0
    frequency: float = 1.0
    phase: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        m, c, k, w = self.mass, self.damping, self.stiffness, self.frequency
        if not (m > 0 and c >= 0 and k > 0 and w > 0 and self.stick_limit >= self.slip_force >= 0):
            raise ValueError("the closed form needs m, k, w > 0, c >= 0 and stick limit >= slip force >= 0")
        if c * c >= 4 * m * k:
            raise ValueError("the closed form is for underdamped oscillators")
        if self.force and math.hypot(k - m * w * w, c * w) < math.sqrt(np.finfo(float).eps) * k:
            raise ValueError("without damping the response at resonance is unbounded")

    def motion(self, x0: float, v0: float, t_span: tuple[float, float]) -> Motion:
        """Return the exact motion from (x0, v0) over t_span = (t0, t1), t1 >= t0."""
        t0, t1 = map(float, t_span)
        clock = _Clock(t0, self.frequency, self.phase)
        x, v = float(x0), float(v0)
        mode = self._at_rest(x, clock.angle) if v == 0 else SLIP_FORWARD if v > 0 else SLIP_BACKWARD
        acceleration = self._acceleration(mode, x, v, clock.angle)
        segments: list[_Segment] = []
        while clock.time <= t1:
            if mode == STICK:
                segments.append(_Segment(mode, clock.time, x))
                release = self._release(x, clock.angle)
                if release is None:
                    break
                angle, mode = release
                clock.forward_to(angle)
                # This is exact: at the limit the friction falls from stick_limit to slip_force.
                acceleration = _DIRECTION[mode] * (self.stick_limit - self.slip_force) / self.mass
            else:
                slip = self._slip(_DIRECTION[mode], clock.angle, x, v, acceleration)
                segments.append(_Segment(mode, clock.time, x, slip))
                duration = slip.time_to_rest(t1 - clock.time)
                if duration is None:
                    break
                clock.forward_by(duration)
                x, v = float(slip.derivative(0, duration)), 0.0
                mode = self._at_rest(x, clock.angle)
                acceleration = self._acceleration(mode, x, v, clock.angle)
        return Motion(self, tuple(segments), (t0, t1))

    def _slip(self, direction: float, angle: float, x: float, v: float, acceleration: float) -> SlipPhase:
        return SlipPhase(
            stiffness=self.stiffness / self.mass,
            damping=self.damping / self.mass,
            force=self.force / self.mass,
            frequency=self.frequency,
            centre=(self.offset - direction * self.slip_force) / self.stiffness,
            direction=direction,
            angle=angle,
            x=x,
            v=v,
            acceleration=acceleration,
        )

    def _push(self, x: float, angle: float) -> float:
        """Return the force on the body at rest, without friction."""
        return self.offset + self.force * math.sin(angle) - self.stiffness * x

    def _acceleration(self, mode: str, x: float, v: float, angle: float) -> float:
        if mode == STICK:
            return 0.0
        return (self._push(x, angle) - self.damping * v - _DIRECTION[mode] * self.slip_force) / self.mass

    def _at_rest(self, x: float, angle: float) -> str:
        push = self._push(x, angle)
        if abs(push) <= self.stick_limit:
            return STICK
        return SLIP_FORWARD if push > 0 else SLIP_BACKWARD

    def _release(self, x: float, angle: float) -> tuple[float, str] | None:
        """Return the forcing angle at which the body next starts to slip, and its direction."""
        exits = []
        for direction, mode in ((1.0, SLIP_FORWARD), (-1.0, SLIP_BACKWARD)):
            # The push times `direction` rises through the limit at |force| sin(angle') = level.
            level = self.stick_limit - direction * (self.offset - self.stiffness * x)
            if abs(level) < abs(self.force):  # equality only touches
                turned = 0.0 if direction * self.force > 0 else math.pi
                exits.append(((math.asin(level / abs(self.force)) + turned) % _TURN, mode))
        return min(exits, key=lambda leaving: (leaving[0] - angle) % _TURN, default=None)


class _Clock:
    """A time, stored as whole periods of the forcing and an angle in [0, 2 pi)."""

    def __init__(self, t0: float, frequency: float, phase: float) -> None:
        self.t0, self.frequency = t0, frequency
        self.angle = self.angle0 = (frequency * t0 + phase) % _TURN
        self.turns = 0

    @property
    def time(self) -> float:
        return (
            self.t0
            + (self.turns * _TURN + (self.angle - self.angle0 + self.turns * _TURN_LOW)) / self.frequency
        )

    def forward_to(self, angle: float) -> None:
        self.turns += angle < self.angle
        self.angle = angle

    def forward_by(self, duration: float) -> None:
        self.angle += self.frequency * duration
        while self.angle >= _TURN:
            self.angle = max((self.angle - _TURN) - _TURN_LOW, 0.0)
            self.turns += 1


@dataclass(frozen=True)
class _Segment:
    """One phase of the motion: its mode, start time and position, and its motion if it slips."""

    mode: str
    start: float
    x: float
    slip: SlipPhase | None = None


@dataclass(frozen=True)
class Change:
    """A change of mode of the exact motion at time t and position x, where the velocity is zero."""

    t: float
    source: str
    target: str
    x: float


@dataclass(frozen=True)
class Motion:
    """The exact motion over t_span: its changes of mode, and its states at any time."""

    system: ForcedCoulombOscillator
    segments: tuple[_Segment, ...]
    t_span: tuple[float, float]

    @property
    def first_mode(self) -> str:
        return self.segments[0].mode

    @property
    def changes(self) -> tuple[Change, ...]:
        return tuple(
            Change(after.start, before.mode, after.mode, after.x)
            for before, after in itertools.pairwise(self.segments)
            if before.mode != after.mode
        )

    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return position and velocity at the times t, shape (2, ...)."""
        t = np.asarray(t, dtype=float)
        states = np.zeros((2, *t.shape))
        index = np.searchsorted([segment.start for segment in self.segments[1:]], t, side="right")
        for i in np.unique(index):
            segment, here = self.segments[i], index == i
            if segment.slip is None:
                states[0, here] = segment.x
            else:
                for n in (0, 1):
                    states[n, here] = segment.slip.derivative(n, t[here] - segment.start)
        return states
