"""Mechanical systems stop at their limits, and say what they have cost."""

from __future__ import annotations

import hybridsim as hs


def oscillator(omega: float) -> hs.MechanicalSystem:
    """A mass on a spring, forced at a frequency."""
    return hs.MechanicalSystem([1.0], None, [1.0], forcing=[hs.Harmonic(omega, sin=1.0)])


def test_a_forcing_that_is_far_too_fast_ends_at_the_limit_of_seconds() -> None:
    sol = hs.simulate(oscillator(1e9), (0, 10), limits={"seconds": 0.5})
    assert sol.status == "limit"
    assert not sol.success
    assert "at most 0.5 are allowed" in sol.message
    assert 0.0 < sol.t[-1] < 10.0


def test_time_stepping_takes_limits() -> None:
    system = hs.chain_on_belt(3)
    sol = hs.simulate(
        system, (0, 5000), integrator="moreau", step=1e-3, keep="nothing", limits={"steps": 1000}
    )
    assert sol.status == "limit"
    assert 1000 <= sol.stats["steps"] < 5_000_000


def test_a_limit_that_is_not_reached_changes_nothing() -> None:
    system = hs.chain_on_belt(3)
    free, limited = (hs.simulate(system, (0, 5), limits=limits) for limits in (None, {"steps": 1e6}))
    assert (free.y == limited.y).all()
    assert limited.success
