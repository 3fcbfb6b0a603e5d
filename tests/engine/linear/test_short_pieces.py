"""The closed form is accurate in short pieces of an input, however long the run is."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from reference.shaken_storey import ShakenStorey
from scipy.interpolate import CubicSpline, PPoly

import hybridsim as hs

VALUES = (0.126, -0.132, 0.64, 0.105, -0.536)


def oscillator(times: list[float], speed: float, interpolation: str) -> hs.Model:
    return hs.Model(
        "oscillator",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "F - w*w*x")],
        parameters=[hs.Parameter("w", speed)],
        inputs=[hs.Input("F", "table", times=times, values=VALUES, interpolation=interpolation)],
    )


def coefficients(times: list[float], interpolation: str) -> np.ndarray:
    if interpolation == "cubic":
        return CubicSpline(times, VALUES, bc_type="natural").c
    slopes = np.diff(VALUES) / np.diff(times)
    return np.array([0 * slopes, 0 * slopes, slopes, VALUES[:-1]])


def motion(times: list[float], speed: float, interpolation: str) -> np.ndarray:
    """States at the knots: a particular polynomial and a free oscillation in each piece, in 50 digits."""
    with mpmath.workdps(50):
        w, x, v, found = mpmath.mpf(speed), mpmath.mpf(0), mpmath.mpf(0), [[0.0, 0.0]]
        for i, row in enumerate(coefficients(times, interpolation).T):
            c3, c2, c1, c0 = (mpmath.mpf(float(c)) for c in row)
            h = mpmath.mpf(times[i + 1]) - mpmath.mpf(times[i])
            # a0 + a1 s + a2 s**2 + a3 s**3 solves a'' + w**2 a = F
            a3, a2 = c3 / w**2, c2 / w**2
            a1, a0 = (c1 - 6 * a3) / w**2, (c0 - 2 * a2) / w**2
            y, u = x - a0, v - a1
            cosine, sine = mpmath.cos(w * h), mpmath.sin(w * h)
            x = a0 + h * (a1 + h * (a2 + h * a3)) + y * cosine + u * sine / w
            v = a1 + h * (2 * a2 + 3 * h * a3) + u * cosine - w * y * sine
            found.append([float(x), float(v)])
        return np.array(found)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("length", [0.02, 1.0])
@pytest.mark.parametrize("turn", [0.3, 1.0, 3.0, 15.8])
def test_a_mass_on_a_spring_follows_a_table(turn: float, length: float, interpolation: str) -> None:
    times = [length * k for k in range(5)]
    model = oscillator(times, turn / length, interpolation)
    for end in (times[-1], 100 * times[-1]):
        states = hs.simulate(model, (0, end), integrator="exact")(times)
        true = motion(times, turn / length, interpolation)
        assert (abs(states.T - true) <= 1e-12 * abs(true).max(axis=0)).all()


def test_pieces_of_very_different_lengths_follow_one_another() -> None:
    times = [0.0, 1.0, 1.001, 1.002, 2.0]
    states = hs.simulate(oscillator(times, 20.0, "cubic"), (0, 50), integrator="exact")(times)
    true = motion(times, 20.0, "cubic")
    assert (abs(states.T - true) <= 1e-12 * abs(true).max(axis=0)).all()


def test_a_storey_on_friction_follows_a_cubic_record() -> None:
    """The events and states of matrix exponentials that are multiplied over short steps."""
    model = hs.load("base-isolation")
    (record,) = model.inputs
    model = replace(model, inputs=(replace(record, interpolation="cubic"),))
    spline = CubicSpline(record.times, record.values, bc_type="natural")
    true = ShakenStorey(model.parameter_values(), PPoly(spline.c, spline.x)).run(6.0)
    sol = hs.simulate(model, (0, 20), integrator="exact")
    events = [event.t for event in sol.events if event.t <= 6.0]
    assert len(events) > 15
    assert events == pytest.approx([t for t, _ in true.events], abs=5e-13)
    assert pytest.approx(true.states, abs=5e-13) == sol(true.knots).T


@pytest.mark.parametrize("length", [1e-3, 0.03, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("before", [0.01, 1.0, 50.0])
def test_a_body_is_released_at_a_knot_between_pieces_of_any_lengths(before: float, length: float) -> None:
    """The force jumps at the knot from half of the friction limit 1 to 3, and then rises by 2 within the next piece.

    x(s) = s^2 + s^3/(3 length) at a time s after the knot.
    """
    times, values = [0.0, before, before, before + length], [0.25, 0.5, 3.0, 5.0]
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "F - f")],
        inputs=[hs.Input("F", "table", times=times, values=values)],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": 1})],
    )
    sol = hs.simulate(model, (0, before + length), integrator="exact")
    assert [(event.target, event.t) for event in sol.events] == [("slip+", before)]
    s = 0.5 * length
    assert sol(before + s)[0] == pytest.approx(s**2 + s**3 / (3 * length), rel=1e-11)
