"""States that grow from zero: right relative to themselves, and not to rounding of the largest state alone."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

import hybridsim as hs

TIMES = (1e-300, 1e-100, 1e-17, 3e-12, 1e-6, 1e-3, 0.1)


def chain(length: int, rate: str = "-x") -> hs.Model:
    """x, and states of which each is fed by the one before it, from zero."""
    names = ["x", *(f"y{k}" for k in range(1, length + 1))]
    fed = [hs.State(name, 0, der=before) for before, name in pairwise(names)]
    return hs.Model("chain", states=[hs.State("x", 1, der=rate), *fed])


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_what_is_fed_from_zero(integrator: str) -> None:
    """x' = -x, y' = x: y is 1 - exp(-t), which is t at first."""
    sol = hs.simulate(chain(1), (0, 2), integrator=integrator)
    for t in TIMES:
        assert sol(t)[1] == pytest.approx(
            -math.expm1(-t), rel=2e-14 if integrator == "exact" else 1e-8, abs=0.0
        )


@pytest.mark.parametrize("end", TIMES)
def test_the_end_of_a_short_run(end: float) -> None:
    """The state at the end of a segment is as good as one inside of it."""
    sol = hs.simulate(chain(1), (0, end), integrator="exact")
    assert sol.y[1, -1] == pytest.approx(-math.expm1(-end), rel=2e-14, abs=0.0)


@pytest.mark.parametrize("t", [1e-50, 1e-17, 1e-9, 1e-4])
def test_a_chain_of_integrators(t: float) -> None:
    """The k-th of them is t**k/k! as long as x has hardly moved."""
    sol = hs.simulate(chain(5, rate="0"), (0, 2), integrator="exact")
    for k in range(1, 6):
        assert sol(t)[k] == pytest.approx(t**k / math.factorial(k), rel=1e-14, abs=0.0)


def test_a_forced_state_and_one_that_oscillates() -> None:
    """x'' = -x + sin(t) from rest is (sin(t) - t cos(t))/2, which begins as t**3/6."""
    model = hs.Model("forced", states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="sin(t) - x")])
    sol = hs.simulate(model, (0, 2), integrator="exact")
    for t in (1e-90, 1e-17, 1e-9, 1e-5):
        assert sol(t) == pytest.approx([t**3 / 6, t**2 / 2], rel=1e-9, abs=0.0)


def test_a_state_far_smaller_than_the_others() -> None:
    """1e6 beside a state that is fed by a trickle: 1e-30 t."""
    states = [hs.State("x", 1e6, der="-0.5*x"), hs.State("y", 0, der="1e-36*x")]
    sol = hs.simulate(hs.Model("trickle", states=states), (0, 1), integrator="exact")
    for t in (1e-20, 1e-9, 1e-2):
        assert sol(t)[1] == pytest.approx(-2e-30 * math.expm1(-0.5 * t), rel=1e-13, abs=0.0)


def test_growth_after_an_event() -> None:
    """A segment that an event begins is as good at its start: y is set to zero at t = 1."""
    model = hs.Model(
        "again",
        states=[hs.State("x", 1, der="0*x"), hs.State("y", 0.5, der="x"), hs.State("c", 1, der="-1")],
        components=[
            hs.Component(
                "k",
                [
                    hs.Mode(
                        "before", guards=[hs.Guard("due", "c", then=(hs.Choice("after", reset={"y": 0}),))]
                    ),
                    hs.Mode("after"),
                ],
                initial="before",
            )
        ],
    )
    sol = hs.simulate(model, (0, 2), integrator="exact")
    t = 1.0 + 2.0**-40
    assert sol(t)[1] == pytest.approx(2.0**-40, rel=1e-3)  # the time itself is a double near 1
