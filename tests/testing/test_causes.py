"""Each class once: a method fails in a scene, and is right in it when the cause that the page gives is removed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hybridsim.integrators.registry import registered
from hybridsim.testing import SCENES, Scene, Truth
from hybridsim.testing.atlas.cooldown import CooldownRK45
from hybridsim.testing.study import LOCATED, NOT_LOCATED, Setting, carry_out
from hybridsim.testing.verdict import HANG, RIGHT, WRONG_ANSWER, WRONG_SEQUENCE, verdict

BY_NAME = {scene.name: scene for scene in SCENES}


def found(scene: Scene, integrator: str, tolerance: float, **options: Any) -> str:
    """The verdict on one run."""
    study = carry_out(integrator, scene, (Setting("once", options, tolerance, 1.0),), (tolerance, tolerance))
    return verdict(study)[0]


def test_events_a_start_on_the_surface() -> None:
    """solve_ivp's test of signs fires at a zero at the start, and does not where the start is off the surface."""
    scene = BY_NAME["box-from-the-side"]
    assert found(scene, "scipy-rk45", 1e-8, events="native", rtol=1e-9) == WRONG_SEQUENCE
    off = replace(scene, start={"x": 1.25}, truth=Truth((), ((2.0, (2.25,)),)))
    assert found(off, "scipy-rk45", 1e-8, events="native", rtol=1e-9) == RIGHT


def test_events_two_zeros_in_one_step() -> None:
    """Signs at step ends miss two of three zeros, and none where the steps are short."""
    scene = BY_NAME["SCI-cubic"]
    assert found(scene, "scipy-rk45", 1e-8, events="native", rtol=1e-9) == WRONG_SEQUENCE
    assert found(scene, "scipy-rk45", 1e-8, events="native", rtol=1e-9, max_step=0.3) == RIGHT


def test_events_a_restart_that_is_blind_for_a_while() -> None:
    """A cooldown hides the short stop of 8 ms; one that is shorter than the stop does not."""
    scene = BY_NAME["FEENY"]
    with registered(CooldownRK45) as name:
        assert found(scene, name, 1e-5, rtol=1e-9, cooldown=0.05) == WRONG_ANSWER
        assert found(scene, name, 1e-5, rtol=1e-9, cooldown=5e-4) == RIGHT


def test_stick_an_interval_as_wide_as_the_motion() -> None:
    """The published eps_v makes it stick where nothing sticks; in units of the motion's speed it does not."""
    scene = BY_NAME["small-speeds"]
    settings = {"steps_per_period": 4800, "period": scene.unit}
    assert found(scene, "rk4-dichotomy", 1e-3, **settings) == WRONG_SEQUENCE
    assert found(scene, "rk4-dichotomy", 1e-3, **settings, eps_v=8e-4 * scene.speed) == RIGHT


def test_stick_a_slip_that_ends_within_a_step() -> None:
    """SciPy compares signs at step ends and misses a slip of a hundredth of a period; short steps do not."""
    scene = BY_NAME["micro-slip"]
    assert found(scene, "scipy-rk45", 1e-5, rtol=1e-8, events="native") == WRONG_SEQUENCE
    assert found(scene, "scipy-rk45", 1e-5, rtol=1e-8, events="native", max_step=0.02) == RIGHT
    assert found(scene, "cvode-bdf", 1e-5, rtol=1e-8) == RIGHT


def test_sliding_a_band_that_steps_overshoot() -> None:
    """A step as wide as the band is late at each switching by a part of it; steps inside of the band are not."""
    scene = BY_NAME["relay-chatter"]
    assert found(scene, "rk4-sign", NOT_LOCATED, step=1 / 300) == WRONG_ANSWER
    assert found(scene, "rk4-sign", NOT_LOCATED, step=1e-5) == RIGHT


def test_accumulation_without_a_rule_of_rest() -> None:
    """LSODA's hops fall below its resolution and it ends as if all were well; with a rule of rest there are eleven."""
    endless, ruled = BY_NAME["ball-accumulation"], BY_NAME["FMI-ball"]
    assert found(endless, "scipy-lsoda", 1e-6, rtol=1e-9) == WRONG_ANSWER
    assert found(ruled, "scipy-lsoda", 1e-6, rtol=1e-9) == RIGHT


def test_stiffness_the_width_of_the_regularisation() -> None:
    """Explicit steps beyond their limit of stability are wrong at a width of 1e-6 and right at 1e-3."""
    narrow, wide = BY_NAME["TANH-1e-6"], BY_NAME["TANH-1e-3"]
    assert found(narrow, "rk4-sign", LOCATED, step=1e-4) == WRONG_ANSWER
    assert found(wide, "rk4-sign", LOCATED, step=1e-4) == RIGHT


def test_stability_a_step_beyond_the_limit() -> None:
    """RK4 is stable to 2.785 divided by the rate, and not beyond."""
    scene = BY_NAME["step-limit"]
    assert found(scene, "rk4-sign", LOCATED, step=2.9e-4) != RIGHT
    assert found(scene, "rk4-sign", LOCATED, step=2.7e-4) == RIGHT


def test_stability_a_load_that_creeps() -> None:
    """Under half of the limit tanh creeps with 0.55 v0: the error after 100 s is that, and falls with v0."""
    scene = BY_NAME["resting-load"]
    free = replace(scene, truth=Truth(None, scene.truth.states))
    assert found(free, "rk4-sign", 1e-3, form="tanh", v0=1e-2, step=1e-3) == WRONG_ANSWER
    assert found(free, "rk4-sign", 1e-3, form="tanh", v0=1e-6, step=1e-6, limits={"steps": 1}) == HANG
    short = replace(free, span=(0.0, 1.0), truth=Truth(None, scene.truth.states[:1]))
    assert found(short, "rk4-sign", 1e-3, form="tanh", v0=1e-4, step=1e-4) == RIGHT


def test_sensitivity_the_digits_that_growth_leaves() -> None:
    """In chaos a loose tolerance loses the sequence of events before the end, and not in the first quarter."""
    scene = BY_NAME["FEENY"]
    assert found(scene, "dop853", 1e-3, rtol=1e-3) != RIGHT
    early = replace(scene, span=(0.0, 10.0), truth=Truth(None, scene.truth.states[:2]))
    assert found(early, "dop853", 1e-2, rtol=1e-3) == RIGHT
    assert found(scene, "dop853", 1e-3, rtol=1e-9) == RIGHT
