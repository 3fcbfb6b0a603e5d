"""This module defines Den Hartog's closed form for an oscillator that never stops, as a simplified model."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, Scene, need_stick
from hybridsim.model import Model
from hybridsim.reference.closed_forms.coulomb_model import Recognised, recognise
from hybridsim.reference.closed_forms.den_hartog import no_stops
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator
from hybridsim.reference.closed_forms.slip_phase import SlipPhase

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_DENSE = 2001  # points of the search for the largest velocity, before Newton's method


class NoStopMotion:
    """The closed-form motion of Den Hartog, with the measures of a steady state."""

    def __init__(self, found: Recognised, contact: str, amplitude: float, angle: float) -> None:
        s = found.system
        self.period, self._system, self._contact = 2.0 * math.pi / s.frequency, s, contact
        self._centre, self._x, self._v = s.offset / s.stiffness, found.position, found.velocity
        top = self._centre + amplitude
        force = s.force * math.sin(angle)
        self._phase = SlipPhase(
            stiffness=s.stiffness / s.mass,
            damping=s.damping / s.mass,
            force=s.force / s.mass,
            frequency=s.frequency,
            centre=self._centre + s.slip_force / s.stiffness,
            direction=-1.0,
            angle=angle,
            x=top,
            v=0.0,
            acceleration=(force - s.stiffness * amplitude + s.slip_force) / s.mass,
        )
        self._top_at = (angle - s.phase) / s.frequency
        intervals = max(8, math.ceil(8.0 * self._phase.natural / s.frequency))
        half = 0.5 * self.period
        begins = half / intervals * np.arange(intervals)
        self._s = (begins[:, None] + 0.5 * half / intervals * (1.0 + _NODES)).ravel()
        self._w = np.tile(0.5 * half / intervals * _WEIGHTS, intervals)
        self.fastest = self._fastest()
        self.amplitude = {self._x: amplitude, self._v: self.fastest, contact: s.slip_force}
        self.mean = {self._x: self._centre, self._v: 0.0, contact: 0.0}
        self.maximum = {name: self.mean[name] + self.amplitude[name] for name in self.mean}
        self.minimum = {name: self.mean[name] - self.amplitude[name] for name in self.mean}
        self.peak = {name: abs(self.mean[name]) + self.amplitude[name] for name in self.mean}
        self.dissipated = {contact: 4.0 * s.slip_force * amplitude}
        self.stick_fraction = {contact: 0.0}
        self.stops_per_period = {contact: 0.0}
        self.speed = {contact: 4.0 * amplitude / self.period}

    @property
    def energy(self) -> dict[str, float]:
        """Integral of the square of each quantity over a period."""
        found = {}
        for name in self.amplitude:
            swing, mean = self._swing(name), self.mean[name]
            found[name] = 2.0 * float(self._w @ swing**2) + mean**2 * self.period
        return found

    def harmonic(self, name: str, k: int) -> complex:
        """Return a harmonic as `SteadyState.harmonic` does, but with the time counted from the forcing's phase zero."""
        if k == 0:
            return complex(self.mean[name])
        if k % 2 == 0:
            return 0j  # the second half period is minus the first
        w = 2.0 * math.pi * k / self.period
        wave = np.exp(-1j * w * (self._s + self._top_at))
        return complex(4.0 / self.period * (self._w @ (self._swing(name) * wave)))

    def _swing(self, name: str) -> np.ndarray:
        """Return the motion about its mean during the half period after the upper turning point."""
        if name == self._contact:
            return np.full(len(self._s), -self._system.slip_force)
        return self._phase.derivative(0 if name == self._x else 1, self._s) - self.mean[name]

    def _fastest(self) -> float:
        """Return the largest speed, by Newton's method from the fastest of many sampled points."""
        s = np.linspace(0.0, 0.5 * self.period, _DENSE)
        at = float(s[int(np.argmax(np.abs(self._phase.derivative(1, s))))])
        for _ in range(4):
            at -= float(self._phase.derivative(2, at)) / float(self._phase.derivative(3, at))
        return abs(float(self._phase.derivative(1, at)))


@dataclass(frozen=True)
class _Held:
    """The solution of the closed form: amplitude, forcing angle at the turning point, uniqueness."""

    found: Recognised
    amplitude: float
    angle: float
    unique: bool


def held(model: Model) -> _Held:
    """Return Den Hartog's motion of a model.

    Raises
    ------
    DoesNotApply
        If the model is another system, or its motion stops.
    """
    need_stick(model)
    found = recognise(model)
    if found is None or not found.system.force:
        raise DoesNotApply(
            "the formula applies only to a linear oscillator with one Coulomb contact and one sine force"
        )
    s = found.system
    natural = math.sqrt(s.stiffness / s.mass)
    r, zeta = s.frequency / natural, 0.5 * s.damping / (s.mass * natural)
    f = s.slip_force / s.force
    try:
        form = no_stops(r, zeta, f)
    except np.linalg.LinAlgError:
        raise DoesNotApply(
            f"the closed form without damping has no solution at the frequency ratio r = {r:.6g}"
        ) from None
    if not form.holds:
        raise DoesNotApply(
            f"the motion contains stops: mu N/F0 = {f:.4g} exceeds the limit for motion without stops at the "
            f"frequency ratio r = {r:.4g}"
        )
    amplitude = form.amplitude * s.force / s.stiffness
    angle = _angle_at_top(s, amplitude)
    load = s.stiffness * amplitude - s.force * math.sin(angle)
    if load < s.stick_limit:
        raise DoesNotApply(
            f"the motion contains stops: at the turning points the load {load:.4g} is below the stick limit"
        )
    return _Held(found, amplitude, angle, s.damping > 0.0 and s.stick_limit == s.slip_force)


def _angle_at_top(system: ForcedCoulombOscillator, amplitude: float) -> float:
    """Return the forcing angle at the upper turning point, half a period before the lower turning point.

    Half a period maps (x, v) of the free motion by a matrix M and negates the forced part. Two linear
    equations therefore give the forced part (Fx, Fv) at the turning point: (M + 1) (Fx, Fv) = M (A - c, 0) +
    (A + c, 0).
    """
    w, natural2 = system.frequency, system.stiffness / system.mass
    decay = 0.5 * system.damping / system.mass
    ringing, half = math.sqrt(natural2 - decay**2), math.pi / w
    shrink, c, s = math.exp(-decay * half), math.cos(ringing * half), math.sin(ringing * half) / ringing
    M = shrink * np.array([[c + decay * s, s], [-natural2 * s, c - decay * s]])
    centre = system.slip_force / system.stiffness
    right = M @ [amplitude - centre, 0.0] + [amplitude + centre, 0.0]
    forced_x, forced_v = np.linalg.solve(M + np.eye(2), right)
    response = system.force / system.mass / complex(natural2 - w * w, 2.0 * decay * w)
    # forced_x = Im(response e^{ia}), forced_v = w Re(response e^{ia})
    return cmath.phase(complex(forced_v / w, forced_x) / response)


class NoStop(LadderStep):
    """The closed form without stops by J. P. Den Hartog, Trans. ASME 53 (1931) 107."""

    name = "no-stop"
    title = "Den Hartog's closed form without stops"
    drops = "stick and the transient; it is exact if the motion never stops"

    def apply(self, scene: Scene) -> NoStopMotion:
        """Return the motion in closed form."""
        form = held(scene.model)
        return NoStopMotion(form.found, scene.model.contacts[0].name, form.amplitude, form.angle)
