"""Run a test case with one setting of an integrator, and compare the result with the truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container
from dataclasses import dataclass
from itertools import groupby
from math import inf
from pathlib import Path
from typing import Any

import hybridsim as hs
from hybridsim.arguments import chosen_model
from hybridsim.engine.system.system_cache import system_of
from hybridsim.testing.clock import ProcessorTime
from hybridsim.testing.scene import END, Scene

ENDED = ("finished", "terminated")  # statuses of a run that ended as requested
SCENES = Path(__file__).with_name("scenes")
START = 1e-12  # in units of time; selecting the mode of a start on a guard may take an event at this time


@dataclass(frozen=True)
class Measured:
    """The comparison of one run with the truth.

    Parameters
    ----------
    ending, sequence, checks : errors, as sentences, of the end of the run, of its events and modes, and of the checks.
    time_error, state_error : relative errors, see `Scene`.
    status, steps, seconds : status of the run, number of steps, and run time.
    """

    ending: tuple[str, ...]
    sequence: tuple[str, ...]
    checks: tuple[str, ...]
    time_error: float
    state_error: float
    status: str
    steps: int
    seconds: float

    @property
    def wrong(self) -> tuple[str, ...]:
        """All errors of the run except numerical errors of times and states."""
        return (*self.ending, *self.sequence, *self.checks)


def label(event: Any) -> str:
    """Return component:mode as the label of a transition, otherwise the name of the monitor or schedule."""
    return f"{event.component}:{event.target}" if event.kind == "transition" else event.component


def load(scene: Scene) -> Any:
    """Return the model that a test case names."""
    path = SCENES / f"{scene.file}.toml"
    return hs.load(str(path) if path.exists() else scene.file)


def model_of(scene: Scene, form: str, settings: dict[str, Any]) -> Any:
    """Return the model of a test case, or a regularized form of the model with the width `settings["v0"]`."""
    model = load(scene)
    return model.regularized(form, v0=settings.pop("v0")) if form else model


def prepare(scene: Scene, integrator: str, form: str = "", **settings: Any) -> None:
    """Compile everything that a run needs, so that a time limit counts only the run.

    Errors
    ------
    HybridsimError as from the run itself.
    """
    model = chosen_model(model_of(scene, form, settings), dict(scene.params))
    system, method = system_of(model), next(one for one in hs.list_integrators() if one.name == integrator)
    for function in system.hot_functions():
        system.address(function)
    method().prepare(system)


def run(
    scene: Scene, integrator: str, form: str = "", processor_seconds: float = inf, **settings: Any
) -> Any:
    """Simulate the test case, or its regularized form with the width v0 of the settings."""
    model = model_of(scene, form, settings)
    return hs.simulate(
        model,
        scene.span,
        params=dict(scene.params),
        x0=dict(scene.start),
        integrator=integrator,
        progress=None if processor_seconds == inf else ProcessorTime(processor_seconds),
        **{**scene.options, **settings},
    )


def measure(scene: Scene, solution: Any, lacks: Container[str] = ()) -> Measured:
    """Compare a solution with the truth, and skip checks that need a missing capability of the integrator."""
    wrong, time_error, state_error = ending(scene, solution), 0.0, 0.0
    sequence: list[str] = []
    if not wrong and scene.truth.events is not None:
        sequence, time_error = compare_events(scene, solution)
    if not wrong and not sequence:
        state_error = compare_states(scene, solution)
    checks = [
        sentence
        for capability, check in scene.truth.checks
        if capability not in lacks and not wrong
        for sentence in check(solution)
    ]
    return Measured(
        tuple(wrong),
        tuple(sequence),
        tuple(checks),
        time_error,
        state_error,
        solution.status,
        int(solution.stats["steps"]),
        float(solution.stats["wall_time"]),
    )


def ending(scene: Scene, solution: Any) -> list[str]:
    """Return the errors in the status, the message and the time of the end of a run."""
    truth, wrong = scene.truth, []
    if truth.status is not None and solution.status != truth.status:
        wrong.append(
            f"the run ended with the status {solution.status!r} instead of {truth.status!r}: {solution.message}"
        )
    if solution.status not in ENDED and not solution.message:
        wrong.append(f"the run ended with the status {solution.status!r} without a message")
    if truth.status is None and solution.status not in ENDED:
        sign = 1.0 if scene.span[1] > scene.span[0] else -1.0
        if any(t != END and sign * (t - solution.t_end) > 0.0 for t, _ in truth.states):
            wrong.append(f"the run ended with the status {solution.status!r}: {solution.message}")
    end = scene.span[1] if truth.end is None and truth.status == "finished" else truth.end
    if end is not None and not wrong and abs(solution.t_end - end) > 1e-3 * scene.unit:
        wrong.append(f"the run ended at t = {solution.t_end!r} instead of {end!r}")
    return wrong


def counted(scene: Scene, solution: Any) -> list[tuple[float, str]]:
    """Return the events of a run that the truth lists."""
    kinds = ("transition", "monitor", "scheduled") if scene.count_scheduled else ("transition", "monitor")
    first, last = scene.span
    return [
        (event.t, label(event))
        for event in solution.events
        if event.kind in kinds
        and (scene.start_is_event or abs(event.t - first) > START * scene.unit)
        and (scene.end_margin == 0.0 or abs(event.t - last) > scene.end_margin)
    ]


def compare_events(scene: Scene, solution: Any) -> tuple[list[str], float]:
    """Return the first difference of the event sequence, and the largest error of the event times."""
    found, expected = counted(scene, solution), list(scene.truth.events or ())
    position, error = 0, 0.0
    for t, group in groupby(expected, key=lambda event: event[0]):
        names = [name for _, name in group]
        here = found[position : position + len(names)]
        if Counter(names) != Counter(name for _, name in here):
            due = f"{' and '.join(names)} at t = {t!r}"
            seen = ", ".join(f"{name} at t = {at!r}" for at, name in here)
            number, total = position + 1, f"events found: {len(found)}, due: {len(expected)}"
            what = f"should be {due}, and is {seen}" if here else f"is missing: {due}"
            return [f"event {number} {what}; {total}"], 0.0
        error = max(error, *(abs(at - t) / scene.unit for at, _ in here))
        position += len(names)
    if position < len(found):
        extra = ", ".join(f"{name} at t = {t!r}" for t, name in found[position : position + 3])
        return [f"events found: {len(found)}, due: {position}; the first superfluous events: {extra}"], 0.0
    return [], error


def compare_states(scene: Scene, solution: Any) -> float:
    """Return the largest relative error of the states and other quantities."""
    rows = scene.truth.states
    largest = [
        max((abs(value) for value in column if value is not None), default=1.0)
        for column in zip(*(values for _, values in rows), strict=True)
    ]
    error = max((abs(of(solution) / true - 1) for of, true in scene.truth.quantities), default=0.0)
    for t, values in rows:
        found = solution(solution.t_end if t == END else t)
        for got, value, size in zip(found, values, largest, strict=True):
            if value is not None:
                error = max(error, abs(got - value) / (size or 1.0))
    return float(error)
