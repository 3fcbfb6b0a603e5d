"""Runs of the study of stability, with the methods, the cases with their exact motion, verdicts, and theory.

Each point is a run that starts on the exact steady motion (`exact` for the reference model, `steady_state` for the
belt). Its last periods are evaluated. It is right if the amplitude of each period is within 1 %, and the number of
stops is correct.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import hybridsim as hs

TOLERATED = 0.01  # error of the amplitude beyond which an answer is wrong
DENSE = 400  # readings a period, at least: with fewer steps the dense output is read between them
NUDGE = 1e-6  # of the amplitude: for the derivative of the map from stop to stop
LIMIT_RK4 = 2.7853  # |h lambda| up to which classic RK4 damps a real lambda < 0
HALVINGS = 16  # of the dichotomy
EVENTS = (
    60  # a period: ten times as many as the dead band has on these motions; with more a run is called wrong
)
OFFSETS = 8  # of the steps against the motion, where the worst of them is taken
PAPER_STEPS, PAPER_EPS = 1200, 8e-4  # m/s


@dataclass(frozen=True)
class Method:
    """A method at a point of the plane: a run from steps per period and the width of the zone in m/s."""

    name: str
    title: str
    integrator: str
    options: tuple[tuple[str, Any], ...] = ()
    law: str = ""  # of `Model.regularized`; none: the zone is the integrator's own eps_v
    has_zone: bool = True
    has_stops: bool = True
    periods: tuple[int, int] = (40, 10)  # run, and read at the end
    fine: float = 2000.0  # steps a period at which the width of the zone is judged

    @property
    def letter(self) -> str:
        """What the width of its zone is called."""
        return "v0" if self.law else "eps_v"


ZEROED = Method("zeroed", "rk4-dichotomy, velocity zeroed", "rk4-dichotomy", (("stick_velocity", "zero"),))
KEPT = Method("kept", "rk4-dichotomy, velocity kept", "rk4-dichotomy", (("stick_velocity", "kept"),))
SIGN = Method("sign", "rk4-sign", "rk4-sign", has_zone=False, has_stops=False, periods=(100, 50), fine=20000)
# without contacts nothing is left of the method but its Runge-Kutta step
TANH = Method("tanh", "RK4 with mu N tanh(v/v0)", "rk4-sign", law="tanh", has_stops=False, fine=20000)
# its events are located in Python, a thousand a second: fewer periods
KARNOPP = Method("karnopp", "RK4 with Karnopp's dead band", "rk4-sign", law="karnopp", periods=(12, 4))
MAPPED = (ZEROED, KEPT, TANH, KARNOPP)


@dataclass(frozen=True)
class Case:
    """A model with its exact steady motion.

    speed, limit, mass: of the relative velocity, the force that holds at most, and the mass that it moves.
    """

    name: str
    model: hs.Model
    limit: float
    mass: float
    belt_speed: float = 0.0

    @cached_property
    def steady(self) -> hs.SteadyState:
        """The exact motion."""
        found = hs.steady_state(self.model)
        assert found.kind == "periodic", (self.name, found.message)
        return found

    @property
    def period(self) -> float:
        return float(self.steady.period)

    @property
    def stops(self) -> int:
        """Stops a period."""
        return round(self.steady.stops_per_period["f"])

    @cached_property
    def orbit(self) -> hs.Solution:
        """A whole period that starts in the middle of its longest slip, so that no stop is cut."""
        span = self.steady.solution
        intervals = [i for i in span.modes["f"] if i.mode != "stick"]
        longest = max(intervals, key=lambda i: i.t1 - i.t0)
        t0 = 0.5 * (longest.t0 + longest.t1)
        return hs.simulate(self.model, (t0, t0 + 2 * self.period), x0=span(t0), rtol=1e-11)

    @cached_property
    def samples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times over one period, displacement, relative velocity."""
        t0 = float(self.orbit.t[0])
        events = [e.t for e in self.orbit.events if e.t < t0 + self.period]
        t = np.unique(np.concatenate([np.linspace(t0, t0 + self.period, 8001), events]))
        x, v = self.orbit(t)
        return t, x, v - self.belt_speed

    @property
    def amplitude(self) -> float:
        x = self.samples[1]
        return float(x.max() - x.min()) / 2

    @property
    def fastest(self) -> float:
        """Largest relative speed, of which eps_v and v0 are shares."""
        return float(np.abs(self.samples[2]).max())

    def run(self, method: Method, steps: float, zone: float, offset: float = 0.0) -> hs.Solution:
        """A run of so many steps per period from the exact motion; zone is a share of the largest speed.

        offset: of the first step against the motion, as a share of a step.
        """
        t0, count = float(self.orbit.t[0]) + offset * self.period / steps, method.periods
        options: dict[str, Any] = {"step": self.period / steps, **dict(method.options)}
        model = self.model
        if method.law:
            model = self.regularized(method.law, zone * self.fastest)
            options["z0"] = self._modes_of_karnopp() if method.law == "karnopp" else None
            options["limits"] = {"events": EVENTS * count[0]}
        elif method.has_zone:
            options["eps_v"] = zone * self.fastest
        return hs.simulate(
            model,
            (t0, t0 + count[0] * self.period),
            x0=self.orbit(t0),
            integrator=method.integrator,
            keep=count[1] * self.period,
            **options,
        )

    def regularized(self, law: str, v0: float) -> hs.Model:
        """The model with a regularized law; abs(v) of the belt is v tanh(v/v0), so that v = 0 is not an event."""
        if law != "tanh" or not self.belt_speed:
            return self.model.regularized(law, v0=v0)
        sides = "tanh((v - v_belt)/v0)"
        force = f"Fs*{sides}/(1 + delta*(v - v_belt)*{sides})"
        states = [hs.State("x", 0, "v", nominal=1), hs.State("v", 0, f"(-k*x - {force})/m", nominal=1)]
        return hs.Model("belt-tanh", states, (*self.model.parameters, hs.Parameter("v0", float(v0))))

    def _modes_of_karnopp(self) -> dict[str, str]:
        velocity = self.orbit(float(self.orbit.t[0]))[1] - self.belt_speed
        return {"f": "slip+" if velocity > 0 else "slip-"}

    def worst(self, method: Method, steps: float, zone: float) -> tuple[float, float]:
        """The verdict with the largest error, of steps that begin at several places of the motion."""
        found = [self.verdict(method, steps, zone, k / OFFSETS) for k in range(OFFSETS)]
        return max(found, key=lambda one: math.inf if math.isnan(one[0]) else abs(one[0]))

    def verdict(
        self, method: Method, steps: float, zone: float = 0.0, offset: float = 0.0
    ) -> tuple[float, float]:
        """Relative error of the amplitude, the worst period with its sign, and stops in excess a period.

        NaN if the run ended early, with a state that is not a number or with events without end.
        """
        sol = self.run(method, steps, zone, offset)
        if not sol.success:
            return math.nan, math.nan
        last = method.periods[1]
        end = float(sol.t[-1])
        edges = end - self.period * np.arange(last, -1, -1)
        t, x = sol.t, sol.y[0]
        if steps < DENSE:
            grid = np.linspace(t[0], end, DENSE * last + 1)
            t = np.unique(np.concatenate([t, grid]))
            x = sol(t)[0]
        first = np.searchsorted(t, edges[:-1] - 1e-9 * self.period)
        each = (np.maximum.reduceat(x, first) - np.minimum.reduceat(x, first)) / 2
        errors = each / self.amplitude - 1
        worst = float(errors[np.argmax(np.abs(errors))])
        if not method.has_stops:
            return worst, 0.0
        found = sum(i.mode == "stick" and i.t0 > edges[0] + 1e-9 * self.period for i in sol.modes["f"])
        return worst, (found - self.stops * last) / last

    # -- theory -----------------------------------------------------------------------------------------------

    @cached_property
    def stop(self) -> tuple[float, float, float]:
        """The first stop after the start: its time, the deceleration into it, how long it lasts."""
        event = next(e for e in self.orbit.events if e.target == "stick")
        left = next(e for e in self.orbit.events if e.source == "stick" and e.t > event.t)
        tau = 1e-6 * self.period
        rate = abs(self.orbit(event.t - tau)[1] - self.belt_speed) / tau
        return event.t, rate, left.t - event.t

    def next_place(self, speed: float = 0.0, late: float = 0.0) -> float:
        """Distance of the next stop from the middle if the slip begins at a speed already, or so much later."""
        t0, _, lasts = self.stop
        release, side = t0 + lasts + late, math.copysign(1.0, self.orbit(t0)[0])
        x0 = [self.orbit(t0)[0], self.belt_speed - side * speed]
        begins = {"f": "slip-" if side > 0 else "slip+"}
        sol = hs.simulate(self.model, (release, release + self.period), x0=x0, z0=begins, rtol=1e-11)
        return abs(float(next(e for e in sol.events if e.target == "stick").x_plus[0]))

    @cached_property
    def memory(self) -> tuple[float, float]:
        """dG/dx and dG/dv of the map G from a stop to the place of the next.

        x is the additional distance at which the body sticks, so that it is released at another time. v is its outward
        speed at the release.
        """
        t0, small, slow = self.stop[0], NUDGE * self.amplitude, NUDGE * self.fastest
        places = []
        for nudge in (-small, small):
            side = math.copysign(1.0, self.orbit(t0)[0])
            x0 = [self.orbit(t0)[0] + side * nudge, self.belt_speed]
            sol = hs.simulate(self.model, (t0, t0 + 1.2 * self.period), x0=x0, rtol=1e-11)
            after = next(e for e in sol.events if e.target == "stick" and e.t > t0 + 1e-3 * self.period)
            places.append(abs(float(after.x_plus[0])))
        by_x = (places[1] - places[0]) / (2 * small)
        return by_x, (self.next_place() - self.next_place(speed=slow)) / slow

    def early_stop(self) -> float:
        """eps_v/V at which stopping at eps_v, eps_v^2/(2 a) short of the place, makes the amplitude 1 % smaller.

        On an orbit of two equal halves every stop is short, and G carries it on: eps^2/(2 a) = 0.01 X (1 - G_x). On the
        belt the extreme of x comes before the stop, at the relative speed of the belt itself, and one end of two is
        short: (eps - v_belt)^2/(2 a) = 0.02 X.
        """
        grows = 2.0 if self.belt_speed else 1 - self.memory[0]
        short = math.sqrt(2 * self.stop[1] * TOLERATED * self.amplitude * grows)
        return (self.belt_speed + short) / self.fastest

    def creep(self) -> float:
        """eps_v/V at which a body that creeps outward at eps_v while it should stick is 1 % off at the end of it.

        It is further out by d = eps t_stick and starts the slip with eps the wrong way: X' = G(X' + d, eps), so that
        the extreme is off by (G_x d + G_v eps)/(1 - G_x) + d.
        """
        by_x, by_v = self.memory
        each = (by_x * self.stop[2] + by_v) / (1 - by_x) + self.stop[2]
        return TOLERATED * self.amplitude / abs(each) / self.fastest

    def too_fast_for_16(self, steps: np.ndarray) -> np.ndarray:
        """eps_v/V below which 16 halvings do not come within eps_v: the speed changes by a h/2^16 in the last part."""
        return self.stop[1] * self.period / steps / 2.0**HALVINGS / self.fastest

    def late_release(self) -> float:
        """Steps per period at which slips that begin a whole step late make the amplitude 1 % wrong."""
        by_x, base = self.memory[0], self.next_place()
        for steps in np.geomspace(2000, 3, 200):
            change = (self.next_place(late=self.period / steps) - base) / (1 - by_x)
            if abs(change) > TOLERATED * self.amplitude:
                return float(steps)
        return math.nan

    def stable(self, steps: np.ndarray) -> np.ndarray:
        """v0/V above which classic RK4 is stable on the steepest part of mu N tanh(v/v0): h mu N/(m v0) < 2.785."""
        return self.limit / self.mass * (self.period / steps) / LIMIT_RK4 / self.fastest


def dfcs(ratio: float = 0.6, share: float = 0.75) -> Case:
    """The reference model at a ratio of frequencies r and a force F0 = share N."""
    model = hs.load("dfcs").with_(F0=f"{share}*N", omega=f"{ratio}*sqrt(k/m)")
    values = model.parameter_values()
    return Case(f"r = {ratio:g}, F0/N = {share:g}", model, values["mu"] * values["N"], values["m"])


def belt() -> Case:
    """The block on its belt."""
    model = hs.load("belt")
    return Case("belt", model, 1.0, 1.0, model.parameter_values()["v_belt"])


def mapped(case: Case, method: Method, steps: np.ndarray, zones: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors and stops in excess over the plane: rows are zones, columns steps per period."""
    points = [(n, e) for e in zones for n in steps]
    began = time.perf_counter()
    _ = case.amplitude, case.fastest
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda p: case.verdict(method, *p), points))
    tell(f"{case.name}, {method.name}: {len(points)} runs, {time.perf_counter() - began:.0f} s")
    whole = np.array(found).reshape(len(zones), len(steps), 2)
    return whole[..., 0], whole[..., 1]


def is_right(found: tuple[float, float], slack: float = 0.0) -> bool:
    """Whether an answer is right; slack: the allowed difference of stops per period."""
    return abs(found[0]) <= TOLERATED and abs(found[1]) <= slack


def edges(case: Case, method: Method) -> tuple[float, float]:
    """Widest zone (share of the largest speed) up to which all are right; fewest steps above which all are.

    The first at the method's fine step, beginning with 1e-5 or where RK4 is stable; the second at a third of the first.
    NaN: none is right.
    """
    slack = 0.11 if case.belt_speed else 0.0  # its period is its own: the last window may cut a stop
    zone = 0.0
    if method.has_zone:
        low = 1.2 * float(case.stable(np.array(method.fine))) if method is TANH else 1e-5
        zone = _edge(lambda e: is_right(case.verdict(method, method.fine, e), slack), logs(low, 3.0, 14))
    if math.isnan(zone):
        return zone, zone
    scale = logs(method.fine, 4.0, 18)
    return zone, _edge(lambda n: is_right(case.verdict(method, n, zone / 3), slack), scale)


def _edge(right: Callable[[float], bool], scale: np.ndarray) -> float:
    """Last of the numbers up to which all are right, made finer by halving."""
    good = math.nan
    for number in scale.tolist():
        if not right(number):
            if math.isnan(good):
                return good
            bad = number
            for _ in range(4):
                middle = math.sqrt(good * bad)
                good, bad = (middle, bad) if right(middle) else (good, middle)
            return good
        good = number
    return good


def tell(*words: Any) -> None:
    """Progress."""
    print(*words, file=sys.stderr, flush=True)


def logs(low: float, high: float, count: int) -> np.ndarray:
    """Numbers evenly spaced by their logarithms."""
    return np.geomspace(low, high, count)
