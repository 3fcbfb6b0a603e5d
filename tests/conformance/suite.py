"""Holds an integrator against the scenes: `conformance_failures(name)` returns what it got wrong.

A scene is judged as its facts ask: events are counted and their modes compared at every setting; the largest
errors of event times and states must fall with the tolerance, tenfold or more for each step of a thousand, unless
they are below the tolerance asked for or below the scene's floor; at the tightest setting they must be within the
scene's own tolerance. A fixed-step method is judged in the same way over steps of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import hybridsim as hs
from conformance import judge
from conformance.catalogue import SCENES
from conformance.scene import Scene
from hybridsim.errors import HybridsimError

# Fixed-step study: steps for each unit of time, and the zero-velocity interval in units of the scene's speed. The
# finest setting is asked for no more than a fourth-order method with that interval can give.
STEPS = (300, 1200, 4800)
INTERVALS = (1e-5, 1e-7, 1e-9)
FIXED_STEP_TOLERANCE = 1e-5
FIXED_STEP_FLOOR = 1e-8
FALL = 10.0  # least fall of an error for a tolerance a thousand times tighter; any method of order 2 does better
FIXED_STEP_FALL = 2.0  # least fall for a step a fourth as long; first order gives 4


@dataclass(frozen=True)
class Outcome:
    """Verdict on one integrator in one scene: right, wrong (with reasons) or lacks (with the reason)."""

    integrator: str
    scene: str
    verdict: str
    reasons: tuple[str, ...] = ()
    errors: tuple[tuple[str, float, float], ...] = ()  # setting, error of times, error of states


@dataclass(frozen=True)
class Setting:
    """One run of a study: its options, and the errors that need no excuse at it."""

    text: str
    options: Mapping[str, Any]
    excused: float
    fall: float


def integrator(name: str) -> Any:
    """The registered integrator of that name."""
    return next(one for one in hs.list_integrators() if one.name == name)


def study(one: Any, scene: Scene) -> tuple[Setting, ...]:
    """The settings at which a scene is run, from loose to tight."""
    if "adaptive" not in one.lacks:
        return tuple(
            Setting(f"rtol {rtol:.0e}", {"rtol": rtol}, max(rtol, scene.floor), FALL) for rtol in scene.tolerances
        )
    known = {field.name for field in fields(one)}
    settings = []
    for steps, interval in zip(STEPS, INTERVALS, strict=True):
        options: dict[str, Any] = {"max_step": scene.unit / steps}
        if "steps_per_period" in known:
            options = {"steps_per_period": steps, "period": scene.unit}
        if "eps_v" in known:
            options |= {"eps_v": interval * scene.speed, "max_bisections": 60}
        excused = max(scene.floor, FIXED_STEP_FLOOR)
        settings.append(Setting(f"unit/{steps}", options, excused, FIXED_STEP_FALL))
    return tuple(settings)


def outcome(name: str, scene: Scene) -> Outcome:
    """Run one scene with one integrator at all settings and judge it."""
    one = integrator(name)
    for capability in sorted(scene.needs):
        if capability in one.lacks:
            return Outcome(name, scene.name, "lacks", (f"{capability}: {one.lacks[capability]}",))
    wrong: list[str] = []
    errors: list[tuple[str, float, float]] = []
    settings = study(one, scene)
    for setting in settings:
        try:
            measured = judge.measure(scene, judge.run(scene, name, **setting.options), one.lacks)
        except HybridsimError as error:
            wrong.append(f"{setting.text}: refused: {error}")
            continue
        wrong += [f"{setting.text}: {sentence}" for sentence in measured.wrong]
        if not measured.wrong:
            errors.append((setting.text, measured.time_error, measured.state_error))
    if not wrong:
        wrong = judge_errors(scene, settings, errors, "adaptive" in one.lacks)
    return Outcome(name, scene.name, "wrong" if wrong else "right", tuple(wrong), tuple(errors))


def judge_errors(
    scene: Scene, settings: tuple[Setting, ...], errors: list[tuple[str, float, float]], fixed_step: bool
) -> list[str]:
    """Errors fall from setting to setting and end within the scene's tolerance."""
    wrong = []
    for column, what, tolerance in ((1, "event times", scene.tol_t), (2, "states", scene.tol_x)):
        values = [row[column] for row in errors]
        for before, value, setting in zip(values, values[1:], settings[1:], strict=False):
            if not (value <= setting.excused or value * setting.fall <= before):
                wrong.append(f"{setting.text}: error of {what} {value:.2g}, at the setting before {before:.2g}")
        allowed = max(tolerance, FIXED_STEP_TOLERANCE) if fixed_step else tolerance
        if values and not values[-1] <= allowed:
            wrong.append(f"{settings[-1].text}: error of {what} {values[-1]:.2g} is above {allowed:.2g}")
    return wrong


def conformance_failures(name: str, scenes: Iterable[Scene] = SCENES) -> list[str]:
    """What an integrator got wrong, one sentence each; empty if nothing. What it lacks is no failure."""
    outcomes = [outcome(name, scene) for scene in scenes]
    return [f"{one.scene}: {reason}" for one in outcomes if one.verdict == "wrong" for reason in one.reasons]
