"""Regularised runs beside the set-valued law: what is judged, how errors fall with v0, what is refused."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis import Series
from hybridsim.analysis.compare.regularised import as_set_valued, exponents, regularised_series
from hybridsim.errors import UsageError
from hybridsim.reference.trajectory import ExactEvent, Trajectory

PERIOD = 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
WIDTHS = (3e-4, 1e-4, 3e-5)


@cache
def comparison() -> hs.Comparison:
    return hs.compare(
        "dfcs", t_span=(0, 3 * PERIOD), integrators=["dop853"], regularized=["tanh", "karnopp"], v0=WIDTHS,
        repeat=1,
    )  # fmt: skip


def rows_of(label: str):
    return [row for row in comparison().rows if row.label == label]


def test_a_smooth_form_is_neither_right_nor_wrong_and_karnopps_is_right() -> None:
    assert comparison().labels == ("set-valued, dop853", "tanh, dop853", "karnopp, dop853")
    assert [row.errors.sequence for row in rows_of("tanh, dop853")] == [None] * 3
    assert not any(row.errors.wrong_modes for row in comparison().rows)
    assert all(row.errors.sequence.right for row in rows_of("karnopp, dop853"))
    assert {row.errors.event_time for row in rows_of("tanh, dop853")} == {None}
    lines = [line for line in comparison().table().splitlines() if line.startswith("  v0 ")]
    assert [line.rsplit(maxsplit=1)[-1] for line in lines] == ["none"] * 3 + ["right"] * 3


def test_errors_fall_as_the_forms_say() -> None:
    """tanh misses the limit of friction at the speed v by exp(-2 v/v0): error v0 times a logarithm of v0. Karnopp
    stops the body v0/a too early: an error v0 in the time and v0^2 in the position and, later, the velocity."""
    tanh, _ = exponents(comparison().rows)["tanh, dop853"]
    karnopp, _ = exponents(comparison().rows)["karnopp, dop853"]
    assert 0.85 < tanh < 1.0
    assert karnopp == pytest.approx(2.0, abs=0.05)
    times = [row.errors.event_time for row in rows_of("karnopp, dop853")]
    assert np.polyfit(np.log(WIDTHS), np.log(times), 1)[0] == pytest.approx(1.0, abs=0.02)


def test_an_explicit_method_works_harder_as_v0_falls() -> None:
    work = [row.cost.work for row in rows_of("tanh, dop853")]
    assert work[0] < work[1] < work[2]
    assert exponents(comparison().rows)["tanh, dop853"][1] < -0.3


def test_the_table_and_the_records_say_which_form() -> None:
    table = comparison().table()
    assert "tanh, dop853: error ~ v0^0.9" in table and "karnopp, dop853: error ~ v0^2.0" in table
    records = comparison().records()
    assert [record["regularized"] for record in records] == ["", *["tanh"] * 3, *["karnopp"] * 3]
    assert records[1]["missed_modes"] is None and records[4]["missed_modes"] == 0


def test_breaking_loose_is_slip() -> None:
    events = (
        ExactEvent(1.0, "f", "stick", "break+"),
        ExactEvent(1.1, "f", "break+", "slip+"),
        ExactEvent(1.5, "g", "off", "on"),
        ExactEvent(2.0, "f", "slip+", "stick"),
    )
    run = Trajectory(lambda t, side: t[None], (0.0, 3.0), events, {"f": "stick", "g": "off", "h": "smooth"})
    seen = as_set_valued(run, {"f", "h"})
    assert [(e.t, e.source, e.target) for e in seen.events] == [
        (1.0, "stick", "slip+"),
        (1.5, "off", "on"),
        (2.0, "slip+", "stick"),
    ]
    assert seen.initial_modes == {"f": "stick", "g": "off"}


def test_widths_unasked_are_fractions_of_the_velocity() -> None:
    lines = regularised_series(hs.load("dfcs"), ["tanh"])
    assert [line.label for line in lines] == [
        "set-valued, cvode-bdf",
        "set-valued, dop853",
        "tanh, cvode-bdf",
        "tanh, dop853",
    ]
    assert lines[2].values[0] == pytest.approx(1e-2) and lines[2].values[-1] == pytest.approx(1e-5)


@pytest.mark.parametrize(
    "model, keywords, message",
    [
        ("dfcs", {"v0": [1e-3]}, "`v0` requires `regularized`"),
        ("thermostat", {"regularized": "tanh"}, "no contact to regularise"),
        ("dfcs", {"regularized": "tanhh"}, "`regularized` cannot contain 'tanhh'"),
        ("dfcs", {"regularized": "tanh", "integrators": [("dop853", {})]}, "`integrators` cannot contain"),
    ],
)
def test_bad_requests(model: str, keywords: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        hs.compare(model, t_span=(0, 0.1), **keywords)


def test_v0_is_varied_along_a_form_only() -> None:
    with pytest.raises(UsageError, match="`varied` is 'v0', which does not fit"):
        Series("dop853", "v0", (1e-3,))
    with pytest.raises(UsageError, match="`varied` is 'rtol', which does not fit"):
        Series("dop853", "rtol", (1e-3,), regularized="tanh")


def test_a_form_that_a_law_does_not_have_is_a_row_that_says_so() -> None:
    result = hs.compare(
        "static-kinetic", t_span=(0, 1), integrators=["dop853"], regularized="tanh", v0=[1e-3], repeat=1
    )
    assert result.rows[-1].status == "refused" and "static friction" in result.rows[-1].message
