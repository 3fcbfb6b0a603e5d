"""Tables whose values are parameters of the law, against closed forms."""

from __future__ import annotations

from math import exp, log
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs

AT = (0.0, 1.0, 3.0)


def sliding(values: list[float | str], interpolation: str = "linear", **parameters: float) -> hs.Model:
    """A block slows down from the speed 2, dv/dt = -mu(v); the names are those that a text could confuse."""
    table = hs.LawTable("mu", AT, values, interpolation=interpolation)
    law = hs.FrictionLaw(
        "measured", parameters=dict.fromkeys(parameters), slip="mu*N", stick="mu*N", tables=(table,)
    )
    return hs.Model(
        "block",
        parameters=parameters,
        states=(hs.State("x", 0.0, "v"), hs.State("v", 2.0, "-f")),
        contacts=(hs.Contact("f", "v", 1.0, law, {name: name for name in parameters}),),
    )


def speed(t: float, first: float, second: float, third: float) -> float:
    """The speed by hand: mu is linear in v between the points, so v - v0 is an exponential in each piece."""
    slope, mu0 = (third - second) / 2.0, second + (third - second) / 2.0  # at v = 2
    reached = log(mu0 / second) / slope  # when v = 1
    if t <= reached:
        return 2.0 - mu0 * (1.0 - exp(-slope * t)) / slope
    slope = second - first
    return max(1.0 - second * (1.0 - exp(-slope * (t - reached))) / slope, 0.0)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p"])
def test_the_motion_is_that_of_the_numbers(integrator: str) -> None:
    model = sliding(["a", "0.5*value_1", "v_3"], a=0.6, value_1=0.8, v_3=0.3)
    run = hs.simulate(model, (0, 10), integrator=integrator, rtol=1e-11)
    for t in (0.5, 2.0, 4.0, 9.0):
        assert run(t)[1] == pytest.approx(speed(t, 0.6, 0.4, 0.3), abs=1e-9)
    again = model.with_(a=0.5)
    assert hs.simulate(again, (0, 4), rtol=1e-11)(4.0)[1] == pytest.approx(
        speed(4.0, 0.5, 0.4, 0.3), abs=1e-9
    )


def test_derivatives_by_the_values() -> None:
    run = hs.simulate(sliding(["a", "b", "c"], a=0.6, b=0.4, c=0.3), (0, 4), rtol=1e-12)
    found = hs.sensitivities(run, ["a", "b", "c"]).by_parameter[1]
    h = 1e-5
    for k in range(3):
        up, down = ([0.6, 0.4, 0.3] for _ in range(2))
        up[k], down[k] = up[k] + h, down[k] - h
        assert found[k] == pytest.approx((speed(4.0, *up) - speed(4.0, *down)) / (2 * h), abs=1e-8)


def test_a_fit_finds_the_values() -> None:
    t = np.linspace(0.0, 4.5, 40)
    record = {"t": t, "v": np.array([speed(each, 0.6, 0.4, 0.3) for each in t])}
    found = hs.fit(sliding(["a", "b", "c"], a=0.45, b=0.45, c=0.45), record, dict.fromkeys("abc", (0.1, 1.0)))
    assert [found.values[name] for name in "abc"] == pytest.approx([0.6, 0.4, 0.3], abs=1e-6)


def test_it_is_written_and_read(tmp_path: Path) -> None:
    model = sliding(["a", "2*b", 0.3], a=0.6, b=0.2)
    assert hs.Model.from_toml(model.to_toml()) == model
    (tmp_path / "m.toml").write_text(model.to_toml())
    assert hs.load(tmp_path / "m.toml") == model


def test_numbers_as_texts_are_numbers() -> None:
    assert hs.LawTable("mu", AT, ["1/2", 0.4, "0.3"], interpolation="cubic").values == (0.5, 0.4, 0.3)


def test_what_cannot_be_is_named() -> None:
    with pytest.raises(hs.UsageError, match="`values` contains a, but cubic interpolation needs numbers"):
        sliding(["a", 0.4, 0.3], "cubic", a=0.6)
    with pytest.raises(hs.ModelError, match="law measured, table mu, values: unknown name 'zeta'"):
        sliding(["a", "zeta", 0.3], a=0.6).validate()
    with pytest.raises(hs.ModelError, match="law measured, table mu, values: 'v' cannot be used here"):
        sliding(["a", "v", 0.3], a=0.6).validate()
    with pytest.raises(hs.ModelError, match=r"the slip force at v = 1 cannot be -0\.4"):
        sliding(["a", "b", 0.3], a=0.6, b=-0.4).validate()
    with pytest.raises(hs.UsageError, match="table mu has the value a, which depends on parameters"):
        hs.LawTable("mu", AT, ["a", 0.4, 0.3], interpolation="linear").value(1.0)
    with pytest.raises(hs.ExpressionError, match="LawTable mu, values: invalid expression"):
        sliding(["a +", 0.4, 0.3], a=0.6)


def test_its_picture_has_the_points() -> None:
    law = sliding(["a", "b", 0.3], a=0.6, b=0.4).contacts[0].law
    (axes,) = hs.plot.friction_law(law, {"a": 0.6, "b": 0.4}, speed=3.0)
    (points,) = [line for line in axes.get_lines() if line.get_label() == "points of the table"]
    assert list(points.get_ydata()) == pytest.approx([0.6, 0.4, 0.3])
