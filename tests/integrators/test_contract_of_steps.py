"""What an integrator's steps have to be: the shape of their dense output, and what a method of order one meets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.run.stepping import Step
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.registry import registered

SHAPES = {
    "rows": lambda x0, rate, s: x0 + s[:, None] * rate,
    "columns": lambda x0, rate, s: (x0 + s[:, None] * rate).T,
    "one": lambda x0, rate, s: x0 + s[0] * rate,
    "scalar": lambda x0, rate, s: x0 + float(s) * rate,
}


class Steps:
    def __init__(self, flow: Any, x0: np.ndarray, bound: float, h: float, shape: str) -> None:
        self.flow, self.bound, self.h, self.shape = flow, bound, h, shape
        self.s, self.x = 0.0, x0

    def step(self) -> Step:
        s1 = self.bound if self.bound - self.s <= 1.001 * self.h else self.s + self.h
        step = self.restep(Step(self.s, s1, self.x, self.x, lambda s: s), s1)
        self.s, self.x = step.s1, step.x1
        return step

    def restep(self, step: Step, s: float) -> Step:
        rate = self.flow.rhs(step.s0, step.x0)
        x1 = self.flow.landed(s, step.x0 + (s - step.s0) * rate)
        return Step(
            step.s0, s, step.x0, x1, lambda t: SHAPES[self.shape](step.x0, rate, np.asarray(t) - step.s0)
        )


@dataclass(frozen=True)
class Euler(Integrator):
    """The explicit method of Euler, with a line between its steps."""

    name = "euler"
    title = "Euler"
    order = "1"
    reference = "Euler 1768"
    when = "never"
    lacks: ClassVar = {"adaptive": "its step is max_step"}
    shape: str = "rows"

    def start(self, flow, x0, s_bound, tolerances, first_step, watch):
        return Steps(flow, x0, s_bound, tolerances.max_step, self.shape)


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize(
    ("shape", "says"), [("columns", "2"), ("one", "2"), ("scalar", "fails for an array")]
)
def test_dense_output_of_another_shape_is_named(n: int, shape: str, says: str) -> None:
    """Also where there are as many states as the contract's example has times."""
    model = hs.Model("decay", states=[hs.State(f"x{k}", 1, der=f"-x{k}") for k in range(n)])
    with registered(Euler) as name:
        assert hs.simulate(model, (0, 1), integrator=name, max_step=0.1).status == "finished"
        with pytest.raises(hs.UsageError, match=f"dense output of a step of euler .*{says}") as caught:
            hs.simulate(model, (0, 1), integrator=name, max_step=0.1, shape=shape)
    assert "return states of shape (k, n)" in str(caught.value)


def test_a_release_is_beyond_order_one_and_no_rtol_is_proposed() -> None:
    """A body that is released starts with v = v' = 0: a step of Euler does not move it; it is held again at once."""
    with registered(Euler) as name:
        sol = hs.simulate("dfcs", (0, 0.1), integrator=name, max_step=1e-5)
    assert sol.status == "accumulation"
    assert "use a shorter step or an integrator of higher order" in sol.message and "rtol" not in sol.message
