"""Labels and ticks of physical quantities."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from hybridsim.plot.scale import Scaled, label_axis


@pytest.mark.parametrize(
    "unit, low, high, label",
    [
        ("m", -4e-4, 4e-4, "x [µm]"),
        ("m/s", 0, 0.2, "x [mm/s]"),
        ("N", -20, 20, "x [N]"),
        ("N", 0, 25e3, "x [kN]"),
        ("s", 0, 1e-3, "x [ms]"),
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
