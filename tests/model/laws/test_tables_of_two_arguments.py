"""Friction laws with a table of two arguments: stops and releases by routes that share no code with the package."""

from __future__ import annotations

from math import isnan, log, nan
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybridsim as hs
from hybridsim.plot.friction_law import slip_force

SPEEDS, HEATS = (0.0, 1.0, 3.0), (20.0, 80.0)
VALUES = ((0.5, 0.3), (0.4, 0.25), (0.35, 0.2))
LOAD = 10.0


def pad(**changed: object) -> hs.FrictionLaw:
    given = {"at": SPEEDS, "values": VALUES, "across": "T", "across_at": HEATS, "interpolation": "linear"}
    return hs.FrictionLaw(
        "pad", "mu*N", "mu*N", parameters=["T"], tables=[hs.LawTable("mu", **(given | changed))]
    )


def brake(heating: float, start: float, push: str = "0", v: float = 4.0) -> hs.Model:
    """A body of mass 1 whose friction depends on its speed and on a temperature that rises steadily."""
    return hs.Model(
        "brake",
        states=[
            hs.State("x", 0, "v", nominal=1),
            hs.State("v", v, f"{push} - f", nominal=1),
            hs.State("T", start, heating, nominal=10),
        ],
        contacts=[hs.Contact("f", "v", LOAD, pad(), {"T": "T"})],
    )


def coefficient(v: float, heat: float) -> float:
    """The bilinear value, by NumPy's interpolation in one argument after the other."""
    rows = [np.interp(heat, HEATS, row) for row in VALUES]
    return float(np.interp(v, SPEEDS, rows))


def stop_by_pieces(heating: float, start: float) -> tuple[float, float]:
    """Time and place of the stop by SciPy, restarted at each line of the grid."""
    t, y, heats = 0.0, np.array([0.0, 4.0]), [(heat - start) / heating for heat in HEATS]
    for _ in range(20):
        events = [lambda t, y, level=level: y[1] - level for level in SPEEDS]
        for event, level in zip(events, SPEEDS, strict=True):
            event.terminal = abs(y[1] - level) > 1e-9
        end = min((one for one in heats if one > t + 1e-12), default=5.0)
        run = solve_ivp(
            lambda t, y: [y[1], -LOAD * coefficient(y[1], start + heating * t)],
            (t, end),
            y,
            "DOP853",
            events=events,
            rtol=1e-12,
            atol=1e-14,
        )
        t, y = run.t[-1], run.y[:, -1]
        if abs(y[1]) < 1e-9:
            return t, y[0]
    raise AssertionError("it did not stop")


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "rodas5p", "scipy-radau"])
def test_a_stop_while_the_pad_gets_hot(integrator: str) -> None:
    t, x = stop_by_pieces(30.0, 10.0)
    sol = hs.simulate(brake(30.0, 10.0), (0, 3), integrator=integrator, rtol=1e-10)
    assert sol.success, sol.message
    assert [(e.source, e.target) for e in sol.events] == [("slip+", "stick")]
    assert sol.events[0].t == pytest.approx(t, rel=1e-8)
    assert sol.x_end[0] == pytest.approx(x, rel=1e-8)
    # the lines of the grid: T = 20 and 80 at known times, v = 3 and 1 on the way
    times = [c.t for c in sol.corners]  # v = 3, T = 20, v = 1, T = 80
    assert len(times) == 4 and times[1::2] == pytest.approx([1 / 3, 7 / 3], rel=1e-12)


def test_exact_at_a_constant_temperature() -> None:
    """At T = 50 the table is 0.4, 0.325, 0.275 at the speeds 0, 1, 3, and the force is linear between them."""
    forces, t, v = (4.0, 3.25, 2.75), 0.0, 4.0
    t += (v - 3.0) / 2.75
    for low, high, f_low, f_high in ((1.0, 3.0, forces[1], forces[2]), (0.0, 1.0, forces[0], forces[1])):
        slope = (f_high - f_low) / (high - low)
        t += log(f_high / f_low) / slope  # the integral of dv/f over the piece
    model = hs.Model(
        "warm",
        states=[hs.State("v", 4.0, "-f", nominal=1)],
        contacts=[hs.Contact("f", "v", LOAD, pad(), {"T": 50})],
    )
    sol = hs.simulate(model, (0, 3), integrator="exact")
    assert sol.events[0].t == pytest.approx(t, rel=1e-12)


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_the_limit_at_rest_follows_the_second_argument(integrator: str) -> None:
    """A push of 4 is held until mu(0, T) = 0.4, at T = 50."""
    sol = hs.simulate(brake(30.0, 10.0, push="4", v=0.0), (0, 2), integrator=integrator, rtol=1e-10)
    assert [(e.source, e.target) for e in sol.events] == [("stick", "slip+")]
    assert sol.events[0].t == pytest.approx(40.0 / 30.0, rel=1e-12)


def test_the_file_holds_it(tmp_path: Path) -> None:
    path = tmp_path / "brake.toml"
    path.write_text(brake(30.0, 10.0).to_toml(), encoding="utf-8")
    again = hs.load(path)
    assert again.contacts[0].law.tables == pad().tables
    text = path.read_text(encoding="utf-8").replace('across = "T"', "")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(hs.ModelError, match="'values' contains"):
        hs.load(path)


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"interpolation": "cubic"}, "`across` cannot be combined with cubic interpolation"),
        ({"across_at": (80.0, 20.0)}, "`across_at` is not ascending: 20 follows 80"),
        ({"across_at": (20.0, 50.0, 80.0)}, "`across_at` has 3 numbers, but a row of `values` has 2"),
        ({"values": ((0.5, 0.3), (0.4, 0.25))}, "`at` has 3 numbers, but `values` has 2"),
        ({"values": (0.5, 0.4, 0.35)}, "but a row of `values` has 1"),
        ({"across_at": ()}, "0 points in `across_at`"),
    ],
)
def test_what_is_not_a_grid(changed: dict[str, object], message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        pad(**changed)


def test_pictures_show_the_arguments_of_tables() -> None:
    table = hs.LawTable("mu", [0, 1, 3], [0.5, 0.4, 0.3], over="2*v", interpolation="linear")
    one = hs.FrictionLaw("scaled", "mu*N", "0.5*N", tables=[table])
    assert slip_force(hs.Contact("f", "v", 1, one), 0.5) == pytest.approx(0.4)
    assert slip_force(hs.Contact("f", "v", 1, pad(), {"T": 50}), 2.0) == pytest.approx(0.3)


def test_a_negative_coefficient_is_named() -> None:
    law = pad(values=((0.5, 0.3), (0.4, -0.25), (0.35, 0.2)))
    model = hs.Model(
        "wrong",
        states=[hs.State("v", 4.0, "-f")],
        contacts=[hs.Contact("f", "v", LOAD, law, {"T": "20 + 0*v"})],
    )
    with pytest.raises(hs.ModelError, match=r"the slip force at v = 1, T = 80 cannot be -2\.5"):
        model.validate()


def test_the_value_of_a_table_of_two_arguments_needs_both() -> None:
    """Without the second argument, the value at 0 was returned."""
    table = hs.LawTable(
        "mu", [0, 1], [[0.5, 0.3], [0.4, 0.2]], interpolation="linear", across="T", across_at=[20, 80]
    )
    assert table.value(0.5, 50.0) == pytest.approx(0.35, abs=1e-15)
    with pytest.raises(hs.UsageError, match="table mu has two arguments, but `across` is missing"):
        table.value(0.5)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_value_at_nan_is_nan(interpolation: str) -> None:
    """A number that is missing has no value."""
    table = hs.LawTable("mu", [0, 1, 3], [0.5, 0.4, 0.4], interpolation=interpolation)
    assert isnan(table.value(nan))
