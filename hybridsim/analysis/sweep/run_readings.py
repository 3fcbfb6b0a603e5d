"""This module defines the measure of runs over a time span: final states, and statistics of the whole run."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hybridsim.analysis.steady.motion import point_after_end
from hybridsim.analysis.steady.over_run import OverRun
from hybridsim.analysis.structures.swept import is_structure, modes_of, quantities_of
from hybridsim.calls import Default
from hybridsim.errors import SimulationError, UsageError, nearest
from hybridsim.expr import Expression, evaluate, parse, require_names
from hybridsim.model import Model
from hybridsim.simulate import simulate
from hybridsim.solution.integrals.impulsive import refuse_impulses

FINAL, FIRST_PASSAGE = "final", "first_passage"
OF_QUANTITY = ("amplitude", "peak", "maximum", "minimum", "mean", "rms", "energy")
_INTEGRATED = OF_QUANTITY[4:]
OF_CONTACT = ("stick_fraction", "stops", "dissipated")
OF_IMPACT = ("impacts", "impulse")
OF_MODE = "mode_fraction"
_PASSAGE = re.compile(r"first_passage\.([^<>]+)([<>])([^<>]+)")


@dataclass(frozen=True)
class Passage:
    """The quantity, direction and level in a name such as ``first_passage.x>0.1``."""

    quantity: str
    is_upward: bool
    level: Expression


@dataclass(frozen=True)
class OfRun:
    """A measure that reads a run of `simulate`: ``final.x``, ``maximum.x``, ``first_passage.x>0.1``, ..."""

    reading_names: tuple[str, ...]
    options: Mapping[str, Any]

    def nothing(self) -> dict[str, float | str]:
        """Return placeholders, such as NaN, for the values of a point without a result."""
        return dict.fromkeys(self.reading_names, math.nan)

    def run(self, model: Model, previous: OverRun | None) -> OverRun:
        """Run the model once; with `warm_start`, the run begins at the end of the previous run."""
        arguments = dict(self.options)
        only_ends = _are_final(self.reading_names)
        if only_ends:
            arguments = {"keep": Default("nothing"), **arguments}
        if previous is not None:
            arguments |= _end_of(previous, model)
        solution = simulate(model, **arguments)
        if not solution.success:
            raise SimulationError(f"{solution.status}: {solution.message}")
        if solution.t_end <= solution.t_start and not only_ends:
            raise UsageError(
                "`t_span` does not run forward in time",
                remedy="use (t0, t1) with t1 > t0, or measure 'final'",
            )
        return OverRun(solution, self._quantities)

    def read(self, result: OverRun) -> dict[str, float]:
        """Return the values in the order of their names."""
        return {word: _reading(result, word) for word in self.reading_names}

    @cached_property
    def _quantities(self) -> tuple[str, ...]:
        """The quantities that are measured over the whole run."""
        passages = [p.quantity for word in self.reading_names if (p := passage_of(word))]
        parts = [word.partition(".") for word in self.reading_names]
        return tuple(dict.fromkeys([*passages, *(name for head, _, name in parts if head in OF_QUANTITY)]))


def of_run(reading_names: Sequence[str], model: Model, options: Mapping[str, Any]) -> OfRun:
    """Return a measure that reads values such as ``final.x`` from runs; "final" alone means all final states.

    Raises
    ------
    UsageError
        For unknown names, or a run that is not kept completely.
    """
    states = [state.name for state in model.states]
    if tuple(reading_names) == (FINAL,):
        return OfRun(tuple(f"{FINAL}.{name}" for name in states), options)
    if is_structure(model):
        beyond = next((word for word in reading_names if not word.startswith(f"{FINAL}.")), None)
        if beyond is not None:
            raise UsageError(
                f"`measure` {beyond!r} of a run is not supported for a MechanicalSystem",
                remedy="use 'final', or remove `t_span` to measure the steady state",
            )
    if not _are_final(reading_names):
        _refuse_parts(options)
    quantities = _quantities_of(model)
    known = [f"{FINAL}.{name}" for name in (*states, *(each.name for each in model.discrete))]
    known += [f"{head}.{name}" for head in OF_QUANTITY for name in quantities]
    known += [f"{head}.{contact.name}" for head in OF_CONTACT for contact in model.contacts]
    known += [f"{head}.{impact.name}" for head in OF_IMPACT for impact in model.impacts]
    known += [f"{OF_MODE}.{name}" for name in modes_of(model)]
    for word in reading_names:
        passage = passage_of(word)
        if passage is not None and passage.quantity in quantities:
            require_names(passage.level, [parameter.name for parameter in model.parameters])
        elif word not in known:
            examples = [f"{FIRST_PASSAGE}.{name}>0.0" for name in quantities]
            raise UsageError(
                f"there is no measure {word!r} of a run",
                remedy=remedy_for_definition(model, word.partition(".")[2])
                or nearest(word, [*known, *examples], kind="measures"),
            )
    return OfRun(tuple(reading_names), options)


def remedy_for_definition(model: Model, name: str) -> str:
    """Return the remedy if a definition is used as a quantity, or an empty string for another name."""
    if is_structure(model) or name not in dict(model.definitions):
        return ""
    return f"{name} is a definition; declare an output with the value {name}, and use the output"


def passage_of(word: str) -> Passage | None:
    """Split a name such as ``first_passage.x>0.1`` into its parts; return None for any other name.

    Raises
    ------
    ExpressionError
        For a level that is not an expression.
    """
    found = _PASSAGE.fullmatch(word)
    return None if found is None else Passage(found[1], found[2] == ">", parse(found[3]))


def _are_final(reading_names: Sequence[str]) -> bool:
    return all(word.partition(".")[0] == FINAL for word in reading_names)


def _refuse_parts(options: Mapping[str, Any]) -> None:
    """Raise `UsageError` if the options keep only a part of a run."""
    for name in ("keep", "save"):
        if options.get(name, "all") != "all":
            raise UsageError(
                f"`{name}` is {options[name]!r}, but only 'final' can be measured without the whole run",
                remedy=f"remove `{name}`, or measure 'final'",
            )


def _quantities_of(model: Model) -> list[str]:
    discrete = {d.name for d in model.discrete}
    return [name for name in quantities_of(model) if name not in discrete]


def _reading(run: OverRun, word: str) -> float:
    head, _, name = word.partition(".")
    if head == FINAL:
        solution, names = run.solution, run.solution.names
        if name in names:
            return float(solution.x_end[names.index(name)])
        held = [each.name for each in solution.model.discrete]
        return float(point_after_end(solution).discrete[held.index(name)])
    passage = passage_of(word)
    if passage is not None:
        level = evaluate(passage.level, run.solution.model.parameter_values())
        return run.first_passage(passage.quantity, level, passage.is_upward)
    if head in _INTEGRATED:
        refuse_impulses(run.solution, [name], f"`measure` {word!r}: an integral")
    return float(run.stops(name) if head == "stops" else getattr(run, head)[name])


def _end_of(run: OverRun, model: Model) -> dict[str, Any]:
    """Return the states, discrete states and modes at the end of a run, as arguments of `simulate`."""
    solution = run.solution
    if is_structure(model):
        return {"x0": dict(zip(solution.names, solution.x_end.tolist(), strict=True))}
    end, names = point_after_end(solution), (*solution.names, *(each.name for each in model.discrete))
    return {"x0": dict(zip(names, end.values.tolist(), strict=True)), "z0": end.z}
