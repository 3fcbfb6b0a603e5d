"""`exact` where a load is nothing for long and all at the end, or where an unstable part of a model rests."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

LATE = "exp(0.3*(t - 200))"


def ends(
    rates: list[str], starts: list[float], end: float, integrator: str = "exact", **options: float
) -> np.ndarray:
    states = [hs.State(f"x{i}", x, rate) for i, (x, rate) in enumerate(zip(starts, rates, strict=True))]
    found: np.ndarray = hs.simulate(hs.Model("m", states), (0, end), integrator=integrator, **options).y[
        :, -1
    ]
    return found


@pytest.mark.parametrize("end", [200.0, 220.0])
def test_an_integrated_late_load_beside_a_chain(end: float) -> None:
    """The last state is the load's integral, whatever the others do."""
    found = ends(["x1", "x2 + sin(0.2*t) + cos(0.25*t)", LATE], [0, 0, 0], end)
    integral = (np.exp(0.3 * (end - 200.0)) - np.exp(-60.0)) / 0.3
    assert found[2] == pytest.approx(integral, rel=1e-13)
    # and its own two integrals, with those of the waves
    late = (np.exp(0.3 * (end - 200.0)) - np.exp(-60.0)) / 0.3**2 - end * np.exp(-60.0) / 0.3
    waves = (1.0 - np.cos(0.2 * end)) / 0.2 + np.sin(0.25 * end) / 0.25
    assert found[1] == pytest.approx(late + waves, rel=1e-12)


@pytest.mark.parametrize(
    ("rates", "end"),
    [
        (["x1", f"sin(0.2*t) + {LATE}"], 220.0),
        (["0.1*x1", "0.1*x2", f"sin(0.2*t) + {LATE}"], 220.0),
        (["x1", "x2 + sin(0.2*t) + t**2", LATE], 220.0),
        (["x1", "x2", "x3", f"sin(0.2*t) + {LATE}"], 220.0),
        (["0.5*x0 + x1", "0.5*x1 + x2 + sin(7*t)", "0.5*x2 + x3 + t", "0.5*x3 + exp(2*(t - 50))"], 70.0),
    ],
)
def test_late_loads_against_series(rates: list[str], end: float) -> None:
    starts = [0.0] * len(rates)
    np.testing.assert_allclose(
        ends(rates, starts, end), ends(rates, starts, end, "taylor", rtol=1e-13), rtol=2e-12
    )


def test_an_unstable_part_at_rest_stays_there() -> None:
    """Of a part that nothing acts on there is nothing, though it would grow by 1e26."""
    rates = ["x1", "-1e-9*x0 + x3 + sin(t)", "x3", "-1e-9*x2 + x4", "2*x4"]
    found = ends(rates, [1.0, 0.0, 1.0, 0.0, 0.0], 30.0)
    assert found[4] == 0.0
    np.testing.assert_allclose(
        found, ends(rates, [1.0, 0.0, 1.0, 0.0, 0.0], 30.0, "taylor", rtol=1e-13), rtol=1e-11
    )
