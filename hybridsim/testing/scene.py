"""This module defines a test case (`Scene`): a model, a run of the model, and the known answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

VOCABULARY = (
    "contacts",
    "located",
    "sliding",
    "impacts",
    "transitions",
    "nonlinear",
    "functions",
    "monitors",
    "scheduled",
    "multiple-roots",
    "accumulation",
    "tangent-exit",
    "poles",
    "exact-stick",
    "backward",
    "corners",
    "stiff",
    "adaptive",
)
TOLERANCES = (1e-6, 1e-9, 1e-12)

TROUBLES = {
    "events": "Events: their times, their number and their order",
    "stick": "Stick: its start, its duration and its end",
    "sliding": "Sliding: motion along a switching surface, and its end",
    "accumulation": "Accumulation: infinitely many events in finite time",
    "stiffness": "Stiffness: rates of very different size",
    "stability": "Stability: step sizes beyond the limit of stability, and long runs",
    "sensitivity": "Sensitivity: motions that amplify errors",
}

END = math.inf  # as the time of a state: the end of the run


def needs(*capabilities: str) -> frozenset[str]:
    """Return the capabilities that a test case needs."""
    return frozenset(capabilities)


Check = Callable[[Any], list[str]]  # a solution -> its errors as sentences


@dataclass(frozen=True)
class Truth:
    """The known answer of a test case.

    Parameters
    ----------
    events : (t, label) of every event, in order, with the labels of `judge.label`; None skips the comparison.
    states : (t, values in the order of the states), right-continuous. END is the time of the end of the run; a value
        None is not compared.
    quantities : (function of the solution, its true value); their errors count as errors of states.
    status, end : expected status and end time; with the status None only the checks decide.
    checks : functions of the solution that return its errors as sentences, each with the capability that it tests (""
        for every integrator).
    """

    events: tuple[tuple[float, str], ...] | None = ()
    states: tuple[tuple[float, tuple[float | None, ...]], ...] = ()
    quantities: tuple[tuple[Callable[[Any], float], float], ...] = ()
    status: str | None = "finished"
    end: float | None = None
    checks: tuple[tuple[str, Check], ...] = ()


@dataclass(frozen=True)
class Scene:
    """A scene is a test case: a model, a run of the model, and the known answer.

    Parameters
    ----------
    name : unique name of the scene.
    file : the bare name of a model file of the packaged scenes, the name of a packaged model, or the path of a
        ``.toml`` file.
    span : (t0, t1) of the run.
    truth : the known answer.
    needs : capabilities that an integrator needs to run the scene.
    unit : typical time of the motion, such as its period. Errors of times are relative to it, and fixed steps are
        fractions of it.
    tol_t, tol_x : allowed errors at the tightest tolerance, of event times in units of `unit` and of states in units
        of their largest true value.
    floor : errors below it need not decrease (digits of the truth, conditioning of the scene).
    count_scheduled : whether `truth.events` contains scheduled events.
    start_is_event : whether an event at t0 counts; for a contact it is only the selection of the mode.
    end_margin : events closer to the end than this do not count (the motion ends on an event).
    speed : typical speed of the motion, for methods with a zero-velocity interval.
    tolerances : rtol from loose to tight.
    effort : number of steps above which a run is the last one of its study.
    trouble : the class of trouble, one of `TROUBLES`.
    title, cause, story : a title, the reason why methods fail, and a paragraph about the failure, its reason and the
        method to use.

    Raises ValueError for a capability that is not in the vocabulary.
    """

    name: str
    file: str
    span: tuple[float, float]
    truth: Truth
    needs: frozenset[str] = frozenset()
    params: Mapping[str, Any] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    unit: float = 1.0
    tol_t: float = 1e-8
    tol_x: float = 1e-8
    floor: float = 1e-11
    count_scheduled: bool = False
    start_is_event: bool = True
    end_margin: float = 0.0
    speed: float = 1.0
    tolerances: tuple[float, ...] = TOLERANCES
    effort: int = 5000
    trouble: str = ""
    title: str = ""
    cause: str = ""
    story: str = ""

    def __post_init__(self) -> None:
        unknown = set(self.needs) - set(VOCABULARY)
        if unknown:
            raise ValueError(f"test case {self.name} requires unknown capabilities: {sorted(unknown)}")


def named(name: str, span: tuple[float, float], truth: Truth, *rest: Any, **more: Any) -> Scene:
    """Return a test case with the name of its model file; other arguments are passed on to `Scene`."""
    return Scene(name, name, span, truth, *rest, **more)
