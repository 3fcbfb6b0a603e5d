"""Texts of units are read as powers of base units with a scale; the values are those of the SI brochure."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from hybridsim.model.units.parse import read_unit, write_unit
from hybridsim.model.units.unit import ONE, Unit


def unit(scale: float = 1.0, **powers: float | Fraction) -> Unit:
    """A unit by its powers, which a test writes down from the definition of the unit."""
    return Unit(tuple(sorted((name, Fraction(power)) for name, power in powers.items())), scale)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1", ONE),
        ("m", unit(m=1)),
        ("mm", unit(1e-3, m=1)),
        ("µm", unit(1e-6, m=1)),
        ("\u03bcm", unit(1e-6, m=1)),
        ("min", unit(60, s=1)),
        ("ms", unit(1e-3, s=1)),
        ("g", unit(1e-3, kg=1)),
        ("N", unit(kg=1, m=1, s=-2)),
        ("kN", unit(1e3, kg=1, m=1, s=-2)),
        ("N s/m", unit(kg=1, s=-1)),
        ("N*s/m", unit(kg=1, s=-1)),
        ("N·s/m", unit(kg=1, s=-1)),
        ("N/(m s)", unit(kg=1, s=-3)),
        ("m/s/s", unit(m=1, s=-2)),
        ("m/s^2", unit(m=1, s=-2)),
        ("m/s**2", unit(m=1, s=-2)),
        ("m/s²", unit(m=1, s=-2)),
        ("m s-2", unit(m=1, s=-2)),
        ("m s⁻²", unit(m=1, s=-2)),
        ("kg m2", unit(kg=1, m=2)),
        ("m^(1/2)", unit(m=Fraction(1, 2))),
        ("m^0.7", unit(m=Fraction(7, 10))),
        ("Nm", unit(kg=1, m=2, s=-2)),
        ("kNm/rad", unit(1e3, kg=1, m=2, s=-2, rad=-1)),
        ("kWh", unit(3.6e6, kg=1, m=2, s=-2)),
        ("ms^2", unit(1e-6, s=2)),
        ("MPa", unit(1e6, kg=1, m=-1, s=-2)),
        ("J/(kg K)", unit(m=2, s=-2, K=-1)),
        ("ohm", unit(kg=1, m=2, s=-3, A=-2)),
        ("\u2126", unit(kg=1, m=2, s=-3, A=-2)),
        ("H", unit(kg=1, m=2, s=-2, A=-2)),
        ("F", unit(kg=-1, m=-2, s=4, A=2)),
        ("deg", unit(math.pi / 180, rad=1)),
        ("rpm", unit(1 / 60, turn=1, s=-1)),
        ("Hz", unit(turn=1, s=-1)),
        ("%", unit(1e-2)),
        ("degC", unit(K=1)),
        ("1/s", unit(s=-1)),
        ("10^3 N", unit(1e3, kg=1, m=1, s=-2)),
        ("lbf/in^2", read_unit("psi")),
    ],
)
def test_a_text_is_a_unit(text: str, expected: Unit) -> None:
    found = read_unit(text)
    assert found is not None and found.powers == expected.powers
    assert found.scale == pytest.approx(expected.scale, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "sec",
        "J/kg K",
        "ms^-1",
        "ms-2",
        "C",
        "J/(kg C)",
        "-",
        "N/m s",
        "m^",
        "(m",
        "m)",
        "/s",
        "m/",
        "m m^^2",
        "€",
        "m + s",
        "0 m",
        "widgets",
        "m^1e999999999",
        "m^1e-99999999",
        "(" * 5000 + "m" + ")" * 5000,
        "1e999 m",
    ],
)
def test_a_text_that_is_not_a_known_unit_is_unknown(text: str) -> None:
    assert read_unit(text) is None


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        ("mm", "m", "scale"),
        ("m", "s", "dimension"),
        ("rpm", "rad/s", "scale"),
        ("Hz", "rad/s", "scale"),
        ("Hz", "rpm", "scale"),
        ("deg", "rad", "scale"),
        ("deg", "1", "scale"),
        ("%", "1", "scale"),
        ("Hz", "1/s", ""),
        ("rad/s", "1/s", ""),
        ("N m/rad", "N m", ""),
        ("MPa", "N/mm^2", ""),
        ("N m", "J", ""),
        ("kg m/s^2", "N", ""),
        ("V A", "W", ""),
        ("degC", "K", ""),
    ],
)
def test_units_differ_in_dimension_or_in_scale(first: str, second: str, difference: str) -> None:
    one, other = read_unit(first), read_unit(second)
    assert one is not None and other is not None
    assert one.differs(other) == other.differs(one) == difference


@pytest.mark.parametrize(
    "text", ["N s/m", "mm", "kN", "rad/s", "rpm", "Hz", "deg", "N m/rad", "kg m^3/s", "1", "m^(1/2)", "A/K"]
)
def test_a_unit_is_written_so_that_it_reads_back(text: str) -> None:
    found = read_unit(text)
    assert found is not None and write_unit(found) == text and read_unit(write_unit(found)) == found


def test_a_unit_is_written_as_the_model_writes_it() -> None:
    found = read_unit("kg m^2/s^2")
    assert found is not None
    assert write_unit(found) == "N m" and write_unit(found, ["J"]) == "J"
