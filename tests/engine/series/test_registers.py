"""Registers of a compiled loop from mode to mode: nothing of one mode is left behind in another."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "exact"])
def test_what_becomes_constant_is_constant_to_every_order(integrator: str) -> None:
    """x'' = -4 x for x > 0, free flight beyond: cos(2 t), then a straight line of slope -2."""
    pull = hs.Mode("pull", (hs.Guard("g", "x", ("free",)),), set={"F": "-2*x - 0.5"})
    free = hs.Mode("free", (hs.Guard("g", "-x", ("pull",)),), set={"F": "-0.5"})
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der="2*F + 1")]
    model = hs.Model("let-go", states=states, components=[hs.Component("c", (pull, free), initial="pull")])
    sol = hs.simulate(model, (0, math.pi / 4 + 1), integrator=integrator, rtol=1e-10)
    assert len(sol.events) == 1
    assert sol.y[:, -1] == pytest.approx([-2.0, -2.0], abs=1e-9)
