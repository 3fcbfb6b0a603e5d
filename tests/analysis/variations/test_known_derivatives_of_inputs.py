"""Derivatives by the parameters of inputs, against closed forms that mpmath differentiates."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from known_slopes import ELSE, check

import hybridsim as hs
from hybridsim.errors import UsageError

WAVE = {"A": 1.5, "B": 0.2, "P": 1.1, "F": 0.3}


def driven(name: str, kind: str, values: dict[str, float], **shape: object) -> hs.Model:
    """v' = u."""
    return hs.Model(
        name,
        parameters=values,
        states=[hs.State("v", 0, "u", nominal=1)],
        inputs=[hs.Input("u", kind, **shape)],
    )


def test_a_square_wave() -> None:
    """v is the integral of the wave, which rises at rate B + A for a part D of each period, and then at B - A."""
    values = WAVE | {"D": 0.4}
    model = driven(
        "square", "wave", values, shape="square", amplitude="A", offset="B", period="P", phase="F", duty="D"
    )

    def v(t: mp.mpf, A: mp.mpf, B: mp.mpf, P: mp.mpf, F: mp.mpf, D: mp.mpf) -> mp.mpf:
        def since_phase(s: mp.mpf) -> mp.mpf:
            whole = mp.floor(s / P)
            rest = s - whole * P
            return A * (whole * (2 * D - 1) * P + (rest if rest < D * P else 2 * D * P - rest))

        return B * t + since_phase(t - F) - since_phase(-F)

    def u(t: mp.mpf, A: mp.mpf, B: mp.mpf, P: mp.mpf, F: mp.mpf, D: mp.mpf) -> mp.mpf:
        tau = (t - F) / P
        return B + (A if tau - mp.floor(tau) < D else -A)

    solution = hs.simulate(model, (0, 4), integrator="exact")
    check(solution, {"v": v, "u": u}, values, [0.1, 0.5, 1.0, 2.0, 4.0])


def test_a_triangle_wave() -> None:
    model = driven(
        "triangle", "wave", WAVE, shape="triangle", amplitude="A", offset="B", period="P", phase="F"
    )

    def shape(tau: mp.mpf) -> mp.mpf:  # its integral over tau, from 0
        rest = tau - mp.floor(tau)
        if rest <= 0.25:
            return 2 * rest**2
        if rest <= 0.75:
            return mp.mpf(1) / 4 - 2 * (rest - mp.mpf(1) / 2) ** 2
        return 2 * (1 - rest) ** 2

    def v(t: mp.mpf, A: mp.mpf, B: mp.mpf, P: mp.mpf, F: mp.mpf) -> mp.mpf:
        return B * t + A * P * (shape((t - F) / P) - shape(-F / P))

    check(hs.simulate(model, (0, 3), integrator="exact"), {"v": v}, WAVE, [0.2, 0.5, 1.3, 3.0])


def test_a_sawtooth_and_a_sine() -> None:
    saw = driven("saw", "wave", WAVE, shape="sawtooth", amplitude="A", offset="B", period="P", phase="F")
    sine = driven("sine", "wave", WAVE, shape="sine", amplitude="A", offset="B", period="P", phase="F")

    def of_saw(t: mp.mpf, A: mp.mpf, B: mp.mpf, P: mp.mpf, F: mp.mpf) -> mp.mpf:
        def integral(tau: mp.mpf) -> mp.mpf:
            rest = tau - mp.floor(tau)
            return rest**2 - rest

        return B * t + A * P * (integral((t - F) / P) - integral(-F / P))

    def of_sine(t: mp.mpf, A: mp.mpf, B: mp.mpf, P: mp.mpf, F: mp.mpf) -> mp.mpf:
        w = 2 * mp.pi / P
        return B * t + A / w * (mp.cos(w * F) - mp.cos(w * (t - F)))

    check(hs.simulate(saw, (0, 3), integrator="exact"), {"v": of_saw}, WAVE, [0.2, 0.5, 1.3, 3.0])
    check(
        hs.simulate(sine, (0, 3), integrator="taylor", rtol=1e-12),
        {"v": of_sine},
        WAVE,
        [0.5, 1.3, 3.0],
        ELSE,
    )


@pytest.mark.parametrize(("shape", "expected"), [("square", 0.2), ("triangle", 0.08), ("sawtooth", -0.16)])
def test_a_wave_of_amplitude_zero(shape: str, expected: float) -> None:
    """The derivative by the amplitude is the integral of the shape over the first fifth of the period."""
    model = driven("flat", "wave", {"A": 0.0}, shape=shape, amplitude="A", period=1)
    found = hs.sensitivities(hs.simulate(model, (0, 0.2)), ["A"])
    assert found.by_parameter[0, 0] == pytest.approx(expected, rel=1e-9)


def test_a_chirp() -> None:
    values = {"A": 1.5, "f0": 0.4, "f1": 1.3, "D": 1.7, "p": 0.3}
    model = driven("chirp", "chirp", values, amplitude="A", f0="f0", f1="f1", duration="D", phase="p")

    def u(t: mp.mpf, A: mp.mpf, f0: mp.mpf, f1: mp.mpf, D: mp.mpf, p: mp.mpf) -> mp.mpf:
        inside = min(t, D)
        turns = f0 * inside + (f1 - f0) * inside**2 / (2 * D) + f1 * (t - inside)
        return A * mp.sin(p + 2 * mp.pi * turns)

    def v(t: mp.mpf, **named: mp.mpf) -> mp.mpf:
        return mp.quad(lambda s: u(s, **named), [0, min(t, named["D"]), t])

    solution = hs.simulate(model, (0, 2.5), integrator="taylor", rtol=1e-12)
    check(solution, {"u": u}, values, [0.3, 1.0, 2.5], ELSE)
    check(solution, {"v": v}, values, [1.0, 2.5], ELSE)


def test_a_step_in_time_at_a_parameter() -> None:
    """v' = -v + p from T on: v = v0 exp(-t) + p (1 - exp(T - t))."""
    model = hs.Model(
        "step",
        parameters={"v0": 1.0, "p": 0.7, "T": 0.4},
        states=[hs.State("v", "v0", "-v + (p if t > T else 0)", nominal=1)],
    )

    def v(t: mp.mpf, v0: mp.mpf, p: mp.mpf, T: mp.mpf) -> mp.mpf:
        return v0 * mp.exp(-t) + (p * (1 - mp.exp(T - t)) if t > T else 0)

    solution = hs.simulate(model, (0, 1), integrator="exact")
    check(solution, {"v": v}, {"v0": 0, "p": 0, "T": 0}, [0.2, 0.5, 1.0])


def test_a_gain_of_a_table() -> None:
    """v' = c u with u from 0 to 2 in 1 s, and then 2: v = c t^2 until 1."""
    model = hs.Model(
        "table",
        parameters={"c": 0.7},
        states=[hs.State("v", 0, "c*u", nominal=1)],
        inputs=[hs.Input("u", "table", times=[0, 1, 2], values=[0, 2, 2])],
    )

    def v(t: mp.mpf, c: mp.mpf) -> mp.mpf:
        return c * (t * t if t < 1 else 2 * t - 1)

    check(hs.simulate(model, (0, 2), integrator="exact"), {"v": v}, {"c": 0}, [0.5, 1.5, 2.0])


def test_a_knot_at_the_start_has_no_derivative_by_its_time() -> None:
    """A square wave that jumps at t = 0: later it is -1 before the jump, earlier nothing changes."""
    values = {"A": 1.5, "F": 0.0}
    model = driven("square", "wave", values, shape="square", amplitude="A", period=2, phase="F")
    found = hs.sensitivities(hs.simulate(model, (0, 0.5), integrator="exact"))
    assert found.by_parameter[0, 0] == pytest.approx(0.5)
    assert np.isnan(found.by_parameter[0, 1])
    assert any("input" in warning and "F" in warning for warning in found.warnings)


def test_knots_of_two_inputs_at_one_instant_that_move_apart_are_refused() -> None:
    model = hs.Model(
        "two",
        parameters={"F": 0.5},
        states=[hs.State("v", 0, "u + w", nominal=1)],
        inputs=[
            hs.Input("u", "wave", shape="square", period=4, phase="F"),
            hs.Input("w", "wave", shape="square", period=4, phase=0.5),
        ],
    )
    with pytest.raises(UsageError, match="several events coincide at t = 0"):
        hs.sensitivities(hs.simulate(model, (0, 1)))
