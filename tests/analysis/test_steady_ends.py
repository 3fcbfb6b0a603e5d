"""A search for a steady state ends by itself, and says what to declare."""

from __future__ import annotations

from importlib import import_module

import pytest

import hybridsim as hs


def slow_and_fast() -> hs.Model:
    """Van der Pol's oscillator with mu = 100: a period of some 163, with jumps that take a hundredth."""
    states = [hs.State("x", 2.0, "v"), hs.State("v", 0.0, "mu*(1 - x**2)*v - x")]
    return hs.Model("relaxation", states, parameters={"mu": 100.0})


def test_a_search_that_costs_too_much_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some 10 000 steps, and it is told before a run that would take more."""
    module = import_module("hybridsim.analysis.steady.steady_state")
    monkeypatch.setattr(module, "_ALLOWANCE", 0.01)
    found = hs.steady_state(slow_and_fast())
    assert found.kind == "not settled" and "declare the `duration`" in found.message


@pytest.mark.parametrize("name", ["settle", "max_periods"])
@pytest.mark.parametrize(
    "count", [10**400, 10**18, 10**7, 0, -1, 2.0, True], ids=["huge", "1e18", "1e7", "0", "-1", "2.0", "True"]
)
def test_counts_of_periods_that_would_never_end_are_refused(name: str, count: float) -> None:
    with pytest.raises(hs.UsageError, match=f"{name} is .*\n?.*from 1 to 1000000"):
        hs.steady_state("dfcs", **{name: count})
