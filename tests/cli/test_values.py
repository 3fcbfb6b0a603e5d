"""How long a run goes where nobody says."""

from __future__ import annotations

import math

import hybridsim as hs
from hybridsim.cli.values import DEFAULT_SECONDS, end_time


def driven_by(**signal: object) -> hs.Model:
    return hs.Model("m", [hs.State("x", 0, "u")], inputs=[hs.Input("u", **signal)])


def test_a_run_goes_on_for_periods_else_to_the_end_of_a_record() -> None:
    assert end_time(hs.load("dfcs"), None, 3) == 3 * 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
    assert end_time(hs.load("base-isolation"), None) == 20.0
    assert end_time(driven_by(kind="chirp", f0=1, f1=2, duration=3.5), None) == 3.5
    assert end_time(driven_by(kind="table", times=(-2, -1), values=(0, 1)), None) == DEFAULT_SECONDS
    assert end_time(hs.Model("m", [hs.State("x", 0, "1")]), None) == DEFAULT_SECONDS
    assert end_time(hs.load("bouncing-ball"), None) == hs.load("bouncing-ball").duration_value() == 3.0
