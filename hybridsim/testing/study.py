"""Study of a test case with an integrator: runs with decreasing tolerances, each compared with the truth."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import hybridsim as hs
from hybridsim.errors import HybridsimError
from hybridsim.integrators.contract import Integrator
from hybridsim.testing import measuring
from hybridsim.testing.clock import Endless, bounded_work
from hybridsim.testing.scene import Scene

# Fixed-step study: steps per unit of time, and the zero-velocity interval in units of the scene's speed.
STEPS = (300, 1200, 4800)
INTERVALS = (1e-5, 1e-7, 1e-9)
FINER = 16  # factor on the number of steps for a first-order method
# Largest errors at the finest step: of a fourth-order method that locates events, and of a method that places events
# at the ends of steps.
LOCATED, NOT_LOCATED = 1e-5, 2 / STEPS[-1]
FIXED_STEP_FLOOR = 1e-7  # the published 16 halvings of a step of unit/300 leave 5e-8 units
# Required decrease of an error for a tolerance that is 1000 times tighter (a method of order 2 exceeds it), and for a
# step of a quarter of the length (first order gives 4).
FALL, FIXED_STEP_FALL = 10.0, 2.0
LAST_RESORT = 1e-13  # for a method of low order whose error at 1e-12 is still above the scene's tolerance
# Allowed error, in units of rtol, of a study that ends early. A low-order method has an error of 10 to 100 times its
# tolerance per period, and in a lightly damped motion tens of periods add up.
CUT_SHORT = 1000.0
# Factor on the tolerances of methods of order 3 in long scenes, where 1e-9 would need 100 000 steps, and the length in
# units of time of a long scene.
LOW_ORDER, LONG = 100.0, 50.0
# Options whose value gives a method a capability: option -> (value, capability).
LIFTED = {"stick_velocity": ("zero", "exact-stick")}
# A stopped run with more than this factor times the steps of the previous setting, whose tolerance was 1000 times
# looser, counts as endless. A method of order 2 needs a factor of 32.
RUNAWAY = 100
LONGEST = 60  # seconds of processor time per run of a scene; the longest run takes ten on a slow machine


@dataclass(frozen=True)
class Setting:
    """One run of a study: its options, the error regarded as zero, and the required decrease of the error."""

    text: str
    options: Mapping[str, Any]
    excused: float
    fall: float


@dataclass(frozen=True)
class Study:
    """The runs of one test case with one integrator.

    Parameters
    ----------
    done : the completed settings with their measurements.
    tolerances : allowed errors of event times and states at the last setting.
    failure : the setting that failed and its exception, or None.
    """

    done: tuple[tuple[Setting, measuring.Measured], ...]
    tolerances: tuple[float, float]
    failure: tuple[str, Exception] | None = None

    def faults(self) -> list[str]:
        """Return all errors as sentences; slow convergence is reported only if there is no other error."""
        wrong = [f"{setting.text}: {sentence}" for setting, run in self.done for sentence in run.wrong]
        if self.failure is not None:
            text, error = self.failure
            how = "refused: " if isinstance(error, HybridsimError) else f"raised {type(error).__name__}: "
            wrong.append(f"{text}: {'' if isinstance(error, Endless) else how}{error}")
        return wrong or error_faults(self.done, self.tolerances)

    def errors(self) -> tuple[tuple[str, float, float], ...]:
        """Return the setting, the error of event times and the error of states of each run."""
        return tuple((setting.text, run.time_error, run.state_error) for setting, run in self.done)


def integrator(name: str) -> type[Integrator]:
    """Return the class of a registered integrator."""
    return next(one for one in hs.list_integrators() if one.name == name)


def option_names(one: Any) -> set[str]:
    """Return the names of an integrator's options, the fields of its dataclass."""
    return {field.name for field in fields(one)}


def lacking(one: type[Integrator]) -> dict[str, str]:
    """Return the limitations of an integrator that the options of its study do not remove."""
    lifted = {capability for option, (_, capability) in LIFTED.items() if option in option_names(one)}
    return {capability: reason for capability, reason in one.lacks.items() if capability not in lifted}


def settings_for(one: type[Integrator], scene: Scene) -> tuple[Setting, ...]:
    """Return the settings for a test case, from loose to tight."""
    if "adaptive" not in one.lacks:
        is_long = abs(scene.span[1] - scene.span[0]) > LONG * scene.unit
        factor = LOW_ORDER if one.order == "3(2)" and is_long else 1.0
        return tuple(adaptive(factor * rtol, scene) for rtol in scene.tolerances)
    known = option_names(one)
    fixed: dict[str, Any] = {option: value for option, (value, _) in LIFTED.items() if option in known}
    fixed |= {"release": "located"} if "release" in known else {}
    settings = []
    for steps, interval in zip(STEPS, INTERVALS, strict=True):
        steps *= FINER if one.order == "1" else 1
        options: dict[str, Any] = {"max_step": scene.unit / steps}
        if "steps_per_period" in known:
            options = {"steps_per_period": steps, "period": scene.unit}
        if "eps_v" in known:
            options |= {"eps_v": interval * scene.speed, "max_bisections": 60}
        settings.append(fixed_step(steps, {**fixed, **options}, scene))
    return tuple(settings)


def adaptive(rtol: float, scene: Scene) -> Setting:
    """Return the setting for one tolerance."""
    return Setting(f"rtol {rtol:.0e}", {"rtol": rtol}, max(rtol, scene.floor), FALL)


def fixed_step(steps: float, options: Mapping[str, Any], scene: Scene) -> Setting:
    """Return the setting for one fixed step size."""
    return Setting(f"unit/{steps:g}", options, max(scene.floor, FIXED_STEP_FLOOR), FIXED_STEP_FALL)


def allowed_errors(one: type[Integrator], scene: Scene) -> tuple[float, float]:
    """Return the errors of event times and states that are allowed at the tightest setting."""
    if "adaptive" not in one.lacks:
        return scene.tol_t, scene.tol_x
    least = LOCATED if "release" in option_names(one) else NOT_LOCATED
    return max(scene.tol_t, least), max(scene.tol_x, least)


def carry_out(
    name: str,
    scene: Scene,
    settings: tuple[Setting, ...],
    tolerances: tuple[float, float],
    lacks: Container[str] = (),
    seconds: float = LONGEST,
    **options: Any,
) -> Study:
    """Run a test case at all useful settings; `seconds` limits the processor time of each run."""
    done: list[tuple[Setting, measuring.Measured]] = []
    waiting = list(settings)
    while waiting:
        setting = waiting.pop(0)
        try:
            measuring.prepare(scene, name, **setting.options, **options)
            with bounded_work(seconds):
                run = measuring.run(scene, name, **setting.options, **options)
                measured = measuring.measure(scene, run, lacks)
        except Exception as error:  # a user would see the same exception
            return Study(tuple(done), tolerances, (setting.text, error))
        if measured.status == "limit" and done and measured.steps < RUNAWAY * done[-1][1].steps:
            tolerances = cut_short(tolerances, done[-1][0])
            break  # the run is too long, but not endless
        done.append((setting, measured))
        if "rtol" not in setting.options or "cooldown" in setting.options:
            continue
        if waiting and measured.steps > scene.effort:
            tolerances = cut_short(tolerances, setting)
            break
        is_last = not waiting and setting.options["rtol"] != LAST_RESORT
        if is_last and not any(run.wrong for _, run in done) and not within(measured, tolerances):
            waiting.append(replace(adaptive(LAST_RESORT, scene), fall=1.0))
    return Study(tuple(done), tolerances)


def cut_short(tolerances: tuple[float, float], last: Setting) -> tuple[float, float]:
    """Return the allowed errors of a study that ends early, at the given setting."""
    allowed = CUT_SHORT * last.options.get("rtol", 0.0)
    return max(tolerances[0], allowed), max(tolerances[1], allowed)


def within(measured: measuring.Measured, tolerances: tuple[float, float]) -> bool:
    """Return whether the errors of times and of states are both within their tolerances."""
    return measured.time_error <= tolerances[0] and measured.state_error <= tolerances[1]


def error_faults(
    done: tuple[tuple[Setting, measuring.Measured], ...], tolerances: tuple[float, float]
) -> list[str]:
    """Check that the errors decrease from setting to setting and end within the tolerances."""
    wrong = []
    for what, attribute, tolerance in zip(
        ("event times", "states"), ("time_error", "state_error"), tolerances, strict=True
    ):
        errors = [(setting, float(getattr(measured, attribute))) for setting, measured in done]
        for (before, larger), (setting, error) in pairwise(errors):
            if error > setting.excused and error * setting.fall > max(larger, before.excused):
                wrong.append(
                    f"{setting.text}: the error of {what} is {error:.2g}, after {larger:.2g} at the setting before"
                )
        if errors and not errors[-1][1] <= tolerance:
            wrong.append(
                f"{errors[-1][0].text}: the error of {what} is {errors[-1][1]:.2g}, above the {tolerance:.2g} allowed"
            )
    return wrong
