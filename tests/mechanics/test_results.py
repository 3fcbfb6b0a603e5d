"""Results of mechanical systems in tables, and what they leave to ordinary models."""

from __future__ import annotations

import copy
import pickle
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
def test_every_run_gives_the_one_class(kind: str) -> None:
    """All attributes of the runs of models are there, and those of mechanical systems are there for models."""
    sol, model = run(kind), as_model()
    assert type(sol) is type(model) is hs.Solution
    assert (sol.t_events, sol.y_events, sol.corners, sol.chosen_because) == ([], [], (), "")
    assert [part.name for part in sol.components] == list(sol.modes)
    assert kind in repr(sol) and kind in sol._repr_html_()
    np.testing.assert_allclose(model.x_end, model.y[:, -1], rtol=0.0)
    assert set(sol.quantities) <= {*model.quantities}
    contact = sol.events[0].component
    assert abs(sol.event_times(contact)[0] - model.event_times(contact)[0]) < 0.02  # two steps of moreau
    for side, other in (("-", "x_minus"), ("+", "x_plus")):
        states = np.array([getattr(e, other) for e in sol.events if e.component == contact])
        assert (sol.event_states(contact, side=side) == states).all()
    for name in (*sol.names, *sol.quantities):
        assert (sol.output(name) == sol.table().columns[name]).all()


def test_former_names_warn_and_are_still_types_of_their_runs() -> None:
    for name, kind in (("MechanicalSolution", "taylor"), ("SteppedSolution", "moreau")):
        with pytest.warns(DeprecationWarning, match=r"Use hybridsim\.Solution"):
            former = getattr(hs, name)
        assert [isinstance(run(each), former) for each in KINDS] == [each == kind for each in KINDS]
        assert not isinstance(as_model(), former)
        assert issubclass(former, hs.Solution) and name not in dir(hs)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("call", ["explain", "save", "resume"])
def test_what_it_has_not_says_what_to_do_instead(kind: str, call: str, tmp_path: Path) -> None:
    arguments = {"explain": (0,), "save": (tmp_path / "run.hsol",), "resume": ()}[call]
    with pytest.raises(hs.UsageError, match="two-blocks is a MechanicalSystem") as caught:
        getattr(run(kind), call)(*arguments)
    assert all(part in str(caught.value) for part in ("to_model()", "to_npz()", "x0=sol.x_end"))


def test_what_was_not_measured_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match="no nfev: only a run of a Model"):
        _ = run("taylor").nfev
    with pytest.raises(AttributeError, match="no work: only a run of a MechanicalSystem"):
        _ = as_model().work
    assert run("moreau").work["friction"] < 0.0 and as_model().nfev > 0


@pytest.mark.parametrize("picture", [plot.phase_portrait, plot.friction_loop])
def test_pictures_are_refused_with_a_way_to_one(picture: Any) -> None:
    with pytest.raises(hs.UsageError, match=r"Solution of two-blocks") as caught:
        picture(run("taylor"))
    assert "to_model()" in str(caught.value)


def test_the_way_that_is_named_leads_there() -> None:
    assert as_model().explain(0).reason


@pytest.mark.parametrize("way", [pickle.dumps, copy.copy, copy.deepcopy])
def test_a_run_by_series_is_not_copied_without_its_padding(way: Any) -> None:
    with pytest.raises(hs.UsageError, match="cannot be pickled or copied") as caught:
        way(run("taylor")._trajectory)
    assert "to_model()" in str(caught.value)
    with pytest.raises(hs.UsageError, match="cannot be pickled or copied"):
        pickle.dumps(run("taylor"))
    assert (pickle.loads(pickle.dumps(run("moreau"))).y == run("moreau").y).all()
