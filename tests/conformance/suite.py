"""Holds an integrator against the scenes: `conformance_failures(name)` returns what it got wrong.

A scene is judged as its facts ask. Events are counted and their modes compared at every setting. The largest
errors of event times and of states fall with the tolerance, tenfold or more for each step of a thousand, where
an error below the tolerance asked for counts as that tolerance; at the end of the study they are within the
scene's own tolerance. A fixed-step method is judged in the same way over steps of its own.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import pairwise
from types import FrameType
from typing import Any

import hybridsim as hs
from conformance import judge
from conformance.catalogue import SCENES
from conformance.scene import Scene
from hybridsim.engine.recent import system_of
from hybridsim.errors import HybridsimError

# Fixed-step study: steps for each unit of time, and the zero-velocity interval in units of the scene's speed.
STEPS = (300, 1200, 4800)
INTERVALS = (1e-5, 1e-7, 1e-9)
FINER = 16  # times as many steps for a method of first order
# A fourth-order method that locates its events stays below this with the finest step; one that takes events where
# its steps find them is off by a step.
LOCATED, NOT_LOCATED = 1e-5, 2 / STEPS[-1]
FIXED_STEP_FLOOR = 1e-7  # sixteen halvings, the published number, of a step of unit/300 leave 5e-8 units
# Least fall of an error for a tolerance a thousand times tighter (a method of order 2 does better), and for a step
# a fourth as long (first order gives 4).
FALL, FIXED_STEP_FALL = 10.0, 2.0
LAST_RESORT = 1e-13  # for a method of low order whose error at 1e-12 is still above the scene's tolerance
# Error in units of rtol that a study cut short may show: a low-order method makes ten to a hundred times its
# tolerance in a period, and a lightly damped motion remembers tens of periods.
CUT_SHORT = 1000.0
# A method of order 3 would take a hundred thousand steps for 1e-9 over more than fifty periods: there its tolerances
# are this much looser.
LOW_ORDER, LONG = 100.0, 50.0
# A method with this option has the capability when it is set so.
LIFTED = {"stick_velocity": ("zero", "exact-stick")}


# Seconds for one run of a scene: the longest takes ten on a slow machine.
LONGEST = 60


class Endless(Exception):
    """A run that does not come to an end."""


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
    """One run of a study: its options, the error that counts as none at it, and the fall from the one before."""

    text: str
    options: Mapping[str, Any]
    excused: float
    fall: float


def integrator(name: str) -> Any:
    """The registered integrator of that name."""
    return next(one for one in hs.list_integrators() if one.name == name)


def option_names(one: Any) -> set[str]:
    """The options of an integrator: the fields of its dataclass."""
    return {field.name for field in fields(one)}


def lacking(one: Any) -> dict[str, str]:
    """What an integrator lacks at the options that its study uses."""
    lifted = {capability for option, (_, capability) in LIFTED.items() if option in option_names(one)}
    return {capability: reason for capability, reason in one.lacks.items() if capability not in lifted}


def study(one: Any, scene: Scene) -> tuple[Setting, ...]:
    """The settings at which a scene is run, from loose to tight."""
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
        excused = max(scene.floor, FIXED_STEP_FLOOR)
        settings.append(Setting(f"unit/{steps}", {**fixed, **options}, excused, FIXED_STEP_FALL))
    return tuple(settings)


def adaptive(rtol: float, scene: Scene) -> Setting:
    """The setting of one tolerance."""
    return Setting(f"rtol {rtol:.0e}", {"rtol": rtol}, max(rtol, scene.floor), FALL)


def outcome(name: str, scene: Scene, **options: Any) -> Outcome:
    """Run one scene with one integrator (and its options) at all settings and judge it."""
    one = integrator(name)
    lacks = lacking(one)
    for capability in sorted(scene.needs | ({"located"} if "contacts" in scene.needs else set())):
        if capability in lacks:
            return Outcome(name, scene.name, "lacks", (f"{capability}: {lacks[capability]}",))
    _compile(name)
    wrong: list[str] = []
    done: list[tuple[Setting, judge.Measured]] = []
    settings = list(study(one, scene))
    tolerances = (scene.tol_t, scene.tol_x)
    if "adaptive" in lacks:
        fixed_step = LOCATED if "release" in option_names(one) else NOT_LOCATED
        tolerances = (max(scene.tol_t, fixed_step), max(scene.tol_x, fixed_step))
    for number, setting in enumerate(settings):
        try:
            with bounded_work():
                measured = judge.measure(scene, judge.run(scene, name, **setting.options, **options), lacks)
        except HybridsimError as error:
            wrong.append(f"{setting.text}: refused: {error}")
            break
        except Exception as error:  # whatever it is, it is what a user would see
            wrong.append(f"{setting.text}: raised {type(error).__name__}: {error}")
            break
        wrong += [f"{setting.text}: {sentence}" for sentence in measured.wrong]
        done.append((setting, measured))
        last = number == len(settings) - 1
        if "adaptive" in lacks:
            continue
        if not last and measured.steps > scene.effort:
            allowed = CUT_SHORT * setting.options["rtol"]
            tolerances = (max(tolerances[0], allowed), max(tolerances[1], allowed))
            break
        if last and not wrong and setting.options["rtol"] != LAST_RESORT and not within(measured, tolerances):
            settings.append(replace(adaptive(LAST_RESORT, scene), fall=1.0))
    if not wrong:
        wrong = judge_errors(done, tolerances)
    rows = tuple((setting.text, measured.time_error, measured.state_error) for setting, measured in done)
    return Outcome(name, scene.name, "wrong" if wrong else "right", tuple(wrong), rows)


@cache
def _compile(name: str) -> None:
    """Have an integrator compiled: that may take as long as a machine needs, and must not be interrupted."""
    integrator(name)().prepare(system_of(hs.load("free-decay")))


@contextmanager
def bounded_work() -> Iterator[None]:
    """Turn work without end into an Endless error (where the platform has alarms, in the main thread)."""
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def give_up(number: int, frame: FrameType | None) -> None:
        raise Endless(f"no end after {LONGEST} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def within(measured: judge.Measured, tolerances: tuple[float, float]) -> bool:
    """Whether both errors are within their tolerances."""
    return measured.time_error <= tolerances[0] and measured.state_error <= tolerances[1]


def judge_errors(done: list[tuple[Setting, judge.Measured]], tolerances: tuple[float, float]) -> list[str]:
    """Errors fall from setting to setting and end within the scene's tolerances."""
    wrong = []
    for what, attribute, tolerance in zip(
        ("event times", "states"), ("time_error", "state_error"), tolerances, strict=True
    ):
        errors = [(setting, float(getattr(measured, attribute))) for setting, measured in done]
        for (before, larger), (setting, error) in pairwise(errors):
            if error > setting.excused and error * setting.fall > max(larger, before.excused):
                wrong.append(
                    f"{setting.text}: error of {what} {error:.2g}, at the setting before {larger:.2g}"
                )
        if errors and not errors[-1][1] <= tolerance:
            wrong.append(
                f"{errors[-1][0].text}: error of {what} {errors[-1][1]:.2g} is above {tolerance:.2g}"
            )
    return wrong


def conformance_failures(name: str, scenes: Iterable[Scene] = SCENES) -> list[str]:
    """What an integrator got wrong, one sentence each; empty if nothing. What it lacks is no failure."""
    outcomes = [outcome(name, scene) for scene in scenes]
    return [f"{one.scene}: {reason}" for one in outcomes if one.verdict == "wrong" for reason in one.reasons]
