"""A table that is delayed by an expression of parameters: the rear axle meets the road later than the front axle."""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from known_slopes import check

import hybridsim as hs
from hybridsim.cli.values import end_time
from hybridsim.model.units.faults import unit_faults
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

TIMES, VALUES = (0.0, 1.0, 1.0, 2.5, 3.0), (0.0, 2.0, -1.0, 0.5, 0.25)  # a jump at 1
ROAD = f"""[parameters]
L = {{ value = 2.5, unit = "m" }}
speed = {{ value = 4, unit = "m/s" }}
[inputs.front]
kind = "table"
times = {list(TIMES)}
values = {list(VALUES)}
[elements]
rear = {{ kind = "delay", input = "front", time = "L/speed" }}
[states]
x = {{ start = 0, der = "front" }}
y = {{ start = 0, der = "rear" }}
"""


def integral(t: float) -> float:
    """The integral of the table from 0 to t, by the trapezoidal rule on its linear pieces."""
    if t <= 0.0:
        return VALUES[0] * t
    total = 0.0
    for a, b, u, w in zip(TIMES, TIMES[1:], VALUES, VALUES[1:]):
        end = min(b, t)
        if a < end:
            total += (end - a) * (u + (u + (w - u) * (end - a) / (b - a))) / 2
    return total + VALUES[-1] * max(t - TIMES[-1], 0.0)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p", "cvode-bdf", "scipy-radau"])
@pytest.mark.parametrize("speed", [4.0, 0.7])
def test_the_integral_of_a_delayed_table(integrator: str, speed: float) -> None:
    model, delay = hs.Model.from_toml(ROAD).with_(speed=speed), 2.5 / speed
    sol = hs.simulate(model, (0, 8), integrator=integrator, rtol=1e-10)
    for t in (0.3, delay + 0.5, delay + 1.0, delay + 2.0, 7.5):
        x, y = sol(t)
        assert x == pytest.approx(integral(t), abs=1e-8)
        assert y == pytest.approx(integral(t - delay), abs=1e-8)
    before, after = (sol.output("rear", delay + 1.0, side=side) for side in "-+")
    assert (before, after) == pytest.approx((2.0, -1.0))


def test_the_delayed_table_is_the_table_at_an_earlier_time() -> None:
    sol = hs.simulate(hs.Model.from_toml(ROAD), (0, 6))
    t = np.random.default_rng(1).uniform(0.625, 6, 200)
    assert sol.output("rear", t) == pytest.approx(sol.output("front", t - 0.625), abs=1e-12)


def test_a_cubic_table_and_a_second_delay_in_multiple_precision() -> None:
    text = ROAD.replace("times = [0.0, 1.0, 1.0,", "times = [0.0, 1.0, 1.5,").replace(
        "[elements]", 'interpolation = "cubic"\nphase = "0.1*speed"\n[elements]'
    )
    model = hs.Model.from_toml(text)
    truth = multiple_precision_trajectory(model, (0, 5))
    sol = hs.simulate(model, (0, 5), rtol=1e-12)
    t = np.random.default_rng(2).uniform(1.025, 5, 50)
    assert sol.output("rear", t) == pytest.approx(sol.output("front", t - 0.625), abs=1e-12)
    assert [float(value) for value in truth.states.state(5)] == pytest.approx(sol(5.0).tolist(), rel=1e-11)


def test_derivatives_by_the_parameters_of_a_delay() -> None:
    """y = V(t - d) - V(-d) with the integral V of the table and d = L/speed."""
    values = {"L": 2.5, "speed": 4.0}

    def u(t: mp.mpf) -> mp.mpf:
        return 2 * t if 0 <= t < 1 else mp.mpf(0) if t < 0 else -1 + (t - 1)

    def v(t: mp.mpf) -> mp.mpf:
        return mp.mpf(0) if t < 0 else t**2 if t < 1 else 1 - (t - 1) + (t - 1) ** 2 / 2

    def y(t: mp.mpf, L: mp.mpf, speed: mp.mpf) -> mp.mpf:
        return v(t - L / speed) - v(-L / speed)

    def rear(t: mp.mpf, L: mp.mpf, speed: mp.mpf) -> mp.mpf:
        return u(t - L / speed)

    sol = hs.simulate(hs.Model.from_toml(ROAD), (0, 3), integrator="exact")
    check(sol, {"y": y, "rear": rear}, values, [0.5, 1.2, 2.0, 3.0])


def test_a_value_of_a_delayed_table_has_a_derivative() -> None:
    """The value at t = 0 acts on y from the delay to one later, with the weight 1 - s."""
    sol = hs.simulate(hs.Model.from_toml(ROAD), (0, 3), integrator="exact")
    found = hs.sensitivities(sol, ["front[0]"]).at(1.125, "y").by_parameter
    assert np.ravel(found) == pytest.approx([0.0], abs=1e-12)  # only `rear` is in y
    inputs = (hs.Input("u", "table", times=[0, 1], values=[3, 1], phase="d"),)
    model = hs.Model("m", [hs.State("y", 0, "u")], {"d": 0.5}, inputs=inputs)
    found = (
        hs.sensitivities(hs.simulate(model, (0, 1), integrator="exact"), ["u[0]"]).at(1.0, "y").by_parameter
    )
    assert np.ravel(found) == pytest.approx([0.5 + 0.5 - 0.125])


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ("L/x", "the delay 'L/x' depends on 'x', which is not a parameter"),
        ("0.1*t", "the delay '0.1*t' depends on 't', which is not a parameter"),
        ("L/velocity", "the delay 'L/velocity' depends on 'velocity', which is not a parameter"),
    ],
)
def test_a_delay_that_changes_during_a_run_is_refused(time: str, message: str) -> None:
    with pytest.raises(hs.ModelError, match="element rear") as caught:
        hs.Model.from_toml(ROAD.replace("L/speed", time), path="car.toml")
    assert message in caught.value.message and "a delay cannot change during a run" in str(
        caught.value.remedy
    )
    assert caught.value.place is not None and caught.value.place.line == 9


def test_a_delayed_table_is_written_and_used_in_parts(tmp_path: Path) -> None:
    model = hs.Model.from_toml(ROAD)
    assert hs.Model.from_toml(model.to_toml()) == model
    (tmp_path / "axle.toml").write_text(ROAD)
    (tmp_path / "car.toml").write_text('[use]\na = { model = "axle.toml", parameters = { speed = 8 } }\n')
    car = hs.load(tmp_path / "car.toml")
    assert hs.simulate(car, (0, 4))(4.0)[1] == pytest.approx(integral(4 - 2.5 / 8))


def test_the_default_end_of_a_run_contains_the_delayed_table() -> None:
    assert end_time(hs.Model.from_toml(ROAD), None) == 3.625


def test_the_unit_of_a_delay_is_a_time() -> None:
    assert not [*unit_faults(hs.Model.from_toml(ROAD))]
    (caution,) = unit_faults(hs.Model.from_toml(ROAD.replace('unit = "m" }', 'unit = "mm" }')))
    assert caution.message == "input rear, phase: 'L/speed' is in ms, but t is in s"
