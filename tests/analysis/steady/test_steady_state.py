"""Steady states against closed forms, a known period and long runs; what does not repeat is said not to."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

# r, zeta, f = mu N/F0 and the amplitude in F0/k of the steady motion without stops (J. P. Den Hartog, Trans. ASME 53
# (1931) 107, with viscous damping); the last column from the formula in 32 digits
NO_STOPS = (
    (0.5, 0.1, 0.1, 1.29106198410752),
    (0.8, 0.05, 0.3, 2.34687196742201),
    (1.0, 0.1, 0.4, 2.45007379839183),
    (1.4, 0.2, 0.3, 0.65747394747958),
    (1.0, 0.02, 0.5, 9.08353796402552),
)


def oscillator(r: float, zeta: float, f: float) -> hs.Model:
    """m = k = F0 = 1: displacement in F0/k, time in 1/wn."""
    return hs.load("dfcs").with_(m=1, k=1, F0=1, c=2.0 * zeta, mu=1, N=f, omega=r)


@pytest.mark.parametrize(("r", "zeta", "f", "amplitude"), NO_STOPS)
def test_den_hartog(r: float, zeta: float, f: float, amplitude: float) -> None:
    found = hs.steady_state(oscillator(r, zeta, f))
    assert found.kind == "periodic" and found.multiple == 1
    assert found.newton_steps <= 10
    assert abs(found.amplitude["x"] / amplitude - 1.0) < 1e-10
    assert found.stops_per_period["f"] == 0.0


@pytest.mark.parametrize(("f", "stops"), [(0.783, 0.0), (0.786, 2.0)])
def test_stops_begin_where_den_hartog_has_them(f: float, stops: float) -> None:
    found = hs.steady_state(oscillator(0.75, 0.0, f), x0={"x": 0.5})
    assert found.stops_per_period["f"] == stops


def test_the_belt_has_its_known_period() -> None:
    found = hs.steady_state("belt")
    assert found.kind == "periodic"
    assert abs(found.period / 12.00103129483058 - 1.0) < 1e-10
    assert sorted(found.word) == ["slip-", "stick"]


def test_energy_balance_over_a_period() -> None:
    """What the forcing puts in, friction and damper take out."""
    model = hs.load("dfcs")
    found = hs.steady_state(model)
    values = model.parameter_values()
    orbit = found._orbit
    times = orbit.starts[:, None] + 0.5 * orbit.lengths[:, None] * (
        1.0 + np.polynomial.legendre.leggauss(16)[0]
    )
    force = values["F0"] * np.sin(values["omega"] * times)
    put_in = orbit.integral(force * orbit.of("v"))
    assert abs(found.dissipated["f"] + values["c"] * found.energy["v"] - put_in) < 1e-12 * put_in


def test_harmonics_of_an_odd_motion() -> None:
    """x(t + T/2) = -x(t): no even harmonics; the harmonics make up the energy (Parseval)."""
    found = hs.steady_state("dfcs")
    harmonics = np.array([abs(found.harmonic("x", k)) for k in range(40)])
    assert (harmonics[::2] < 1e-12 * harmonics[1]).all()
    energy = 0.5 * found.period * (harmonics[1:] ** 2).sum()
    assert abs(energy / found.energy["x"] - 1.0) < 1e-6


def test_multipliers_are_those_of_the_period_map() -> None:
    """Against central differences of the map itself; each contact that sticks gives an exact zero."""
    found = hs.steady_state(hs.load("dfcs").with_(N=12))
    start, period, motion = found._closed.start, found.period, found._motion
    matrix = np.empty((2, 2))
    for j, step in enumerate((1e-9, 1e-6)):
        move = np.zeros(2)
        move[j] = step
        ends = [motion.run(start.moved(sign * move), period).y[:, -1] for sign in (1, -1)]
        matrix[:, j] = (ends[0] - ends[1]) / (2.0 * step)
    expected = sorted(np.linalg.eigvals(matrix), key=abs)
    assert np.allclose(sorted(found.multipliers, key=abs), expected, rtol=1e-6, atol=1e-9)
    assert found.stable


def test_stick_makes_a_multiplier_zero() -> None:
    assert abs(hs.steady_state("dfcs").multipliers[-1]) < 1e-14


def test_nothing_moves_below_the_threshold() -> None:
    found = hs.steady_state(hs.load("dfcs").with_(F0=19))
    assert found.amplitude["x"] == 0.0
    assert found.stick_fraction["f"] == 1.0
    assert found.stops_per_period["f"] == 0.0


def test_a_decay_ends_at_rest() -> None:
    found = hs.steady_state("free-decay")
    assert found.kind == "equilibrium"
    assert found.amplitude["x"] < 1e-14 < abs(found.mean["x"])


def test_slow_contraction_is_not_taken_for_arrival() -> None:
    """With next to no damping the motion is 1e-6 from its end when it changes by 1e-9 a period."""
    r, zeta = 0.8, 1e-5
    found = hs.steady_state(oscillator(r, zeta, 0.0))
    exact = 1.0 / math.hypot(1.0 - r * r, 2.0 * zeta * r)
    assert abs(found.amplitude["x"] / exact - 1.0) < 1e-10
    assert found.newton_steps > 0


def test_a_record_has_no_steady_state() -> None:
    with pytest.raises(UsageError, match="no steady state"):
        hs.steady_state("base-isolation")


def test_unknown_names_are_told() -> None:
    found = hs.steady_state("dfcs")
    with pytest.raises(UsageError, match="'y'"):
        found.amplitude["y"]
    with pytest.raises(UsageError, match="contact"):
        found.stick_fraction["x"]


def feeny_moon(frequency: float) -> hs.Model:
    """Friction that grows with the position (B. Feeny, F. C. Moon, J. Sound Vib. 170 (1994) 303)."""
    return hs.Model(
        "feeny-moon",
        parameters={"w": frequency},
        states=[
            hs.State("x", start=0.5, der="v"),
            hs.State("v", start=0, der="-0.03*v - x + 1.9*cos(w*t) - f"),
        ],
        contacts=[
            hs.Contact("f", velocity="v", normal="max(1 + 1.5*x, 0)", law="coulomb", arguments={"mu": 1})
        ],
    )


def test_chaos_is_named() -> None:
    found = hs.steady_state(feeny_moon(1.25), max_periods=64, tol=1e-8)
    assert found.kind == "chaotic" and not found.success
    assert found.lyapunov > 0.05
    with pytest.raises(UsageError, match="chaotic"):
        found.amplitude["x"]


def test_period_two_is_named() -> None:
    found = hs.steady_state(feeny_moon(1.7), tol=1e-9)
    assert (found.kind, found.multiple) == ("periodic", 2)
    assert found.period == pytest.approx(2.0 * 2.0 * math.pi / 1.7, rel=1e-14)
    assert found.residual < 1e-9


def test_a_torus_is_named() -> None:
    """A self-excited block, shaken a little at a frequency of its own."""
    shaken = hs.Model(
        "shaken",
        parameters={"w": 0.7},
        states=[
            hs.State("x", start=2, der="v", nominal=1),
            hs.State("v", start=0, der="-x - f + 0.05*sin(w*t) + 0.5*(1 - x*x)*v", nominal=1),
        ],
        contacts=[hs.Contact("f", velocity="v", normal="0.01", law="coulomb", arguments={"mu": 1})],
    )
    found = hs.steady_state(shaken, max_periods=128, tol=1e-8)
    assert found.kind == "quasi-periodic"
    assert abs(found.lyapunov) < 1e-3


@pytest.mark.parametrize("velocity", ["v", "v + 0*x*t"])  # a name, and what has to be evaluated
def test_a_law_with_memory_has_work_of_friction(velocity: str) -> None:
    """What the forcing brings in is what the damper and the contact take out."""
    model = hs.load("blade-damper")
    contact = hs.Contact("f", velocity, "N", "jenkins", {"mu": "mu", "k": "k_d"})
    model = replace(model, contacts=(contact,))
    p = model.parameter_values()
    found = hs.steady_state(model, period=2.0 * math.pi / p["omega"])
    X = found.harmonic("x", 1)  # x = Re(X e^{iwt}) and the forcing F0 Re(-i e^{iwt})
    brought = -math.pi * p["F0"] * X.real
    taken = 2.0 * p["zeta"] * math.sqrt(p["k_b"] * p["m"]) * found.energy["v"]
    assert found.dissipated["f"] == pytest.approx(brought - taken, rel=1e-8)
    assert found.dissipated["f"] > 0.0 and not dict(found.stick_fraction)
