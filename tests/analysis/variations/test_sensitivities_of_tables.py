"""Derivatives by the values of a table, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from known_slopes import EXACT
from scipy.interpolate import CubicSpline

import hybridsim as hs

TIMES, VALUES = (0.5, 1.0, 2.0, 2.5), (0.2, 1.0, 0.6, 1.4)
NAMES = [f"u[{k}]" for k in range(4)]


def driven(
    interpolation: str, times: tuple[float, ...] = TIMES, values: tuple[float, ...] = VALUES
) -> hs.Model:
    """A point whose speed is the table."""
    return hs.Model(
        "driven",
        parameters={"a": 2.0},
        states=[hs.State("x", 0, "a*u", nominal=1)],
        inputs=[hs.Input("u", "table", times=times, values=values, interpolation=interpolation)],
    )


def hats(t: float) -> np.ndarray:
    """The derivatives of a linear table by its values."""
    return np.array([np.interp(t, TIMES, row) for row in np.eye(4)])


def areas(t: float) -> np.ndarray:
    """The integrals of the same from 0 to t: trapezoids between 0, the points and t."""
    knots = np.array([0.0, *(one for one in TIMES if one < t), t])
    rows = np.array([hats(float(one)) for one in knots])
    return (np.diff(knots)[:, None] * 0.5 * (rows[1:] + rows[:-1])).sum(axis=0)


@pytest.mark.parametrize("integrator", ["exact", "dop853"])
def test_a_linear_table(integrator: str) -> None:
    """The place is a times the area, before, between and behind the points."""
    run = hs.simulate(driven("linear"), (0, 3), integrator=integrator)
    found = hs.sensitivities(run, ["u[2]", "a", *NAMES])  # one value twice
    for t in (0.3, 0.5, 0.8, 1.0, 1.7, 2.2, 2.5, 3.0):
        at = found.at(t, ["x", "u"]).by_parameter
        assert at[0, 2:] == pytest.approx(2.0 * areas(t), rel=EXACT, abs=1e-12)
        assert at[1, 2:] == pytest.approx(hats(t), rel=EXACT, abs=1e-12)
        assert at[:, 0] == pytest.approx(at[:, 4], abs=1e-14)
        assert at[0, 1] == pytest.approx(areas(t) @ VALUES, rel=EXACT, abs=1e-12)
    mean = found.of("mean", "x", t_span=(0, 3)).by_parameter[2:]
    expected = 2.0 * np.trapezoid([areas(t) for t in np.linspace(0, 3, 6001)], dx=3 / 6000, axis=0) / 3
    assert mean == pytest.approx(expected, rel=1e-6)


def test_a_cubic_table() -> None:
    """The natural spline of each unit vector, by SciPy."""
    found = hs.sensitivities(hs.simulate(driven("cubic"), (0.5, 2.5), integrator="taylor"), NAMES)
    splines = [CubicSpline(TIMES, row, bc_type="natural") for row in np.eye(4)]
    for t in (0.7, 1.4, 2.3, 2.5):
        at = found.at(t, ["x", "u"]).by_parameter
        assert at[0] == pytest.approx([2.0 * s.integrate(0.5, t) for s in splines], rel=EXACT, abs=1e-12)
        assert at[1] == pytest.approx([float(s(t)) for s in splines], rel=EXACT, abs=1e-12)


def test_a_table_that_jumps() -> None:
    """From 1 to 3 at t = 1: the area is v0 until then, and v1 after it."""
    run = hs.simulate(driven("linear", (0, 1, 1, 2), (1, 1, 3, 3)), (0, 2), integrator="exact")
    found = hs.sensitivities(run, NAMES)
    assert found.by_parameter[0] == pytest.approx(
        [1.0, 1.0, 1.0, 1.0], rel=EXACT
    )  # a times halves of an area
    assert found.at(1.0, "u", side="-").by_parameter[0] == pytest.approx([0, 1, 0, 0], abs=1e-14)
    assert found.at(1.0, "u").by_parameter[0] == pytest.approx([0, 0, 1, 0], abs=1e-14)


def test_the_release_of_a_block_by_a_table() -> None:
    """A block is pulled by the table until it reaches mu: the release moves by -hat/slope and by 1/slope."""
    model = hs.Model(
        "pulled",
        parameters={"mu": 0.7},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "u - f", nominal=1)],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": "mu"})],
        inputs=[hs.Input("u", "table", times=TIMES, values=VALUES)],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1), integrator="exact"), [*NAMES, "mu"])
    slope, t = (1.0 - 0.2) / 0.5, 0.5 + 0.5 * 0.5 / 0.8
    assert found.times == pytest.approx([t])
    assert found.times_by_parameter[0] == pytest.approx([*(-hats(t) / slope), 1 / slope], abs=1e-10)
    # v(1) is the integral of u - mu from the release on
    after = areas(1.0) - areas(t)
    assert found.by_parameter[1] == pytest.approx([*after, -(1.0 - t)], abs=1e-10)


def test_values_that_are_not_there_are_refused() -> None:
    """An index beyond the table, and another name."""
    run = hs.simulate(driven("linear"), (0, 3))
    with pytest.raises(hs.UsageError, match=r"u has only 4 values, so u\[4\] does not exist"):
        hs.sensitivities(run, ["u[4]"])
    with pytest.raises(hs.UsageError, match=r"no parameter 'w\[0\]'"):
        hs.sensitivities(run, ["w[0]"])
    listed = r"hs.sensitivities accepts its values u\[0\] to u\[3\]"
    with pytest.raises(hs.UsageError, match=listed):
        hs.sensitivities(run, ["u[-1]"])
    with pytest.raises(hs.UsageError, match=listed):
        hs.fit(driven("linear"), {"t": TIMES, "x": VALUES}, {"u[1]": (0, 3)})
