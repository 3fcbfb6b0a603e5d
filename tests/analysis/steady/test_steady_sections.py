"""Periods whose events fall on their ends: each event is in the period once, and the multipliers are closed forms."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs

TWO = 'x = { start = 1, der = "-x" }\ny = { start = 0.3, der = "x - y/2" }'
FORCED = 'x = { start = 1, der = "-x + 0*sin(2*pi*t)" }\ny = { start = 0, der = "x - y/2" }'
REFILL = 'reset = { x = "1", y = "2.1*y" }'


def model(states: str, rest: str = "", parameters: str = "") -> hs.Model:
    return hs.Model.from_toml(
        f'schema = 1\nname = "section"\n[parameters]\n{parameters}\n[states]\n{states}\n{rest}\n'
    )


def of_clock(offset: float) -> str:
    return f'[schedules.c]\nperiod = 1\nstart = {offset}\nreset.x = "2*x + 1"'


@pytest.mark.parametrize(
    "rest",
    [
        of_clock(0.0),
        of_clock(0.3),
        # the same times found by a guard, which are rounded to either side of the ends
        '[monitors.c]\nexpr = "sin(2*pi*t)"\ndirection = "up"\naction = "reset"\nreset.x = "2*x + 1"',
        '[monitors.c]\nexpr = "cos(2*pi*t)"\ndirection = "up"\naction = "reset"\nreset.x = "2*x + 1"',
    ],
)
def test_a_reset_once_a_period(rest: str) -> None:
    """Over a period x -> 2 x/e + const. and y -> y/sqrt(e) + ...: a triangular matrix."""
    found = hs.steady_state(model(FORCED, rest))
    assert found.period == pytest.approx(1.0, rel=1e-14)
    assert found.multipliers == pytest.approx([2.0 / math.e, math.exp(-0.5)], rel=1e-9)
    assert found.stable
    resets = [event for event in found.solution.events if event.x_plus[0] != event.x_minus[0]]
    assert len(resets) == 1
    # x+ = 2 x- + 1 and x- = x+/e
    assert resets[0].x_plus[0] == pytest.approx(1.0 / (1.0 - 2.0 / math.e), rel=1e-9)


@pytest.mark.parametrize(
    "rest",
    [
        '[monitors.c]\nexpr = "x - 0.2"\ndirection = "down"\naction = "reset"\n'
        'reset.x = "1"\nreset.y = "2.1*y"',
        '[components.c]\ninitial = "a"\n'
        f'modes.a.guards.low = {{ expr = "x - 0.2", then = [{{ to = "a", {REFILL} }}] }}',
    ],
)
def test_a_refill_without_forcing(rest: str) -> None:
    """x falls from 1 to 1/5; y decays and is multiplied by 2.1: the multiplier is 2.1 exp(-T/2) with T = log 5."""
    found = hs.steady_state(model(TWO, rest))
    assert found.kind == "periodic"
    assert found.period == pytest.approx(math.log(5.0), rel=1e-10)
    assert found.multipliers == pytest.approx([2.1 / math.sqrt(5.0)], rel=1e-9)
    assert len(found.solution.events) == 1


def test_a_monitor_in_the_middle_of_an_oscillation() -> None:
    """A harmonic oscillator's own zero is where a section without forcing would be: two zeros a period."""
    states = [
        hs.State("x", 2, "x - y - x*(x**2 + y**2)"),
        hs.State("y", 0, "x + y - y*(x**2 + y**2)"),
    ]
    found = hs.steady_state(hs.Model("circle", states=states, monitors=[hs.Monitor("zero", "x", "both")]))
    assert found.period == pytest.approx(2.0 * math.pi, rel=1e-10)
    assert [event.component for event in found.solution.events] == ["zero", "zero"]
    assert found.multipliers == pytest.approx([math.exp(-4.0 * math.pi)], rel=1e-6)


def test_the_phase_of_a_harmonic_is_that_of_the_forcing() -> None:
    """x' = -x + cos(2 pi t): c_1 = 1/(1 + 2 pi i), wherever the period begins."""
    forced = 'x = { start = 0, der = "-x + cos(2*pi*t)" }'
    exact = 1.0 / (1.0 + 2.0j * math.pi)
    plain = hs.steady_state(model(forced))
    marked = hs.steady_state(model(forced, '[monitors.c]\nexpr = "sin(2*pi*t)"'))
    assert (plain.solution.t_start, marked.solution.t_start) == (0.0, pytest.approx(0.25, abs=0.02))
    for found in (plain, marked):
        assert abs(found.harmonic("x") - exact) < 1e-9


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_a_branch_over_the_period_of_a_clock(offset: float) -> None:
    """x -> 2 x exp(-T): the multiplier over T, followed by the period of the clock itself."""
    clock = f'[schedules.c]\nperiod = "T"\nstart = "{offset}*T"\nreset.x = "2*x + 1"'
    branch = hs.continuation(model('x = { start = 1, der = "-x" }', clock, "T = 1"), "T", (0.9, 1.1))
    assert (branch.parameter.min(), branch.parameter.max()) == pytest.approx((0.9, 1.1), rel=1e-12)
    found = [point.multipliers[0].real for point in branch.points]
    assert found == pytest.approx([2.0 * math.exp(-T) for T in branch.parameter], rel=1e-9)
