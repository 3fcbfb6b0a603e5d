"""A million periods out a run is as accurate as at the start; what a running sum of time would lose instead."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

FAR = 10**6  # periods
NO_STOP = hs.load("dfcs").with_(F0=60, N=40, omega="1.4*sqrt(k/m)")


def turns(t: float, omega: float) -> mpmath.mpf:
    """Phase of a double time in turns, in 40 digits."""
    with mpmath.workdps(40):
        value = mpmath.mpf(t) * mpmath.mpf(omega) / (2 * mpmath.pi)
        return value - mpmath.floor(value)


@pytest.fixture(scope="module")
def orbit():
    """State on the periodic orbit without a stop as a function of the phase in turns, in 40 digits."""
    p = NO_STOP.parameter_values()
    limit, settled = p["mu"] * p["N"], 400
    oscillator = Oscillator(
        p["m"], p["c"], p["k"], limit, limit, p["F0"], p["omega"], numbers=multiprecision(40)
    )
    motion = oscillator.run(0, (settled + 2) * 2 * math.pi / p["omega"], 0)

    def state(phase: mpmath.mpf) -> tuple[float, float]:
        with mpmath.workdps(40):
            x, v, _ = motion.state((settled + phase) * 2 * mpmath.pi / mpmath.mpf(p["omega"]))
            return float(x), float(v)

    return state


@pytest.mark.parametrize("integrator", ["dop853", "exact", "scipy-dop853", "cvode-adams"])
def test_an_orbit_of_slip_and_slip(orbit, integrator: str) -> None:
    omega = NO_STOP.parameter_values()["omega"]
    period = 2 * math.pi / omega
    errors = []
    for t0 in (0.0, FAR * period):
        t1 = t0 + 10 * period
        sol = hs.simulate(NO_STOP, (t0, t1), x0=orbit(turns(t0, omega)), integrator=integrator, rtol=1e-11)
        assert len(sol.events) == 20
        assert {e.target for e in sol.events} == {"slip+", "slip-"}
        times = np.linspace(t0, t1, 401)
        exact = np.array([orbit(turns(t, omega)) for t in times]).T
        errors.append(np.max(np.abs(sol(times) - exact) / np.max(np.abs(exact), axis=1)[:, None]))
    assert errors[0] < 1e-8
    # CVODE's choice of orders differs from run to run, and with it the error by some multiple of rtol
    luck = 1e-10 if integrator == "cvode-adams" else 0.0
    assert errors[1] < max(2 * errors[0], luck)


def test_a_smooth_stretch_of_many_turns() -> None:
    """No event in 300 periods: local time begins anew on the way, or the phase would be rounded ever more coarsely."""
    model = hs.Model(
        "driven",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="-x - 0.1*v + sin(w*t)")],
        parameters={"w": 1.3},
    )
    w = 1.3

    def steady(t: float) -> tuple[float, float]:
        with mpmath.workdps(40):
            rate = mpmath.mpf(w)
            x = mpmath.expjpi(2 * turns(t, w)) / (1 - rate**2 + 1j * rate * mpmath.mpf(0.1))
            return float(x.imag), float((1j * rate * x).imag)

    period, errors = 2 * math.pi / w, []
    for t0 in (0.0, FAR * period):
        sol = hs.simulate(model, (t0, t0 + 300 * period), x0=steady(t0), rtol=1e-13)
        times = t0 + np.linspace(295, 300, 201) * period
        exact = np.array([steady(t) for t in times]).T
        errors.append(np.max(np.abs(sol(times) - exact)))
    assert errors[0] < 1e-12
    assert errors[1] < 1e-12


def test_what_a_running_sum_of_time_loses() -> None:
    """A loop that adds the period a million times, as fixed-step codes add their step, against the engine's phase."""
    system = System(NO_STOP)
    omega = NO_STOP.parameter_values()["omega"]
    period = 2 * math.pi / omega
    summed = 0.0
    for _ in range(FAR):
        summed += period
    exact = mpmath.mpf(FAR) * mpmath.mpf(period)
    lost = float(abs(mpmath.mpf(summed) - exact)) * omega
    product = FAR * period  # rounded once; as a pair of doubles it is exact
    phase = system.vector(Instant(product), np.zeros(0))[system.layout.phases_at]
    with mpmath.workdps(40):
        kept = float(abs(mpmath.sin(turns(product, omega) * 2 * mpmath.pi) - mpmath.sin(mpmath.mpf(phase))))
    assert kept < 1e-15
    assert lost > 1e4 * max(kept, 2.0**-53)


def test_a_square_wave_switches_at_multiples_of_its_period() -> None:
    """x'' + x = +-1 switched at resonance: x = 2 n (-1)**(n + 1) after n half periods, far out as at the start."""
    model = hs.Model(
        "square",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="u - x")],
        inputs=[hs.Input("u", "wave", shape="square", period=2 * math.pi)],
    )
    errors = {}
    for first in (0, 10**4):
        t0, count = first * 2 * math.pi, 40
        sol = hs.simulate(model, (t0, t0 + count * math.pi), rtol=1e-12)
        switches = [Instant(t0).plus(n * math.pi) for n in range(1, count)]
        truth = [2.0 * n * (-1) ** (n + 1) for n in range(1, count)]
        found = [sol(float(at))[0] for at in switches]
        errors[first] = max(abs(a - b) / abs(b) for a, b in zip(found, truth, strict=True))
    assert errors[0] < 1e-10
    assert errors[10**4] < 1e-10


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
def test_more_ticks_of_a_clock_than_a_call_has_room_for_segments(integrator: str) -> None:
    """m v' = t - f sticks until t = mu N; the one release shifts the rows by one, so that they end within a tick."""
    model = hs.Model(
        "tick",
        [hs.State("x", 0, "v"), hs.State("v", 0, "t - f")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.0015})],
        schedules=[hs.Schedule("clock", period=0.001)],
    )
    for _ in range(2):
        sol = hs.simulate(model, (0, 2), integrator=integrator)
        assert sol.success and len(sol.event_times("clock")) == 2001
        assert sol.event_times("f") == pytest.approx([0.0015], abs=1e-15)
        assert sol(2.0) == pytest.approx([(2 - 0.0015) ** 3 / 6, (2 - 0.0015) ** 2 / 2], rel=1e-12)
