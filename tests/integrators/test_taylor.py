"""Steps of the Taylor integrator that end where they have to."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
def test_a_step_that_would_leave_a_few_ulps_goes_all_the_way(rtol: float) -> None:
    """The knots of a record end steps: what is left before one by rounding is too short for a step of its own."""
    solution = hs.simulate("base-isolation", (0.0, 1.5), integrator="taylor", rtol=rtol)
    assert solution.status == "finished"
    other = hs.simulate("base-isolation", (0.0, 1.5), integrator="dop853", rtol=1e-12)
    times = np.linspace(0.0, 1.5, 101)
    size = np.abs(other(times)).max(axis=1, keepdims=True)
    assert np.all(np.abs(solution(times) - other(times)) <= 100 * rtol * size)
    assert [event.target for event in solution.events] == [event.target for event in other.events]
