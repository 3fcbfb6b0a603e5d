"""Lyapunov exponents against closed forms, the divergence of the flow, and published values."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


def lorenz() -> hs.Model:
    return hs.Model(
        "lorenz",
        parameters={"s": 10.0, "r": 28.0, "b": 8.0 / 3.0},
        states=(
            hs.State("x", 1.0, "s*(y - x)"),
            hs.State("y", 1.0, "x*(r - z) - y"),
            hs.State("z", 1.0, "x*y - b*z"),
        ),
    )


def oscillator(c: float, force: str = "0") -> hs.Model:
    return hs.Model(
        "oscillator",
        parameters={"c": c},
        states=(hs.State("x", 1.0, "v"), hs.State("v", 0.0, f"{force} - x - c*v")),
    )


def test_the_sum_is_the_divergence_and_the_largest_is_published() -> None:
    """J. C. Sprott, Chaos and Time-Series Analysis, Oxford 2003: 0.9056, 0, -14.5723."""
    found = hs.lyapunov_exponents(lorenz(), 300, transient=20)
    assert found.values.sum() == pytest.approx(-(10.0 + 1.0 + 8.0 / 3.0), rel=1e-7)
    assert np.all(np.abs(found.values - [0.9056, 0.0, -14.5723]) < 4.0 * found.errors)
    assert np.all(found.errors < 0.05)
    assert found.dimension == pytest.approx(2.062, abs=0.01)
    first = hs.lyapunov_exponents(lorenz(), 300, transient=20, count=1)
    assert first.values == pytest.approx(found.values[:1], abs=4.0 * found.errors[0])
    assert math.isnan(first.dimension)


@pytest.mark.parametrize("c", [3.0, 1000.0])
def test_linear_modes_far_apart(c: float) -> None:
    """With c = 1000, a part of the motion reduces one direction by e**-500 relative to the other."""
    found = hs.lyapunov_exponents(oscillator(c), 100)
    assert found.values == pytest.approx(np.sort(np.roots([1.0, c, 1.0]))[::-1], rel=1e-3)


def test_forcing_goes_on_from_part_to_part() -> None:
    """The sum of the exponents is the mean divergence of the flow, (t - 50)/50 - 0.2, over the true times."""
    model = hs.Model(
        "growing",
        states=(
            hs.State("x", 1.0, "v"),
            hs.State("v", 0.0, "-x - 0.2*v"),
            hs.State("y", 1.0, "(t - 50)*y/50"),
        ),
    )
    found = hs.lyapunov_exponents(model, 100, transient=1)
    assert found.values.sum() == pytest.approx((51.0**2 - 49.0**2) / 10000 - 0.2, abs=1e-6)


def test_a_map_at_the_ticks_of_a_clock() -> None:
    """x -> 1.9*x mod 1 doubles nearly: each tick multiplies a change by 1.9."""
    model = hs.Model(
        "map",
        states=(hs.State("x", 0.3, "0"),),
        schedules=(
            hs.Schedule("tick", start=1.0, period=1.0, reset={"x": "1.9*x - (1 if 1.9*x > 1 else 0)"}),
        ),
    )
    found = hs.lyapunov_exponents(model, 200, transient=5.25)
    assert found.values == pytest.approx([math.log(1.9)], rel=1e-9)


def test_each_impact_multiplies_areas_by_the_square_of_the_restitution() -> None:
    """The motion repeats after two periods of the force, so small errors do not add impacts or take some away."""
    model = hs.load("impact-oscillator").with_(reach=1.2, e=0.3)
    values = model.parameter_values()
    T = 2.0 * math.pi / values["omega"]
    found = hs.lyapunov_exponents(model, 120 * T, transient=40 * T)
    run = hs.simulate(model, (0, 160 * T))
    impacts = sum(event.guard == "stop" and event.t > 40 * T for event in run.events)
    expected = -2.0 * values["zeta"] + 2.0 * math.log(values["e"]) * impacts / (120 * T)
    assert impacts > 50 and found.values.sum() == pytest.approx(expected, abs=1e-6)


def test_stick_reduces_a_change_to_nothing() -> None:
    found = hs.lyapunov_exponents("belt", 400)
    assert abs(found.values[0]) < 4.0 * found.errors[0] and found.values[1] == -math.inf
    assert found.errors[0] < 0.05 and math.isnan(found.errors[1])


def test_what_decays_beside_a_block_that_sticks_is_not_lost() -> None:
    """A block sticks from t = 20 on, and loses one direction. Beside it y decays by exp(-3 t)."""
    model = hs.Model(
        "beside",
        states=(hs.State("x", 0.0, "v"), hs.State("v", 2.0, "-f"), hs.State("y", 1.0, "-3*y")),
        contacts=(hs.Contact("f", "v", 1.0, "coulomb", arguments={"mu": 0.1}),),
    )
    found = hs.lyapunov_exponents(model, 40, transient=2)
    assert found.values[:2] == pytest.approx([0.0, -3.0], abs=0.1) and found.values[2] == -math.inf


def test_a_motion_that_sticks_for_good_is_told() -> None:
    """The block stops at t = 10; a shift of its position then stays as it is, and the exponent is 0 +/- 0."""
    block = hs.Model(
        "block",
        states=(hs.State("x", 0.0, "v"), hs.State("v", 1.0, "-f")),
        contacts=(hs.Contact("f", "v", 1.0, "coulomb", arguments={"mu": 0.1}),),
    )
    found = hs.lyapunov_exponents(block, 100, transient=20)
    assert found.values[0] == found.errors[0] == 0.0
    (warning,) = found.warnings
    assert warning.startswith("f stays in mode stick from t = 20 to the end")
    assert f"warning: {warning}" in repr(found)
    late = hs.lyapunov_exponents(block, 40, transient=2).warnings
    assert 10.0 <= float(late[0].partition("t = ")[2].split()[0]) <= 10.4  # 40/200 of the motion is a part
    for moving in ("belt", "feeny-moon"):
        assert hs.lyapunov_exponents(moving, 100).warnings == ()


def test_progress_is_a_share_that_grows() -> None:
    shares: list[float] = []
    hs.lyapunov_exponents(oscillator(0.1), 20, progress=shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0 and len(shares) > 10


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration": 0.0}, "`duration` cannot be 0.0"),
        ({"duration": 1.0, "transient": 0.0}, "`transient` cannot be 0.0"),
        ({"duration": 1.0, "count": 3}, "`count` cannot be 3"),
        ({"duration": 1.0, "x_0": [1, 2]}, "x_0"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        hs.lyapunov_exponents(oscillator(0.1), **arguments)  # type: ignore[arg-type]  # what is refused


def test_what_has_no_exponents_is_named() -> None:
    with pytest.raises(hs.UsageError, match="Python functions"):
        hs.lyapunov_exponents(hs.Model("m", states={"x": 1.0}, flow=lambda t, x, p: (-x[0],)), 1.0)
    with pytest.raises(hs.UsageError, match=r"to_model\(\)"):
        hs.lyapunov_exponents(hs.chain_on_belt(2), 1.0)  # type: ignore[arg-type]  # what is refused
    ends = hs.Model(
        "ends",
        states=(hs.State("x", 1.0, "1"),),
        monitors=(hs.Monitor("far", "x - 3", action="terminate"),),
    )
    with pytest.raises(hs.SimulationError, match="ended early"):
        hs.lyapunov_exponents(ends, 10.0)
