"""Labels and ticks of physical quantities."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from hybridsim.plot.shared.scale import Scaled, label_axis, shared_powers
from hybridsim.plot.shared.symbols import label_of, symbol_of, unit_text


@pytest.mark.parametrize(
    "unit, low, high, label",
    [
        ("m", -4e-4, 4e-4, "x [µm]"),
        ("m/s", 0, 0.2, "x [mm/s]"),
        ("N", -20, 20, "x [N]"),
        ("N", 0, 25e3, "x [kN]"),
        ("s", 0, 1e-3, "x [ms]"),
        ("rad", 0, 2e-3, "x [mrad]"),
        ("rad/s", 0, 1400, "x [rad/s]"),  # krad is unusual
        ("rad/s", 0, 14000, "x [$10^{3}$ rad/s]"),
        ("kg", 0, 20, "x [kg]"),
        ("kg", 0, 2e-5, "x [$10^{-6}$ kg]"),
        ("", 0, 1, "x"),
        ("", 0, 0.3, "x"),
        ("", 0, 3e-5, "x [$10^{-6}$]"),
        ("", 0, 5e6, "x [$10^{6}$]"),
        ("$", 0, 1, r"x [\$]"),
        ("m", 0, 0, "x [m]"),
        ("mm", 0, 5e-3, "x [mm]"),
    ],
)
def test_label(unit: str, low: float, high: float, label: str) -> None:
    axis = Figure().subplots().xaxis
    label_axis(axis, "x", unit, low, high)
    assert axis.get_label_text() == label


def test_ticks_have_the_decimals_they_need() -> None:
    assert Scaled(1e-3).format_ticks([0, 0.0005, 0.001]) == ["0.0", "0.5", "1.0"]
    assert Scaled(1.0).format_ticks([1.4300, 1.4325, 1.4350]) == ["1.4300", "1.4325", "1.4350"]
    assert Scaled(1e-6).format_ticks([-4e-4, 0, 4e-4]) == ["\N{MINUS SIGN}400", "0", "400"]
    assert Scaled(1.0).format_ticks([]) == []


@pytest.mark.parametrize(
    "quantities, powers",
    [
        ({"x": ("m", -4e-4, 4e-4), "v": ("m/s", 0, 0.2), "f": ("N", -20, 20)}, {"x": -3, "v": -3}),
        ({"x1": ("m", 0, 0.5), "x2": ("m", 0, 1.0)}, {"x1": 0, "x2": 0}),
        ({"x": ("m", 0, 1.0), "z": ("m", 0, 1e-6)}, {}),  # six digits apart: one prefix suits none of both
        ({"x": ("m", 0, 0), "v": ("m/s", 0, 1)}, {}),
        ({"w1": ("rad/s", 0, 1400), "w2": ("rad/s", 0, 900)}, {"w1": 0, "w2": 0}),
    ],
)
def test_quantities_of_one_base_unit_share_a_prefix(quantities: dict, powers: dict) -> None:
    assert {name: p for name, p in shared_powers(quantities).items() if name in powers} == powers
    assert set(shared_powers(quantities)) == set(powers)


@pytest.mark.parametrize(
    "name, symbol",
    [
        ("theta", "θ"), ("x", "x"), ("x1", r"x$_{\mathregular{1}}$"), ("w_bit", r"w$_{\mathregular{bit}}$"),
        ("omega_0", r"ω$_{\mathregular{0}}$"), ("v_rel_2", r"v$_{\mathregular{rel,2}}$"),
        ("twist", "twist"), ("stick_fraction", "stick_fraction"), ("left.x", "left.x"),
    ],
)  # fmt: skip
def test_symbols(name: str, symbol: str) -> None:
    assert symbol_of(name) == symbol


def test_quantities_of_two_parts_with_one_title_have_different_labels() -> None:
    assert label_of("left.x", "displacement") == ("displacement", "left.x")
    assert label_of("right.x", "displacement") == ("displacement", "right.x")


def test_a_title_replaces_a_name_that_is_no_symbol() -> None:
    assert label_of("torque", "torque on the bit") == ("torque on the bit", "")
    assert label_of("theta", "angle") == ("angle", "θ")
    assert label_of("torque", "") == ("", "torque")


@pytest.mark.parametrize(
    "unit, text",
    [
        ("m/s^2", "m/s²"),
        ("us", "µs"),
        ("N m", "N m"),
        ("m*s**-1", "m·s⁻¹"),
        ("degC", "°C"),
        ("rad/s", "rad/s"),
    ],
)
def test_units_have_raised_exponents(unit: str, text: str) -> None:
    assert unit_text(unit) == text


def test_a_vertical_title_has_no_last_line_of_one_letter() -> None:
    axes = Figure().subplots()
    label_axis(axes.yaxis, "stops per period of f", "", 0, 2, title="stops per period of f")
    assert axes.get_ylabel().strip() == "stops per period\nof f"
    label_axis(axes.yaxis, "amplitude of x", "", 0, 2, title="amplitude of x")
    assert axes.get_ylabel().strip() == "amplitude of x"
