"""Measure the accuracy of a square wave at resonance over 10^4 periods, of stick over 10^5, and of orbits over 10^6.

    python docs/studies/long_runs.py [periods] [integrator]     (10^6 with dop853 by default; 10^4 take a minute)
    python docs/studies/long_runs.py orbits [periods]           (the orbits by `exact` alone: half a minute)

Errors are those of the last hundred periods before each checkpoint, relative to the amplitude. The reference is a
closed form in 40 digits (tests/reference). A run of a million periods is divided into runs of a thousand, so that
memory does not grow. The start of each of them is not a running sum.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import mpmath
import numpy as np

import hybridsim as hs
from hybridsim.engine.record.limits import resident_megabytes

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from mechanics.stuck_systems import FORCING, stuck_system, ulps_off
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator

CHECKPOINTS = (100, 1000, 10**4, 10**5, 10**6)
WINDOW = 100  # periods over which an error is taken
CHUNK = 1000  # periods of one run
POINTS = 997  # in a window, at all phases
SETTLED = 400  # periods after which the transient is below 1e-15: exp(-zeta*wn*400*T) at zeta = 0.02


def no_stop(last: int, integrator: str) -> None:
    """F0 = 60, N = 40, omega = 1.4 wn: the body reverses twice per period and never sticks."""
    model = hs.load("dfcs").with_(F0=60, N=40, omega="1.4*sqrt(k/m)")
    values = model.parameter_values()
    omega = values["omega"]
    period, limit = 2 * math.pi / omega, values["mu"] * values["N"]
    numbers = multiprecision(40)
    oscillator = Oscillator(
        values["m"], values["c"], values["k"], limit, limit, values["F0"], omega, numbers=numbers
    )
    motion = oscillator.run(0, (SETTLED + 2) * period, 0)

    def exact(t: float) -> tuple[float, float]:
        """From rest at t = 0; later than SETTLED periods, the orbit at the same phase."""
        with mpmath.workdps(40):
            turns = mpmath.mpf(t) * mpmath.mpf(omega) / (2 * mpmath.pi)
            if turns > SETTLED:
                turns = SETTLED + turns - mpmath.floor(turns)
            x, v, _ = motion.state(turns * 2 * mpmath.pi / mpmath.mpf(omega))
            return float(x), float(v)

    state, done, began = np.zeros(2), 0, time.perf_counter()
    for checkpoint in [n for n in CHECKPOINTS if n <= last]:
        while done < checkpoint:
            count = min(CHUNK, checkpoint - done)
            t0, t1 = done * period, (done + count) * period
            sol = hs.simulate(model, (t0, t1), x0=state, rtol=1e-9, integrator=integrator)
            assert sol.success, sol.message
            modes = [interval.mode for interval in sol.modes["f"]]
            assert done == 0 or "stick" not in modes
            state, done = sol(t1), done + count
        times = points(max(t0, t1 - WINDOW * period), t1)
        truth = np.array([exact(t) for t in times]).T
        error = np.max(np.abs(sol(times) - truth) / np.max(np.abs(truth), axis=1)[:, None])
        say(f"{integrator}, no stop, rtol 1e-09", checkpoint, error, began)


def square(last: int, damping: float, rtol: float, integrator: str) -> None:
    """x'' + 2 d x' + x = +-1, switched at resonance; without damping the amplitude grows by 4 per period.

    With damping errors decay and the accuracy lasts. Without damping the truncation error of each step adds to the
    phase. The relative error then grows with the number of periods, at any tolerance.
    """
    model = hs.Model(
        "square",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="u - x - 2*d*v")],
        parameters={"d": damping},
        inputs=[hs.Input("u", "wave", shape="square", period=2 * math.pi)],
    )
    began = time.perf_counter()
    sol = hs.simulate(model, (0, last * 2 * math.pi), rtol=rtol, integrator=integrator)
    assert sol.success, sol.message
    half = mpmath.mpf(math.pi)  # of the double that the model's period is
    with mpmath.workdps(40):
        starts = [(mpmath.mpf(0), mpmath.mpf(0))]
        for k in range(2 * last):
            starts.append(turned(*starts[-1], (-1) ** k, half, damping))
    for checkpoint in [n for n in CHECKPOINTS if n <= last]:
        times = points((checkpoint - WINDOW) * 2 * math.pi, checkpoint * 2 * math.pi)
        with mpmath.workdps(40):
            truth = np.array([square_state(mpmath.mpf(t), starts, half, damping) for t in times])
        error = np.max(np.abs(sol(times).T - truth)) / np.max(np.abs(truth))
        say(f"{integrator}, square wave, d = {damping:g}, rtol {rtol:.0e}", checkpoint, error, began)


def square_state(
    t: mpmath.mpf, starts: list[tuple[mpmath.mpf, mpmath.mpf]], half: mpmath.mpf, damping: float
) -> list[float]:
    """The exact state at t from that at the last switch."""
    k = min(int(t / half), len(starts) - 1)
    return [float(value) for value in turned(*starts[k], (-1) ** k, t - k * half, damping)]


def turned(
    x: mpmath.mpf, v: mpmath.mpf, u: int, s: mpmath.mpf, damping: float
) -> tuple[mpmath.mpf, mpmath.mpf]:
    """The free motion about u for a time s."""
    d = mpmath.mpf(damping)
    w = mpmath.sqrt(1 - d * d)
    cosine, sine, decay = mpmath.cos(w * s), mpmath.sin(w * s), mpmath.exp(-d * s)
    y = x - u
    return (
        u + decay * (y * cosine + (v + d * y) / w * sine),
        decay * (v * cosine - (d * v + y) / w * sine),
    )


def stick(last: int) -> None:
    """Two contacts over all of three coordinates, which always stick while the third direction is shaken.

    Errors of the relative velocities are in ulp of the sum of their terms. They are read from the run at all times of
    each window, and from the state of the integrator at the end of runs of each length.
    """
    period = 2 * math.pi / FORCING
    for base in (0.0, 0.2):
        system = stuck_system(base)
        began = time.perf_counter()
        sol = hs.simulate(system, (0, last * period), rtol=1e-6)
        assert sol.success and not sol.events, sol.message
        for checkpoint in [n for n in CHECKPOINTS if n <= last]:
            window = sol(points((checkpoint - WINDOW) * period, checkpoint * period))
            ended = hs.simulate(system, (0, checkpoint * period), rtol=1e-6, keep="nothing").x_end
            print(
                f"stick, base {base:g}, {checkpoint:8d} periods: {ulps_off(system, window):.2g} ulp in the window, "
                f"{ulps_off(system, ended[:, None]):.2g} at the end  ({time.perf_counter() - began:.0f} s)",
                flush=True,
            )


def orbits(last: int) -> None:
    """An orbit with two stops a period and one without, each in one run by `exact`: events, places, memory.

    The closed form gives the expected number of events. It is the number in the first SETTLED periods from rest, and
    then the number per period of its last ten.
    """
    for name, force, ratio in (("two stops", 30, 0.6), ("no stop", 60, 1.4)):
        model = hs.load("dfcs").with_(F0=force, omega=f"{ratio}*sqrt(k/m)")
        p = model.parameter_values()
        period, limit = 2 * math.pi / p["omega"], p["mu"] * p["N"]
        oscillator = Oscillator(p["m"], p["c"], p["k"], limit, limit, force, p["omega"])
        settled, more = (oscillator.run(0, n * period, 0).changes for n in (SETTLED, SETTLED + 10))
        each = (len(more) - len(settled)) / 10
        expected = len(settled) + round(each * (last - SETTLED))
        first = window(model, SETTLED + CHUNK, period)
        began, memory = time.perf_counter(), [resident_megabytes()]
        whole = hs.simulate(
            model, (0, last * period), integrator="exact", keep=CHUNK * period,
            progress=lambda fraction, m=memory: m.append(resident_megabytes()),
        )  # fmt: skip
        took = time.perf_counter() - began
        assert whole.success, whole.message
        middle = memory[len(memory) // 2 :]
        (a0, s0), (a1, s1) = (amplitudes(sol, period) for sol in (first, whole))
        change = max(abs(a1.max() - a0.max()), abs(a1.min() - a0.min())) / a0.mean()
        spread0, spread1 = np.ptp(a0) / a0.mean(), np.ptp(a1) / a1.mean()
        print(
            f"exact, {name}, {last} periods: {whole.stats['events']} events, {expected} expected; {s1[0]} sticks "
            f"in the last {CHUNK}, moved by {max(s0[1], s1[1]):g} at most, speed {max(s0[2], s1[2]):g}; amplitude "
            f"changed by {change:.1e}, spread {spread0:.1e} then, {spread1:.1e} now; memory {memory[0]:.1f} MB "
            f"at the start, {middle[0]:.1f} half way, {memory[-1]:.1f} at the end  ({took:.0f} s)",
            flush=True,
        )


def window(model: hs.Model, end: int, period: float) -> hs.Solution:
    """The last CHUNK periods of a run from rest."""
    sol = hs.simulate(model, (0, end * period), integrator="exact", keep=CHUNK * period)
    assert sol.success, sol.message
    return sol


def amplitudes(sol: hs.Solution, period: float) -> tuple[np.ndarray, tuple[int, float, float]]:
    """Amplitude of each period of the window; how many sticks it has, their largest drift and their largest speed."""
    t = np.array([e.t for e in sol.events])
    x = np.array([e.x_plus[0] for e in sol.events])
    numbers = ((t - sol.t_start) / period).astype(int)
    inside = (numbers > 0) & (numbers < numbers.max())
    first = np.flatnonzero(np.diff(numbers[inside], prepend=-1))
    each = (np.maximum.reduceat(x[inside], first) - np.minimum.reduceat(x[inside], first)) / 2
    sticks = [i for i in sol.modes["f"] if i.mode == "stick"][1:-1]
    drift = speed = 0.0
    for stick in sticks:
        held = sol(np.linspace(stick.t0, stick.t1, 9)[:-1])
        drift = max(drift, float(np.ptp(held[0])))
        speed = max(speed, float(np.abs(held[1]).max()))
    return each, (len(sticks), drift, speed)


def points(t0: float, t1: float) -> np.ndarray:
    """Times at all phases, none of which is that of a switch, because a rounded time means the switch itself."""
    return t0 + (t1 - t0) * (np.arange(POINTS) + 1 / math.pi) / POINTS


def say(what: str, periods: int, error: float, began: float) -> None:
    """One line of the result."""
    print(
        f"{what}, {periods:8d} periods: error {error:.1e}  ({time.perf_counter() - began:.0f} s)", flush=True
    )


if __name__ == "__main__" and sys.argv[1:2] == ["orbits"]:
    orbits(int(float(sys.argv[2])) if len(sys.argv) > 2 else 10**6)
elif __name__ == "__main__":
    longest = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**6
    method = sys.argv[2] if len(sys.argv) > 2 else "dop853"
    for damping in (0.05, 0.0):
        square(min(longest, 10**4), damping, 1e-12, method)
    stick(min(longest, 10**5))
    no_stop(longest, method)
    if longest > SETTLED + CHUNK:
        orbits(longest)
