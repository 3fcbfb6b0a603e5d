"""The unit of a contact force is that of its load: coefficients have none."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hybridsim as hs
from hybridsim.model.checks.units import time_unit, unit_of_work, units_of


@pytest.mark.parametrize(
    ("normal", "unit"),
    [
        ("N", "N"),
        ("2*N/r", "N"),
        ("N + N*sin(t)", "N"),
        ("max(N - load, 0)", "N"),
        ("load", "N"),
        ("k*x", ""),  # N/m times m: nothing is multiplied here
        ("N/x", ""),
        ("3", ""),
        ("0.25*N", "N"),
        ("9.81*m", ""),  # the number has a unit that is not said
        ("10*(2*m)", ""),
        ("weight/2", ""),
        ("N - 9.81*m", "N"),
    ],
)
def test_of_a_contact_force(normal: str, unit: str) -> None:
    model = hs.Model(
        "press",
        [hs.State("x", 1, "v", unit="m"), hs.State("v", 0, "-x - f", unit="m/s")],
        [
            hs.Parameter("N", 40, "N"),
            hs.Parameter("r", 2, "1"),
            hs.Parameter("k", 1, "N/m"),
            hs.Parameter("mu", 0.5),
            hs.Parameter("m", 1, "kg"),
        ],
        contacts=[hs.Contact("f", "v", normal, "coulomb", {"mu": "mu"})],
        definitions={"load": "0.5*N", "weight": "9.81*m"},
    )
    assert units_of(model)["f"] == unit


def test_it_stands_in_tables_and_readings() -> None:
    model = replace(hs.load("dfcs"), outputs=())  # which declare a unit of their own
    assert units_of(model)["f"] == "N"
    assert hs.simulate(model, (0, 0.01)).table().units["f"] == "N"
    # a load that is a number leaves the unit to the coefficient
    assert units_of(hs.load("lugre-presliding"))["f"] == "N"


@pytest.mark.parametrize(
    ("force", "velocity", "unit"),
    [
        ("N", "m/s", "J"),
        ("N", "mm/s", "mJ"),
        ("kN", "m/s", "kJ"),
        ("N m", "rad/s", "J"),  # an angle has no dimension
        ("N m", "1/s", "J"),
        ("N", "m/h", ""),  # the unit of t is unknown
        ("", "m/s", ""),
        ("N", "", ""),
        ("grip", "m/s", ""),
    ],
)
def test_the_unit_of_work_is_that_of_force_times_distance(force: str, velocity: str, unit: str) -> None:
    states = [hs.State("x", 0, "v"), hs.State("v", 1, "-f", unit=velocity)]
    parameters = [hs.Parameter("N", 1, unit=force), hs.Parameter("mu", 0.5)]
    model = hs.Model("pad", states, parameters, contacts=[hs.Contact("f", "v", "N", "coulomb", {"mu": "mu"})])
    if velocity == "m/h":
        model = replace(model, parameters=(*model.parameters, hs.Parameter("wait", 1, unit="min")))
    assert unit_of_work(model, model.contacts[0]) == unit


@pytest.mark.parametrize(
    ("units", "time"),
    [(["m/s", "h"], "s"), (["K", "h"], "h"), (["1/min"], "min"), (["h", "min"], ""), (["m", "ohm"], "")],
)
def test_the_unit_of_time_is_known_from_the_other_units(units: list[str], time: str) -> None:
    parameters = [hs.Parameter(f"p{k}", 1.0, unit=unit) for k, unit in enumerate(units)]
    assert time_unit(hs.Model("timed", [hs.State("x", 0, "0")], parameters=parameters)) == time
