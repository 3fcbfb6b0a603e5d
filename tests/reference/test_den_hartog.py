"""Den Hartog's motion without stops and the harmonic balance: against published figures, limits and other formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.reference.closed_forms.den_hartog import largest_friction, linear_amplitude, no_stops
from hybridsim.reference.closed_forms.harmonic_balance import equivalent_viscous_amplitude


def written_out(r: float, zeta: float, f: float) -> float:
    """X = -G f + sqrt(R^2 - H^2 f^2), as the formula is printed: the code solves two linear equations instead."""
    kappa, th = math.sqrt(1.0 - zeta**2), math.pi / r
    D = math.cosh(zeta * th) + math.cos(kappa * th)
    G = (math.sinh(zeta * th) - zeta / kappa * math.sin(kappa * th)) / D
    H = math.sin(kappa * th) / (kappa * r * D)
    return -G * f + math.sqrt(1.0 / ((1.0 - r * r) ** 2 + (2.0 * zeta * r) ** 2) - (H * f) ** 2)


@pytest.mark.parametrize(
    ("r", "zeta", "f", "amplitude"),
    [
        (0.5, 0.1, 0.1, 1.29106198410752),
        (0.8, 0.05, 0.3, 2.34687196742201),
        (1.0, 0.1, 0.4, 2.45007379839183),
        (1.4, 0.2, 0.3, 0.65747394747958),
        (1.0, 0.02, 0.5, 9.08353796402552),
    ],
)
def test_amplitude_in_fifteen_digits(r: float, zeta: float, f: float, amplitude: float) -> None:
    found = no_stops(r, zeta, f)
    assert found.holds
    assert found.amplitude == pytest.approx(amplitude, rel=1e-14)


@given(r=st.floats(0.3, 2.0), zeta=st.floats(1e-3, 0.5), f=st.floats(0.0, 0.5))
def test_amplitude_is_the_printed_formula(r: float, zeta: float, f: float) -> None:
    found = no_stops(r, zeta, f)
    if math.isfinite(found.amplitude):
        # near the end of the square root half of the digits go in either form
        assert found.amplitude == pytest.approx(written_out(r, zeta, f), rel=1e-7, abs=1e-7)


def undamped_boundary(r: float) -> float:
    """sqrt(V^2/(U^2 + S^2)), Den Hartog's own formula without viscous damping, S by brute force."""
    U, V = math.tan(math.pi / (2.0 * r)) / r, 1.0 / (1.0 - r * r)
    s = np.linspace(1e-4, math.pi - 1e-4, 400_001)
    S = np.max((np.sin(s / r) / r + U * (np.cos(s) - np.cos(s / r))) / np.sin(s))
    return float(abs(V) / math.hypot(U, max(S, 1.0 / r**2)))


@pytest.mark.parametrize("r", [0.55, 0.65, 0.75, 0.9, 1.1, 1.3, 1.6, 2.0])
def test_boundary_without_damping(r: float) -> None:
    assert largest_friction(r, 0.0) == pytest.approx(undamped_boundary(r), rel=1e-10)


def test_boundary_between_two_known_motions() -> None:
    """At r = 0.75 the motion with f = 0.783 does not stop, that with 0.786 does."""
    assert 0.783 < largest_friction(0.75, 0.0) < 0.786


@given(r=st.floats(0.05, 2.0), zeta=st.floats(1e-3, 0.9))
def test_without_friction_both_are_the_linear_oscillator(r: float, zeta: float) -> None:
    amplitude = 1.0 / abs(1.0 - r * r + 2j * zeta * r)
    assert linear_amplitude(r, zeta) == pytest.approx(amplitude, rel=1e-12)
    assert no_stops(r, zeta, 0.0).amplitude == pytest.approx(amplitude, rel=1e-12)
    assert equivalent_viscous_amplitude(r, zeta, 0.0) == pytest.approx(amplitude, rel=1e-12)


@given(r=st.floats(0.05, 2.0), zeta=st.floats(1e-3, 0.9), f=st.floats(0.0, 0.78))
def test_equivalent_damper_takes_as_much_work_as_friction(r: float, zeta: float, f: float) -> None:
    """With the damper that the amplitude asks for, a linear oscillator has that amplitude."""
    A = equivalent_viscous_amplitude(r, zeta, f)
    work = 4.0 * f * A  # a cycle, in F0^2/k
    added = work / (2.0 * math.pi * r * A**2)  # the damper pi c w A^2 = work, as a damping ratio
    assert linear_amplitude(r, zeta + added) == pytest.approx(A, rel=1e-9)


def test_too_much_friction_moves_nothing_in_the_balance() -> None:
    assert equivalent_viscous_amplitude(0.7, 0.02, math.pi / 4.0) == 0.0
