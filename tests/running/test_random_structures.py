"""A few random structures with events against time stepping; `docs/studies/random_structures.py` runs hundreds."""

from __future__ import annotations

import numpy as np
import pytest
from reference.random_structures import END, structure
from reference.structure_judge import all_draws, distance, judged, run

import hybridsim as hs

SEED = 1


@pytest.mark.parametrize("number", [0, 2, 4, 9, 46, 111])  # the last two rub along their stops
def test_runs_end_as_they_should_and_agree_with_time_stepping(number: int) -> None:
    refused, verdicts = all_draws(structure(number, SEED), 3, SEED)
    assert not refused
    assert [v for v in verdicts if v.kind not in ("agrees", "sensitive")] == []


def test_the_judge_sees_a_run_of_other_numbers() -> None:
    s = structure(4, SEED)
    draw = s.draw(np.random.default_rng([SEED, 4, 0]))
    model = hs.Model.from_toml(s.toml)
    right = hs.simulate(model, (0.0, END), params=draw.params, x0=draw.start, integrator="dop853")
    assert judged(s, draw, right)[0] == "agrees"
    name = next(name for name in draw.params if name.endswith("_mk"))
    other = {**draw.params, name: 0.9 * draw.params[name]}
    wrong = hs.simulate(model, (0.0, END), params=other, x0=draw.start, integrator="dop853")
    assert judged(s, draw, wrong)[0] == "disagrees"
    assert not distance(s, draw, right, right)
    assert "apart by" in distance(s, draw, right, wrong)


@pytest.mark.parametrize(("number", "draw_number"), [pytest.param(138, 8, marks=pytest.mark.slow), (169, 20)])
def test_neighbours_without_a_motion_are_no_obstacle(number: int, draw_number: int) -> None:
    """A contact and a relay that would both hold one speed: their joint hold has no forces, and is not met."""
    s = structure(number, SEED)
    draw = s.draw(np.random.default_rng([SEED, number, draw_number]))
    model = hs.Model.from_toml(s.toml)
    sol = hs.simulate(model, (0.0, END), params=draw.params, x0=draw.start, integrator="exact")
    assert sol.status == "finished"
    assert judged(s, draw, sol)[0] == "agrees"


@pytest.mark.parametrize(("number", "draw_number", "integrator"), [(132, 47, "exact"), (114, 15, "dop853")])
def test_what_all_steppings_do_alike_is_no_error_of_ours(
    number: int, draw_number: int, integrator: str
) -> None:
    """An event 1.5e-5 before a sample, and one 1e-4 after the start: less than most steps."""
    s = structure(number, SEED)
    draw = s.draw(np.random.default_rng([SEED, number, draw_number]))
    assert judged(s, draw, run(hs.Model.from_toml(s.toml), draw, integrator))[0] == "agrees"


def test_friction_that_rises_only_near_rest_is_met_by_series() -> None:
    """Two integrators, of which one went through the rise of Stribeck's law in one step, and a monitor beside it."""
    s = structure(188, SEED)
    draw = s.draw(np.random.default_rng([SEED, 188, 41]))
    model = hs.Model.from_toml(s.toml)
    assert not distance(s, draw, run(model, draw, "taylor"), run(model, draw, "dop853"))


@pytest.mark.parametrize("rtol", [1e-8, 1e-9, 1e-10])
def test_a_relay_that_a_stick_holds_still_leaves_with_it(rtol: float) -> None:
    """The relay's function stays at zero to rounding while the body sticks, and no step crosses it at the release."""
    s = structure(177, SEED)
    draw = s.draw(np.random.default_rng([SEED, 177, 30]))
    model = hs.Model.from_toml(s.toml)
    sol = hs.simulate(model, (0.0, END), params=draw.params, x0=draw.start, integrator="dop853", rtol=rtol)
    assert sol.status == "finished"
    assert judged(s, draw, sol)[0] == "agrees"


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
@pytest.mark.parametrize(("number", "draw_number"), [(67, 32), (67, 42), (75, 40), (144, 34)])
def test_a_slide_whose_speed_dies_out_goes_on(number: int, draw_number: int, integrator: str) -> None:
    """Friction sees a speed that falls below rounding and never turns around."""
    s = structure(number, SEED)
    draw = s.draw(np.random.default_rng([SEED, number, draw_number]))
    sol = run(hs.Model.from_toml(s.toml), draw, integrator)
    assert sol.status == "finished"
    assert judged(s, draw, sol)[0] == "agrees"
