"""Results of mechanical systems in tables, and what they leave to ordinary models."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import plot

KINDS: dict[str, dict[str, Any]] = {"taylor": {}, "moreau": {"integrator": "moreau", "step": 0.01}}


@cache
def run(kind: str) -> Any:
    return hs.simulate(hs.two_blocks_on_belt(), (0.0, 5.0), **KINDS[kind])


@cache
def as_model() -> hs.Solution:
    return hs.simulate(hs.two_blocks_on_belt().to_model(), (0.0, 5.0), integrator="scipy-dop853", rtol=1e-11)


def test_a_table_is_that_of_the_same_system_as_a_model() -> None:
    found, expected = run("taylor").table(201), as_model().table(201)
    assert set(found.columns) >= {*run("taylor").names, *found.modes}
    for name in found.columns.keys() & expected.columns.keys():
        np.testing.assert_allclose(found.columns[name], expected.columns[name], atol=1e-7, err_msg=name)
    for contact in found.modes:
        assert (found.mode_names(contact) == expected.mode_names(contact)).all()


def test_an_event_stands_twice_with_the_modes_of_both_sides() -> None:
    sol = run("taylor")
    table, event = sol.table(), sol.events[0]
    first, second = np.flatnonzero(table.t == event.t)
    assert table.mode_names(event.component)[[first, second]].tolist() == [event.source, event.target]
    states = np.array([table.columns[name] for name in sol.names])
    assert (states == sol.y).all()
    assert (states[:, first] == event.x_minus).all() and (states[:, second] == event.x_plus).all()


@pytest.mark.parametrize("kind", KINDS)
def test_forms_of_a_table(kind: str, tmp_path: Path) -> None:
    sol = run(kind)
    sol.to_csv(tmp_path / "run.csv", points=11)
    head, *rows = (tmp_path / "run.csv").read_text().splitlines()
    assert head.split(",")[:5] == ["t", *sol.names] and len(rows) == 11
    assert np.array(rows[4].split(",")[1:5], dtype=float).tolist() == sol(2.0).tolist()
    sol.to_npz(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as stored:
        assert (stored["t"] == sol.t).all() and len(stored["events/t"]) == len(sol.events)
    frame = sol.to_pandas()
    assert (frame[sol.names[0]].to_numpy() == sol.y[0]).all()
    assert sol.to_xarray(5).sizes["t"] == 5
    assert len(sol.events_to_pandas()) == len(sol.events)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("explain", "to_model"),
        ("save", "to_npz"),
        ("resume", "x_end"),
        ("nfev", "to_model"),
        ("corners", "laws"),
    ],
)
def test_what_it_has_not_says_what_to_do_instead(kind: str, name: str, remedy: str) -> None:
    with pytest.raises(AttributeError, match=f"Solution has no {name}: .*{remedy}"):
        getattr(run(kind), name)
    assert not hasattr(run(kind), name)


@pytest.mark.parametrize("kind", KINDS)
def test_what_nothing_has_is_an_ordinary_error(kind: str) -> None:
    with pytest.raises(AttributeError, match=r"has no 'xplain'$"):
        _ = run(kind).xplain


@pytest.mark.parametrize("picture", [plot.time_history, plot.phase_portrait, plot.friction_loop])
def test_pictures_are_refused_with_a_way_to_one(picture: Any) -> None:
    with pytest.raises(hs.UsageError, match=r"MechanicalSolution of two-blocks") as caught:
        picture(run("taylor"))
    assert "to_model()" in str(caught.value)


def test_the_way_that_is_named_leads_there() -> None:
    assert as_model().explain(0).reason
