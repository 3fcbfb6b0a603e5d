"""Requests that no memory holds are refused by their size, before anything is laid out."""

from __future__ import annotations

import itertools
import math
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.cli import main

DECAY = hs.Model("decay", parameters={"k": 1.0}, states=[hs.State("x", 1.0, "-k*x")])


def refused(ask: Callable[[], object], words: str) -> None:
    """It is a UsageError, and takes less than 50 MB."""
    tracemalloc.start()
    try:
        with pytest.raises(hs.UsageError, match=words):
            ask()
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "values",
    [
        {"k": range(10**10)},
        {"k": range(10**30)},
        {"k": np.broadcast_to(1.0, (10**10,))},
        {"k": range(10**5), "x": range(10**5)},
    ],
)
def test_a_sweep_of_too_many_points(values: dict) -> None:
    refused(lambda: hs.sweep(DECAY, values, "final.x", t_span=(0, 1)), "more than 33554432 points")


def test_values_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    from hybridsim.analysis.sweep import axes

    monkeypatch.setattr(axes, "MOST_POINTS", 1000)
    refused(
        lambda: hs.sweep(DECAY, {"k": itertools.count(1)}, "final.x", t_span=(0, 1)), "more than 1000 points"
    )


@pytest.mark.parametrize("end", [math.inf, -math.inf, math.nan])
def test_a_resume_without_end(end: float) -> None:
    sol = hs.simulate(DECAY, (0, 1), integrator="dop853")
    refused(lambda: sol.resume(end), "`t_end` cannot be ")


@pytest.mark.parametrize("points", [10**10, 10**400])
def test_a_table_of_too_many_points(points: int, tmp_path: object) -> None:
    sol = hs.simulate(DECAY, (0, 1), integrator="dop853")
    refused(lambda: sol.table(points), "`points` cannot be 1000")
    refused(lambda: sol.to_csv(f"{tmp_path}/r.csv", points), "`points` cannot be 1000")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["sweep", "dfcs", "F0=1:2:10000000000"], "in several sweeps"),
        (["sweep", "dfcs", "F0=1:2:" + "9" * 5000], "in several sweeps"),
        (["sweep", "dfcs", "F0=1:2:100000", "N=1:2:100000"], "more than 33554432 points"),
        (["run", "dfcs", "--csv", "r.csv", "--points", "10000000000"], "use at most"),
        (["run", "dfcs", "--csv", "r.csv", "--points", "9" * 5000], "whole number"),
    ],
)
def test_the_command_line(
    words: list[str],
    told: str,
    tmp_path: object,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(str(tmp_path))
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert told in err and not out and "internal" not in err


@pytest.mark.parametrize("count", [10**7, 10**12, 10**400], ids=["1e7", "1e12", "huge"])
@pytest.mark.parametrize(
    ("name", "ask"),
    [
        ("settle", lambda n: hs.bifurcation("dfcs", "F0", [20.0], settle=n)),
        ("samples", lambda n: hs.bifurcation("dfcs", "F0", [20.0], samples=n)),
        ("workers", lambda n: hs.bifurcation("dfcs", "F0", [20.0], workers=n)),
        ("workers", lambda n: hs.sweep(DECAY, {"k": [1.0]}, "final.x", t_span=(0, 1), workers=n)),
        ("max_points", lambda n: hs.continuation("dfcs", "F0", (20.0, 40.0), max_points=n)),
        ("repeat", lambda n: hs.compare(DECAY, (0, 1), repeat=n)),
        ("repeat", lambda n: hs.compare_suite(repeat=n)),
        ("steps", lambda n: hs.compare(DECAY, (0, 1), steps=[1000 * n])),
    ],
)
def test_counts_that_no_time_suffices_for(name: str, ask: Callable[[int], object], count: int) -> None:
    refused(
        lambda: ask(count),
        f"`{name}` cannot be 1000.*\n.*use a whole number from 1 to 1000000(000)?",
    )


@pytest.mark.parametrize(
    ("integrator", "option"),
    [
        *(
            ("rk4-dichotomy", name)
            for name in ("step", "period", "steps_per_period", "eps_v", "max_bisections")
        ),
        ("rk4-sign", "steps_per_period"),
        ("moreau", "steps_per_period"),
        ("moreau", "iterations"),
    ],
)
def test_options_of_integrators_that_are_no_doubles(integrator: str, option: str) -> None:
    refused(
        lambda: hs.simulate("dfcs", (0, 0.01), integrator=integrator, **{option: 10**400}),
        f"{integrator}: `{option}` cannot be 1000(.*\n.*)use a ",
    )
