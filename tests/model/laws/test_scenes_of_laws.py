"""Scenes of friction laws: what is true of each by a closed form or a balance."""

from __future__ import annotations

from math import atan, cos, pi, sqrt

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

import hybridsim as hs

LINEAR = ["exact", "taylor", "dop853"]


@pytest.mark.parametrize("integrator", LINEAR)
def test_feeny_moon_swings_freely_while_its_contact_is_open(integrator: str) -> None:
    model = hs.load("feeny-moon")
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 12), integrator=integrator, rtol=1e-11)
    off, on = (e.t for e in sol.events if e.component == "f_N")
    x, v = sol(off)
    assert x == pytest.approx(-1 / p["k"], abs=1e-9)
    assert sol(on)[0] == pytest.approx(-1 / p["k"], abs=1e-9)
    assert np.all(sol.output("f", np.linspace(off, on, 50)[1:-1]) == 0)
    # x'' + 2 zeta x' + x = a cos(Omega t) as a linear system of four states
    a = np.array(
        [[0, 1, 0, 0], [-1, -2 * p["zeta"], 1, 0], [0, 0, 0, -p["Omega"]], [0, 0, p["Omega"], 0]], dtype=float
    )
    drive = p["a"] * np.array([cos(p["Omega"] * off), np.sin(p["Omega"] * off)])
    end = expm(a * (on - off)) @ np.concatenate([[x, v], drive])
    assert sol(on) == pytest.approx(end[:2], rel=1e-8)


def amplitude(integrator: str = "dop853", **params: float) -> tuple[float, hs.Solution]:
    """Amplitude of the blade in its steady state, and the run."""
    model = hs.load("blade-damper")
    sol = hs.simulate(model, (0, 10), params=params, integrator=integrator, rtol=1e-9)
    assert sol.success, sol.message
    period = 2 * pi / sol.model.parameter_values()["omega"]
    t = np.linspace(10 - 2 * period, 10, 4001)
    return float(np.abs(sol(t)[0]).max()), sol


def test_a_blade_whose_damper_is_lost_or_stuck_is_linear() -> None:
    p = hs.load("blade-damper").parameter_values()
    c = 2 * p["zeta"] * sqrt(p["k_b"] * p["m"])
    for normal, stiffness in ((1e-9, p["k_b"]), (1e6, p["k_b"] + p["k_d"])):
        expected = p["F0"] / abs(stiffness - p["m"] * p["omega"] ** 2 + 1j * c * p["omega"])
        assert amplitude(N=normal)[0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("integrator", LINEAR)
def test_what_goes_into_the_blade_goes_into_its_dampers(integrator: str) -> None:
    """Over a period: work of the force = that of the damping + 4 mu N (A - mu N/k_d)."""
    at_work, sol = amplitude(integrator)
    p = sol.model.parameter_values()
    period = 2 * pi / p["omega"]
    t = np.linspace(10 - period, 10, 20001)
    v = sol(t)[1]
    put_in = np.trapezoid(p["F0"] * np.sin(p["omega"] * t) * v, t)
    damped = np.trapezoid(2 * p["zeta"] * sqrt(p["k_b"] * p["m"]) * v**2, t)
    limit = p["mu"] * p["N"]
    assert put_in - damped == pytest.approx(4 * limit * (at_work - limit / p["k_d"]), rel=1e-5)


def test_a_damper_of_the_right_load_lowers_the_peak_of_resonance() -> None:
    """Below a fifth of the peaks with the damper lost and with the damper stuck, F0/(c omega_0)."""
    p = hs.load("blade-damper").parameter_values()
    c = 2 * p["zeta"] * sqrt(p["k_b"] * p["m"])
    peaks = [p["F0"] / (c * sqrt(k / p["m"])) for k in (p["k_b"], p["k_b"] + p["k_d"])]
    stiffnesses = p["k_b"] + p["k_d"] * np.linspace(-0.1, 1.1, 13)
    largest = max(amplitude(N=100, omega=sqrt(k / p["m"]))[0] for k in stiffnesses)
    assert largest < 0.2 * min(peaks)


@pytest.mark.parametrize("integrator", LINEAR)
def test_drill_string(integrator: str) -> None:
    """The cycle of `look`: the bit sticks and slips for the times that a string without damping has."""
    sol = hs.simulate(hs.load("drill-string"), (0, 60), integrator=integrator, rtol=1e-11)
    p = sol.model.parameter_values()
    wind, w = (p["T_s"] - p["T_k"]) / (p["k"] * p["Omega"]), sqrt(p["k"] / p["J"])
    times = [e.t for e in sol.events]
    assert [e.target for e in sol.events] == ["slip+", "stick"] * 10
    assert times[0] == pytest.approx(p["T_s"] / (p["k"] * p["Omega"]), rel=1e-12)
    assert np.diff(times)[::2] == pytest.approx(2 * (pi - atan(w * wind)) / w, rel=1e-8)
    assert np.diff(times)[1::2] == pytest.approx(2 * wind, rel=1e-8)
    assert max(sol(np.linspace(0, 60, 4000))[1]) > 2 * p["Omega"]


@pytest.mark.parametrize("integrator", LINEAR)
def test_pid_servo_hunts(integrator: str) -> None:
    """Each stick lasts until ki times the error has made up for what is missing; the errors alternate."""
    sol = hs.simulate(hs.load("pid-servo"), (0, 40), integrator=integrator, rtol=1e-11)
    p = sol.model.parameter_values()
    stops = [
        (e.t, after.t) for e, after in zip(sol.events, sol.events[1:], strict=False) if e.target == "stick"
    ]
    assert len(stops) > 8
    errors = []
    for stop, release in stops:
        e, _, integral = sol(stop)
        u = -p["kp"] * e - p["ki"] * integral
        limit = p["mu_s"] * p["m"] * p["g"]
        assert release - stop == pytest.approx((limit + np.sign(e) * u) / (p["ki"] * abs(e)), rel=1e-8)
        assert sol((stop + release) / 2)[1] == 0.0
        errors.append(e)
    assert errors[-1] == pytest.approx(-errors[-2], rel=1e-3)
    settled = hs.simulate(
        hs.load("pid-servo"), (0, 40), params={"mu_s": p["mu_k"]}, integrator="dop853", rtol=1e-11
    )
    sizes = [abs(settled(e.t)[0]) for e in settled.events if e.target == "stick"]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] < 0.1 * abs(errors[-1])


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_valve_stiction(integrator: str) -> None:
    """It breaks loose at F_s; without damping it jumps by 2 (F_s - F_k)/k, and on with the spring meanwhile."""
    sol = hs.simulate(hs.load("valve-stiction"), (0, 14), params={"c": 0}, integrator=integrator, rtol=1e-11)
    p = sol.model.parameter_values()
    rate, w = 4 * 6000 / 60, sqrt(p["k"] / p["m"])
    assert sol.events[0].t == pytest.approx(p["F_s"] / rate, rel=1e-12)
    first, stop, second = (sol.events[k].t for k in range(3))
    drop, v = (p["F_s"] - p["F_k"]) / p["k"], rate / p["k"]
    lasts = 2 * (pi - atan(w * drop / v)) / w
    assert stop - first == pytest.approx(lasts, rel=1e-6)
    assert sol(stop)[0] == pytest.approx(2 * drop + v * lasts, rel=1e-8)
    assert rate * second - p["k"] * sol(second)[0] == pytest.approx(p["F_s"], rel=1e-9)
    back = hs.simulate(hs.load("valve-stiction"), (0, 30), integrator=integrator, rtol=1e-9)
    turned = next(e.t for e in back.events if e.target == "slip-")
    assert 6000 - rate * (turned - 15) - p["k"] * back(turned)[0] == pytest.approx(-p["F_s"], rel=1e-8)


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_clutches(integrator: str) -> None:
    """Only the drive changes the angular momentum; the first clutch closes where a sum of its torques says."""
    sol = hs.simulate(hs.load("clutches"), (0, 2), integrator=integrator, rtol=1e-11)
    for t in np.linspace(0, 2, 21):
        assert sum(sol(t)) == pytest.approx(10 + 1 - cos(10 * t), rel=1e-10)
    with mpmath.workdps(30):
        torques = 2 * mpmath.mpf("0.3") * 40, mpmath.mpf("0.3") * 25
        closing = mpmath.findroot(
            lambda t: 11 - mpmath.cos(10 * t) - torques[0] * t + torques[1] * (t - mpmath.mpf("0.4")), 0.48
        )
    assert next(e.t for e in sol.events if e.component == "c1") == pytest.approx(float(closing), rel=1e-10)
    assert np.ptp(sol(2.0)) == 0.0  # all turn as one: bit for bit
