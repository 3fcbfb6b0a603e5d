"""This module selects the built-in measures by their names, and defines the measure of steady states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.analysis.compare.comparison_request import whole
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.steady.period_readings import Reader, period_reader
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.steady_state import steady_state
from hybridsim.analysis.steady.together import (
    EQUILIBRIUM,
    PERIODIC,
    can_be_compiled,
    effort_of,
    steady_motions,
)
from hybridsim.analysis.structures.result import StructureSteadyState
from hybridsim.analysis.structures.swept import is_structure, modes_of, quantities_of
from hybridsim.analysis.sweep.last_period import OF_MOTION, LastPeriod, MeasuredPeriod, period_of
from hybridsim.analysis.sweep.run_readings import (
    FINAL,
    FIRST_PASSAGE,
    OF_IMPACT,
    OF_MODE,
    OF_QUANTITY,
    OfRun,
    of_run,
    remedy_for_definition,
)
from hybridsim.analysis.sweep.work.job import Incomplete, Job, Outcome, Settings, Together, Watch
from hybridsim.analysis.sweep.work.together import PointsTogether
from hybridsim.engine.system.system import System
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import UsageError, nearest
from hybridsim.model import Model
from hybridsim.model.checks.units import time_unit, unit_of_work, units_of
from hybridsim.simulate import simulate

STEADY, AFTER, T_SPAN = "steady", "after", "t_span"
# measures of a steady state: of a quantity, of a contact, of the motion
_OF_QUANTITY = (*OF_QUANTITY, "harmonic")
_OF_CONTACT = ("stick_fraction", "stops_per_period", "dissipated")
_OF_MOTION = ("period", "multiple", "residual", "newton_steps", "periods", "kind", "word", "stable")
_TEXTS = ("kind", "word")
_SQUARED = "energy"
_PLAIN = ("amplitude", "energy")  # the default measures of each quantity


@dataclass(frozen=True)
class Steady:
    """A measure that reads `steady_state`: ``amplitude.x``, ``harmonic.x.3``, ``period``, ``kind``, ...

    A motion that does not repeat has no such measures; its status names its kind.
    """

    reading_names: tuple[str, ...]
    options: Mapping[str, Any]

    def nothing(self) -> dict[str, float | str]:
        """Return placeholders, such as NaN, for the values of a point without a result."""
        return {word: "" if word in _TEXTS else math.nan for word in self.reading_names}

    def run(self, model: Model, previous: SteadyState | None) -> SteadyState:
        """Find the steady state; with `warm_start`, begin at the steady state of the previous point."""
        start = {} if previous is None else _start_of(previous)
        return steady_state(model, **{**self.options, **start})

    def read(self, result: SteadyState) -> dict[str, Any]:
        """Return the values in the order of their names."""
        if not result.success:
            known = {
                name: getattr(result, name) for name in self.reading_names if name in ("kind", "residual")
            }
            raise Incomplete(f"{result.kind}: {result.message}", known)
        return {word: _reading(result, word) for word in self.reading_names}

    def together(
        self,
        job: Job,
        points: Sequence[Settings],
        alone: Callable[[Settings], Outcome],
        watch: Watch,
    ) -> Together | None:
        """Find the steady states of all points in compiled code, or return None.

        The function `alone` measures the points that compiled code cannot decide.
        """
        if is_structure(job.model):
            return None
        system, checked = system_of(job.model), effort_of(self.options)
        readers = {word: _steady_reader(word, system) for word in self.reading_names}
        if checked is None or None in readers.values() or not can_be_compiled(system, self.options):
            return None
        batch = PointsTogether(job, points, alone, watch)
        for found in steady_motions(system, batch.parameters, batch.starts, checked, watch.may_continue):
            rows = zip(*(read(found).tolist() for read in readers.values() if read), strict=True)
            blank = [("period",) if rests else () for rests in found.rests.tolist()]
            batch.put(found.numbers, [dict(zip(readers, row, strict=True)) for row in rows], blank)
        return batch.finished()

    def blank(self, result: SteadyState) -> tuple[str, ...]:
        """Return NaN for the values that a result does not have, such as the period of an equilibrium."""
        return ("period",) if result.kind == "equilibrium" else ()


def named_measure(
    reading_names: str | Sequence[str], model: Model, options: Mapping[str, Any]
) -> Steady | OfRun | LastPeriod:
    """Return a measure by its name, "steady" or "final", or by the names of its values.

    With `t_span` among the options the values are those of a run, otherwise those of a steady state.

    Raises
    ------
    UsageError
        For unknown names, or readings of runs and of steady states together.
    """
    asked = (reading_names,) if isinstance(reading_names, str) else tuple(reading_names)
    of_runs = [word for word in asked if word.partition(".")[0] in (FINAL, FIRST_PASSAGE, "stops")]
    if T_SPAN in options and AFTER not in options and asked != (STEADY,):
        refuse_unknown([simulate], options)
        return of_run(asked, model, options)
    if of_runs:
        raise UsageError(
            f"`measure` {of_runs[0]!r} needs `t_span`", remedy="pass `t_span`, such as t_span=(0, 10)"
        )
    if AFTER in options:
        refuse_unknown([simulate], {name: value for name, value in options.items() if name != AFTER})
    else:
        refuse_unknown([steady_state, simulate], options)
    known = _known(model, OF_MOTION if AFTER in options else _OF_MOTION)
    if asked == (STEADY,):
        asked = tuple(
            word
            for word in known
            if word in ("period", "residual" if AFTER in options else "kind")
            or word.startswith((*_PLAIN, *_OF_CONTACT))
        )
    for word in asked:
        stem, _, last = word.rpartition(".")
        is_harmonic = word.startswith("harmonic.") and last.isdecimal()
        if AFTER in options and word in _OF_MOTION and word not in OF_MOTION:
            raise UsageError(
                f"the measure {word} belongs to a steady state, but `after` measures one period of an ordinary run",
                remedy=f"remove {word} or `after`; use 'residual' to measure how closely a run repeats",
            )
        if (f"{stem}.1" if is_harmonic else word) not in known:
            raise UsageError(
                f"there is no measure {word!r}",
                remedy=remedy_for_definition(model, word.partition(".")[2])
                or nearest(word, [STEADY, FINAL, *known], kind="measures"),
            )
    if AFTER in options:
        return _last_period(asked, model, dict(options))
    return Steady(asked, options)


def _last_period(reading_names: tuple[str, ...], model: Model, options: dict[str, Any]) -> LastPeriod:
    if is_structure(model):
        raise UsageError(
            "`after` is not supported for a MechanicalSystem",
            remedy="remove `after` to measure the steady state",
        )
    after = whole(options.pop(AFTER), AFTER)
    for name in ("t_span", "keep", "save", "t_eval"):
        if name in options:
            raise UsageError(f"`{name}` and `after` cannot be combined", remedy=f"remove `{name}`")
    period_of(model)  # an unforced model is refused here, once for all points
    return LastPeriod(reading_names, after, options, _reading)


def units_of_readings(reading_names: Iterable[str], model: Model) -> dict[str, str]:
    """Return the units of named values that are declared in the model."""
    if is_structure(model):
        return {}
    known, time = units_of(model), time_unit(model)
    units = {}
    for word in reading_names:
        head, _, rest = word.partition(".")
        if head == "period" or head == FIRST_PASSAGE:
            units[word] = time
        elif head in (*_OF_QUANTITY, FINAL):
            unit = known.get(rest.rpartition(".")[0] if head == "harmonic" else rest, "")
            squared = f"({unit})² {time}" if " " in unit or "/" in unit else f"{unit}² {time}"
            units[word] = (squared.strip() if head == _SQUARED else unit) if unit else ""
        elif head == "impulse" and known.get(rest):
            units[word] = f"{known[rest]} {time}".strip()
        elif head == "dissipated":
            units[word] = next((unit_of_work(model, c) for c in model.contacts if c.name == rest), "")
    return {word: unit for word, unit in units.items() if unit}


def _known(model: Model, of_motion: Sequence[str]) -> list[str]:
    """Return the names of all values of a steady state, with the first harmonic of each quantity."""
    discrete = {d.name for d in model.discrete}
    names = quantities_of(model)
    quantities = [name for name in names if name not in discrete]
    contacts = [contact.name for contact in model.contacts]
    numbered = {"harmonic": ".1"}
    found = [f"{head}.{name}{numbered.get(head, '')}" for head in _OF_QUANTITY for name in quantities]
    found += [f"{head}.{name}" for head in _OF_CONTACT for name in contacts]
    found += [f"{head}.{impact.name}" for head in OF_IMPACT for impact in model.impacts]
    return [*found, *(f"{OF_MODE}.{name}" for name in modes_of(model)), *of_motion]


def _steady_reader(word: str, system: System) -> Reader | None:
    """Return a function that computes a named value from periodic orbits, or None for an unsupported name."""
    of_motion: dict[str, Reader] = {
        "period": lambda found: np.where(found.rests, math.nan, found.periods),
        "multiple": lambda found: np.where(found.rests, 0.0, found.multiples),
        "residual": lambda found: found.residuals,
        "newton_steps": lambda found: found.newton_steps.astype(float),
        "periods": lambda found: found.followed.astype(float),
        "kind": lambda found: np.where(found.rests, EQUILIBRIUM, PERIODIC),
    }
    return of_motion.get(word) or period_reader(word, system)


def _reading(steady: SteadyState | MeasuredPeriod, word: str) -> Any:
    head, _, rest = word.partition(".")
    if head == "harmonic":
        name, _, number = rest.rpartition(".")
        return steady.harmonic(name, int(number))
    found = getattr(steady, head)
    if head == "word":
        return " ".join(found)
    return found[rest] if rest else found


def _start_of(steady: SteadyState) -> dict[str, Any]:
    """Return the states and the modes at which a steady motion starts."""
    if isinstance(steady, StructureSteadyState):
        return {"x0": steady.start}
    run = steady.solution
    x0 = dict(zip(run.names, run.y[:, 0].tolist(), strict=True))
    x0 |= {d.name: float(run.output(d.name, run.t_start)) for d in run.model.discrete}
    return {"x0": x0, "z0": {name: intervals[0].mode for name, intervals in run.modes.items() if intervals}}
