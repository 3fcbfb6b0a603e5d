"""A search for a steady state ends by itself, and says what to declare."""

from __future__ import annotations

import math
from importlib import import_module

import pytest
from scipy.special import ellipk

import hybridsim as hs


def slow_and_fast() -> hs.Model:
    """Van der Pol's oscillator with mu = 100: a period of some 163, with jumps that take a hundredth."""
    states = [hs.State("x", 2.0, "v"), hs.State("v", 0.0, "mu*(1 - x**2)*v - x")]
    return hs.Model("relaxation", states, parameters={"mu": 100.0})


def test_a_search_that_costs_too_much_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some 10 000 steps, and it is told before a run that would take more."""
    module = import_module("hybridsim.analysis.steady.steady_state")
    monkeypatch.setattr(module, "_TIME_BUDGET", 0.01)
    found = hs.steady_state(slow_and_fast())
    assert found.kind == "not settled" and "Declare a `duration`" in found.message


@pytest.mark.parametrize("name", ["settle", "max_periods"])
@pytest.mark.parametrize(
    "count", [10**400, 10**18, 10**7, 0, -1, 2.0, True], ids=["huge", "1e18", "1e7", "0", "-1", "2.0", "True"]
)
def test_counts_of_periods_that_would_never_end_are_refused(name: str, count: float) -> None:
    with pytest.raises(hs.UsageError, match=f"`{name}` cannot be .*\n?.*from 1 to 1000000"):
        hs.steady_state("dfcs", **{name: count})


def two_tones(fast: float, further: str = "") -> hs.Model:
    """A relaxation that is driven by two forcings, one of them by so much the faster."""
    return hs.Model("tones", [hs.State("x", 0.0, f"-x{further} + sin(t) + sin({fast}*t)")])


@pytest.fixture
def most_steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The steps of the longest run of a search, whose time budget is a second."""
    most, module = [0], import_module("hybridsim.analysis.steady.motion")
    cost = module._cost_of

    def counted(solution: hs.Solution) -> float:
        most[0] = max(most[0], solution.stats["steps"])
        return float(cost(solution))

    monkeypatch.setattr(module, "_cost_of", counted)
    monkeypatch.setattr(import_module("hybridsim.analysis.steady.steady_state"), "_TIME_BUDGET", 1.0)
    return most


@pytest.mark.parametrize(
    "model",
    [two_tones(1e6 + 3), two_tones(1e6 * 2**0.5), two_tones(1e6 * 2**0.5, " - x**3")],
    ids=["common", "none", "none-cubic"],
)
def test_a_run_that_would_cost_too_much_is_not_made(model: hs.Model, most_steps: list[int]) -> None:
    """32 periods of the slow forcing are 3.2e7 of the fast one: about 1e8 steps, and 1 in 1000 of them is taken."""
    found = hs.steady_state(model, integrator="taylor")
    assert found.kind == "not settled" and "a smaller `settle`" in found.message
    assert most_steps[0] <= 100_000


def test_a_smaller_settle_is_a_remedy(most_steps: list[int]) -> None:
    """sin t and sin 1000 t drive x with amplitudes 1/sqrt(2) and 1e-3, whose maxima all but coincide."""
    model = two_tones(1000.0)
    assert hs.steady_state(model, integrator="tsit5", settle=64).kind == "not settled"
    found = hs.steady_state(model, integrator="tsit5", settle=4)
    assert found.kind == "periodic" and found.period == pytest.approx(2.0 * math.pi, rel=1e-12)
    assert found.amplitude["x"] == pytest.approx(2**-0.5 + 1e-3, abs=2e-5)


@pytest.mark.parametrize(("amplitude", "modulus"), [(3.1, 1.55), (3.12, 1.56)])
def test_a_closed_orbit_beside_a_separatrix(amplitude: float, modulus: float) -> None:
    """A pendulum let go near the top swings with period 4 K(sin(amplitude/2)); a turn loses some roundings."""
    pendulum = hs.Model("pendulum", states=[hs.State("x", amplitude, "y"), hs.State("y", 0, "-sin(x)")])
    steady = hs.steady_state(pendulum, integrator="dop853")
    assert steady.kind == "periodic"
    assert steady.period == pytest.approx(4.0 * ellipk(math.sin(modulus) ** 2), rel=1e-8)
    assert steady.amplitude["x"] == pytest.approx(amplitude, rel=1e-9)
