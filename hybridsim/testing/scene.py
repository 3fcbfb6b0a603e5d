"""Scenes: a model, a run, its known answer, and the class of trouble that it represents."""

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
    "events": "Events: when they are, how many, and in which order",
    "stick": "Stick: when it begins, whether it holds, when it ends",
    "sliding": "Sliding: along a surface, and off it again",
    "accumulation": "Accumulation: infinitely many events in a finite time",
    "stiffness": "Stiffness: rates that lie decades apart",
    "stability": "Stability: steps and intervals beyond their limits, and long runs",
    "sensitivity": "Sensitivity: where digits are lost",
}

END = math.inf  # as the time of a state: the end of the run


def needs(*capabilities: str) -> frozenset[str]:
    """Return the capabilities that a scene needs."""
    return frozenset(capabilities)


Check = Callable[[Any], list[str]]  # a solution -> its errors as sentences


@dataclass(frozen=True)
class Truth:
    """The known answer of a scene.

    Parameters
    ----------
    events : (t, label) of every event, in order; labels as in `judge.label`. None: not compared.
    states : (t, values in the order of the states), right-continuous; END for the time where the run ends,
        None for a value not compared.
    quantities : (function of the solution, its true value), counted among the states.
    status, end : how and when the run ends; status None: the checks decide.
    checks : functions of the solution that return sentences about what is wrong, each with the capability it is
        about ("" for every integrator).
    """

    events: tuple[tuple[float, str], ...] | None = ()
    states: tuple[tuple[float, tuple[float | None, ...]], ...] = ()
    quantities: tuple[tuple[Callable[[Any], float], float], ...] = ()
    status: str | None = "finished"
    end: float | None = None
    checks: tuple[tuple[str, Check], ...] = ()


@dataclass(frozen=True)
class Scene:
    """A model, a run of the model, and the known answer.

    Parameters
    ----------
    name : of the scene, unique among those that are run together.
    file : a model file of the package's own scenes by its bare name, the name of a packaged model, or the path of a
        ``.toml`` file.
    span : (t0, t1) of the run.
    truth : what must come out.
    needs : capabilities without which the scene cannot be run.
    unit : a time that is long for this motion, such as its period: errors of time are relative to it, and a
        fixed-step method divides it.
    tol_t, tol_x : errors allowed at the tightest tolerance: of event times in units of `unit`, of states in
        units of their largest true value.
    floor : error below which no improvement is asked for (digits of the truth, conditioning of the scene).
    count_scheduled : whether scheduled events are among the expected ones.
    start_is_event : whether an event at t0 itself counts; with a contact the engine only finds its mode there.
    end_margin : events this close to the end of the run are not counted (the motion ends on an event).
    speed : a speed that is fast for this motion, for methods with a zero-velocity interval.
    tolerances : rtol from loose to tight.
    effort : a run that took more steps than this is the last of its study.
    trouble : the class of trouble, one of `TROUBLES`.
    title, cause, story : what it is and why methods fail, in a few words each, and a paragraph: what goes
        wrong, why, and which method to use.

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
            raise ValueError(f"scene {self.name} needs {sorted(unknown)}, which is not in the vocabulary")
