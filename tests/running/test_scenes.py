"""Scenes of impacts, switches and corners: what is true of each by a closed form or by matrix exponentials."""

from __future__ import annotations

from itertools import pairwise
from math import acosh, cos, pi, sin, sqrt, tan

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import hybridsim as hs

LINEAR = ["exact", "taylor", "dop853"]


@pytest.mark.parametrize("integrator", LINEAR)
def test_a_vibrating_plate_makes_friction_viscous(integrator: str) -> None:
    model = hs.load("vibrating-plate")
    p = model.parameter_values()
    orbit = hs.steady_state(model, integrator=integrator)
    assert orbit.stick_fraction["f"] == 0
    sol = hs.simulate(model, (0, 10), integrator=integrator, keep="last-period")
    downward = sum(piece.t1 - piece.t0 for piece in sol.modes["f"] if piece.mode == "slip+")
    share = downward * p["omega"] / (2 * pi)
    assert share == pytest.approx((1 + tan(p["alpha"]) / p["mu"]) / 2, rel=1e-7)


def test_a_level_vibrating_plate_makes_a_triangle() -> None:
    """Sliding all the time at +-mu g: the peak is a quarter of a period of it."""
    model = hs.load("vibrating-plate").with_(alpha=0.0)
    p = model.parameter_values()
    orbit = hs.steady_state(model)
    assert orbit.amplitude["v"] == pytest.approx(p["mu"] * p["g"] * pi / (2 * p["omega"]), rel=1e-9)


@pytest.mark.parametrize("integrator", LINEAR)
def test_the_period_of_an_oscillator_with_play(integrator: str) -> None:
    model = hs.load("elastic-gap").with_(F=0.0, c=0.0)
    p = model.parameter_values()
    period = 4 * p["d"] / p["v0"] + 2 * pi * sqrt(p["m"] / p["k"])
    sol = hs.simulate(model, (0, 10 * period), integrator=integrator, rtol=1e-12)
    assert sol.y[:, -1] == pytest.approx([0, p["v0"]], abs=1e-9)
    assert np.abs(sol.y[0]).max() <= p["d"] + p["v0"] * sqrt(p["m"] / p["k"]) + 1e-9


@pytest.mark.parametrize("integrator", LINEAR)
def test_a_stop_out_of_reach_is_never_hit(integrator: str) -> None:
    model = hs.load("impact-oscillator")
    end = model.duration_value()
    below = hs.simulate(model.with_(reach=0.9999), (0, end), integrator=integrator)
    assert below.events == ()
    assert np.abs(below.y[0]).max() <= 0.9999 + 1e-6
    above = hs.simulate(model.with_(reach=1.0001), (0, end), integrator=integrator)
    p = above.model.parameter_values()
    # x = reach*gap*cos(omega*t - phase) until then
    phase = np.arctan2(2 * p["zeta"] * p["omega"], 1 - p["omega"] ** 2)
    first = (phase - np.arccos(1 / p["reach"])) % (2 * pi) / p["omega"]
    assert above.events[0].t == pytest.approx(first, abs=1e-6)
    speed = p["omega"] * sqrt(p["reach"] ** 2 - 1)
    assert above.events[0].x_plus[1] == pytest.approx(-p["e"] * speed, rel=1e-4)


@pytest.mark.parametrize("integrator", LINEAR)
def test_each_swing_of_a_rocking_block(integrator: str) -> None:
    model = hs.load("rocking-block")
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 6), integrator=integrator, rtol=1e-12)
    q, t, times = 0.5, acosh(1 / 0.5) / p["p"], []
    while True:
        times.append(t)
        if p["e"] * p["p"] * p["alpha"] * sqrt(1 - q * q) < p["w_rest"]:
            break
        q = sqrt(1 - p["e"] ** 2 * (1 - q * q))
        t += 2 * acosh(1 / q) / p["p"]
        if t > 6:
            break
    assert len(sol.events) == len(times)
    assert [e.t for e in sol.events] == pytest.approx(times, rel=1e-9)


def test_the_impacts_of_a_rocking_block_accumulate() -> None:
    model = hs.load("rocking-block").with_(w_rest=0.0, e=0.5)
    p = model.parameter_values()
    # acosh(1/q) = atanh(sqrt(1 - q**2)), which keeps its digits where q is next to 1
    sizes = 0.75 * p["e"] ** (2 * np.arange(60))
    limit = (2 * np.arctanh(np.sqrt(sizes)).sum() - np.arctanh(sqrt(0.75))) / p["p"]
    sol = hs.simulate(model, (0, 10), integrator="exact")
    assert sol.events[-1].target == "rest"
    assert sol.events[-1].t == pytest.approx(limit, rel=1e-9)


@pytest.mark.parametrize("integrator", LINEAR)
def test_the_tanks_run_dry_after_infinitely_many_changes_of_the_hose(integrator: str) -> None:
    model = hs.load("water-tanks")
    endless = hs.simulate(model.with_(left=0.0), (0, 5), integrator=integrator)
    assert endless.events[-1].target == "off"
    assert endless.events[-1].t == pytest.approx(4.0, rel=1e-9)
    sol = hs.simulate(model, (0, 5), integrator=integrator)
    assert sol.status == "finished"
    assert sol.modes["hose"][-1].mode == "off"
    # a change of the hose multiplies what is left, and the time until the next, by (w - v1)/v2 = 1/2
    assert [e.t for e in sol.events] == pytest.approx(
        [4 - 4 * 0.5 ** (k + 1) for k in range(len(sol.events))], rel=1e-9
    )


def duty(p: dict[str, float]) -> tuple[float, np.ndarray]:
    """When the switch of the converter closes in a period that repeats, and (v, i) at its start."""
    A = np.array([[-1 / (p["R"] * p["C"]), 1 / p["C"]], [-1 / p["L"], 0]])
    b = np.array([0, p["E"] / p["L"]])

    def start(s: float) -> np.ndarray:
        """x(T) = exp(A T) x(0) + A^-1 (exp(A (T - s)) - 1) b = x(0)"""
        on = np.linalg.solve(A, (expm(A * (p["T"] - s)) - np.eye(2)) @ b)
        return np.asarray(np.linalg.solve(np.eye(2) - expm(A * p["T"]), on))

    def gap(s: float) -> float:
        v = (expm(A * s) @ start(s))[0]
        return float(p["gain"] * (v - p["V_ref"]) - p["V_low"] - (p["V_high"] - p["V_low"]) * s / p["T"])

    s = brentq(gap, 0.01 * p["T"], 0.99 * p["T"], xtol=1e-18, rtol=1e-15)
    return s, start(s)


@pytest.mark.parametrize("integrator", LINEAR)
def test_the_duty_of_a_buck_converter(integrator: str) -> None:
    model = hs.load("buck-converter").with_(E=20.0)
    p = model.parameter_values()
    s, x = duty(p)
    sol = hs.simulate(model, (0, 400 * p["T"]), integrator=integrator, rtol=1e-11, keep=1.5 * p["T"])
    assert sol.y[:2, -1] == pytest.approx(x, rel=1e-8)
    closing = [e.t for e in sol.events if e.target == "closed"][-1]
    assert closing / p["T"] - 399 == pytest.approx(s / p["T"], abs=1e-7)


def test_the_period_of_a_buck_converter_doubles() -> None:
    """A multiplier of the period passes -1 just above E = 24.5 V (Fossas and Olivar 1996)."""
    for E, period in ((24.4, 1), (24.7, 2)):
        model = hs.load("buck-converter").with_(E=E)
        T = model.parameter_values()["T"]
        sol = hs.simulate(model, (0, 3000 * T), keep=6.5 * T)
        at_ticks = np.array([sol(T * k)[0] for k in range(2994, 3000)])
        assert np.ptp(at_ticks[::period]) < 1e-6
        assert period == 1 or np.ptp(at_ticks) > 1e-3


def test_chua_rests_where_three_lines_say() -> None:
    found = hs.equilibria("chua")
    assert sorted(tuple(round(v, 12) + 0.0 for v in point.x) for point in found) == [
        (-1.5, 0.0, 1.5),
        (0.0, 0.0, 0.0),
        (1.5, 0.0, -1.5),
    ]


@pytest.mark.parametrize("integrator", LINEAR)
def test_a_rattling_gear_hits_both_sides_with_one_speed(integrator: str) -> None:
    """Symmetric: a flight of half a period at a constant speed V of its own, and V after an impact as before.

    V - vb = e (V + vb) at an impact, so that the wheel moves with vb = A omega cos(phi) = V (1 - e)/(1 + e), and the
    way is V pi/omega = d - 2 A sin(phi).
    """
    model = hs.load("gear-rattle")
    p = model.parameter_values()
    A, d, omega, e = p["A"], p["d"], p["omega"], p["e"]

    def speed(phi: float) -> float:
        return float(omega * (d - 2 * A * sin(phi)) / pi)

    def misfit(phi: float) -> float:
        return A * omega * cos(phi) - speed(phi) * (1 - e) / (1 + e)

    V = speed(brentq(misfit, -pi / 2, 0))
    sol = hs.simulate(
        model, (0, 400 * 2 * pi / omega), integrator=integrator, rtol=1e-10, keep=4.5 * pi / omega
    )
    own = [ev.x_plus[1] + A * omega * cos(omega * ev.t) for ev in sol.events]
    assert len(own) >= 4
    assert np.abs(own) == pytest.approx(V, rel=1e-6)
    assert all(a * b < 0 for a, b in pairwise(own))


def test_impacts_that_get_lost_in_rounding_are_an_accumulation() -> None:
    """The last flights are lower than the place of the tooth is known to: their number must not be endless."""
    model = hs.load("gear-rattle").with_(e=0.3, d=5e-4)
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 1), integrator="exact")
    assert sol.status == "accumulation"
    with mpmath.workdps(40):
        A, omega, e, half = (mpmath.mpf(p[k]) for k in ("A", "omega", "e", "d"))
        half /= 2
        # the last impact in the run whose place among them is beyond doubt, then flight by flight
        start = next(ev for a, ev in pairwise(sol.events) if ev.t - a.t < 1e-4)
        t, side, w = mpmath.mpf(start.t), mpmath.sign(start.x_plus[0]), mpmath.mpf(start.x_plus[1])
        for _ in range(60):
            own = w + A * omega * mpmath.cos(omega * t)
            high = abs(2 * w / (A * omega**2 * mpmath.sin(omega * t)))

            def back(s: mpmath.mpf, t: mpmath.mpf = t, own: mpmath.mpf = own) -> mpmath.mpf:
                return own - A * (mpmath.sin(omega * (t + s)) - mpmath.sin(omega * t)) / s

            s = mpmath.findroot(back, high)
            t += s
            w = -e * (own - A * omega * mpmath.cos(omega * t))
        assert s < 1e-20 and side * half == mpmath.mpf(start.x_plus[0])
        assert abs(float(t) - sol.t[-1]) < 1e-9
