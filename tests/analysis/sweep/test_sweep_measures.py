"""Measures with a name are what `steady_state` and `simulate` give at each point."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

LOADS = [15.0, 22.0, 40.0]
WORDS = ("amplitude.x", "energy.x", "harmonic.x.1", "stick_fraction.f", "stops_per_period.f", "kind", "word")


def test_readings_are_those_of_the_steady_state() -> None:
    found = hs.sweep("dfcs", {"F0": LOADS}, WORDS)
    for k, load in enumerate(LOADS):
        steady = hs.steady_state("dfcs", params={"F0": load})
        assert found["amplitude.x"][k] == steady.amplitude["x"]
        assert found["energy.x"][k] == steady.energy["x"]
        assert found["harmonic.x.1"][k] == steady.harmonic("x", 1)
        assert found["stick_fraction.f"][k] == steady.stick_fraction["f"]
        assert found["word"][k] == " ".join(steady.word) and found["kind"][k] == steady.kind
    assert list(found.values) == list(WORDS)
    assert found.units == {"F0": "N", "amplitude.x": "m", "energy.x": "m² s", "harmonic.x.1": "m"}
    assert hs.sweep("dfcs", {"F0": [30.0]}, ["dissipated.f"]).units["dissipated.f"] == "J"


def test_warm_starts_find_the_same_orbits_by_any_number_of_workers() -> None:
    values = {"omega": np.linspace(400, 600, 5), "F0": [22.0, 30.0]}
    cold = hs.sweep("dfcs", values, ["amplitude.x", "kind"])
    warm = hs.sweep("dfcs", values, ["amplitude.x", "kind"], warm_start=True)
    assert warm["amplitude.x"] == pytest.approx(cold["amplitude.x"], rel=1e-10)
    with ThreadPoolExecutor(3) as threads:
        again = hs.sweep("dfcs", values, ["amplitude.x", "kind"], warm_start=True, executor=threads)
    assert again["amplitude.x"].tobytes() == warm["amplitude.x"].tobytes()


def test_what_does_not_repeat_says_its_kind() -> None:
    """Two frequencies without a common period, and a frequency that has one."""
    model = hs.Model(
        "two-tones",
        parameters={"w": 2.0},
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "sin(t) + sin(w*t) - x*4 - v")],
    )
    found = hs.sweep(model, {"w": ["sqrt(2)", 2]}, ["amplitude.x", "kind"])
    assert found["kind"].tolist() == ["quasi-periodic", "periodic"]
    assert found.status[0].startswith("quasi-periodic: ") and found.status[1] == "ok"
    assert math.isnan(found["amplitude.x"][0]) and found["amplitude.x"][1] > 0


def test_the_end_of_a_run() -> None:
    found = hs.sweep("dfcs", {"F0": LOADS}, "final", t_span=(0, 0.03))
    for k, load in enumerate(LOADS):
        run = hs.simulate("dfcs", (0, 0.03), params={"F0": load}, keep="nothing")
        assert [found["final.x"][k], found["final.v"][k]] == run.y[:, -1].tolist()
    chained = hs.sweep("dfcs", {"F0": [22.0, 22.0]}, "final.x", warm_start=True, t_span=(0, 0.03))
    once = hs.simulate("dfcs", (0, 0.03), params={"F0": 22.0})
    twice = hs.simulate("dfcs", (0, 0.03), params={"F0": 22.0}, x0=once.y[:, -1])
    assert chained["final.x"].tolist() == [once.y[0, -1], twice.y[0, -1]]


@pytest.mark.parametrize(
    "measure, options, message",
    [
        ("amplitude.y", {}, "did you mean 'amplitude.x'"),
        ("harmonic.x", {}, "did you mean 'harmonic.x.1'"),
        ("stick_fraction.x", {}, "no measure 'stick_fraction.x'"),
        ("final", {}, "needs `t_span`"),
        ("final.y", {"t_span": (0, 1)}, "no measure 'final.y'"),
        (["final.x", "period"], {"t_span": (0, 1)}, "no measure 'period' of a run"),
        ([], {}, r"`measure` cannot be \[\]"),
    ],
)
def test_what_does_not_exist(measure: object, options: dict[str, object], message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        hs.sweep("dfcs", {"F0": [30]}, measure, **options)


@pytest.mark.parametrize("measure", ["steady", "final", lambda model: 1.0])
def test_an_option_that_nothing_knows_is_refused_before_the_first_point(measure: Any) -> None:
    span = {"t_span": (0, 1)} if measure == "final" else {}
    with pytest.raises(UsageError, match="'rtoll' is not an option of"):
        hs.sweep("dfcs", {"F0": [20, 30]}, measure, rtoll=1e-8, **span)
    if not callable(measure):
        with pytest.raises(UsageError, match="no integrator 'dop835'"):
            hs.sweep("dfcs", {"F0": [20, 30]}, measure, integrator="dop835", **span)
        assert (
            hs.sweep("dfcs", {"F0": [20]}, measure, integrator="dop853", rtol=1e-8, **span).status[0] == "ok"
        )


def test_an_equilibrium_has_no_period_and_is_a_result_all_the_same() -> None:
    swept = hs.sweep("free-decay", {"k": [1.0, 4.0]}, ["kind", "period", "amplitude.x"])
    assert swept.status.tolist() == ["ok", "ok"]
    assert swept["kind"].tolist() == ["equilibrium", "equilibrium"]
    assert np.isnan(swept["period"]).all()
    assert swept["amplitude.x"].tolist() == [0.0, 0.0]
