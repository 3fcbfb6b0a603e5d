"""This module describes combinations of modes that were examined at an event, with their guards."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hybridsim.engine.events.choice.verdict import FINE, LEAVES, side_after
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.system.system import System
from hybridsim.expr import Expression, of_tree
from hybridsim.expr.rebuild import with_names
from hybridsim.model.checks.units import rate_of, time_unit, unit_of
from hybridsim.model.parts.switching import ATTRACTION
from hybridsim.model.smoothing.jumps import SIGN
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.smoothing.rewriting import VARIABLE
from hybridsim.solution.explain.recorded_resolution import Decision, Look

_VERDICTS = {FINE: "admissible", LEAVES: "not admissible"}
_OPEN = "a question of rounding"


@dataclass(frozen=True)
class GuardView:
    """A guard at the instant of an event, with its derivatives along the flow of one mode.

    Parameters
    ----------
    mode, guard, text : the mode, the name of the guard, and its expression.
    derivatives, bounds : its value and time derivatives (4,), and bounds of their rounding errors.
    decreed : the number of leading derivatives that the event makes exactly zero; they are skipped.
    side : its sign just after the event, 0 if rounding decides; order : of the derivative that decides.
    units : of the guard and its derivatives (4,), empty if unknown.
    """

    mode: str
    guard: str
    text: str
    derivatives: tuple[float, ...]
    bounds: tuple[float, ...]
    decreed: int
    side: int
    order: int
    units: tuple[str, ...] = ("", "", "", "")

    @property
    def is_open(self) -> bool:
        """Whether rounding makes the sign just after the event uncertain."""
        left = (*self.derivatives[self.decreed :], *self.bounds[self.decreed :])
        return self.side == 0 and any(left)

    def in_numbers(self) -> str:
        """Return the value, the first two derivatives and the rounding error of the guard as text."""
        numbers = zip(("g", "g'", "g''"), self.derivatives, self.units, strict=False)
        terms = [f"{name} = {value + 0.0:.3g} {unit}".rstrip() for name, value, unit in numbers]
        rounding = f"{self.bounds[0]:.1g} {self.units[0]}".rstrip()
        terms[0] += f" (rounding of the states contributes {rounding})"
        return f"{self.guard} (g = {self.text}): {', '.join(terms)}"

    def __str__(self) -> str:
        if not self.is_open and self.side == 0:
            still = "g = 0 exactly" if self.decreed else "g = 0"
            return f"{self.guard} (g = {self.text}) stays >= 0: {still} and does not change"
        terms = []
        for k, (value, bound) in enumerate(zip(self.derivatives, self.bounds, strict=True)):
            name, unit = "g" + "'" * k, f" {self.units[k]}" if self.units[k] else ""
            if k < self.decreed:
                terms.append(f"{name} = 0 exactly")
            elif k == self.order:
                terms.append(f"{name} = {value:.3g}{unit}")
                break
            elif math.isnan(value + bound):
                terms.append(f"{name} is not a number")
                break
            else:
                terms.append(f"{name} = 0 within rounding ({bound:.1g}{unit})")
        sign = {1: "stays >= 0", -1: "goes negative", 0: "is undecided"}[self.side]
        return f"{self.guard} (g = {self.text}) {sign}: {', '.join(terms)}"


@dataclass(frozen=True)
class Candidate:
    """A combination of modes that could hold just after an event, with its guards and its verdict."""

    modes: dict[str, str]
    verdict: str
    guards: tuple[GuardView, ...]
    taken: bool = False


def views(
    system: System, at: Situation, z: np.ndarray, guards: list[int], decreed: np.ndarray
) -> Iterable[GuardView]:
    """Yield the guards in the modes `z`, with their values and signs just after the event."""
    series = system.series(at.s, at.x, at.p, z, at.x_error, at.s_error, at.is_put)
    time = time_unit(system.model)
    for g in guards:
        c = int(system.owner[g])
        automaton, mode = system.automata[c], int(z[c])
        j = automaton.guards[mode].index(g)
        values, bounds = series.guards[g], series.guard_bounds[g]
        side, order = side_after(values, bounds, int(decreed[g]))
        declared = as_in(system, z, system.model.all_components()[c].modes[mode].guards[j].expr)
        unit = "" if declared.text.startswith(ATTRACTION) else unit_of(system.model, declared)
        factorials = [math.factorial(k) for k in range(len(values))]
        yield GuardView(
            f"{automaton.name} {automaton.modes[mode]}",
            automaton.guard_names[mode][j],
            _readable(declared.text, automaton.name),
            tuple(float(v) * f for v, f in zip(values, factorials, strict=True)),
            tuple(float(b) * f for b, f in zip(bounds, factorials, strict=True)),
            int(decreed[g]),
            int(side),
            int(order),
            tuple(rate_of(unit, time, k) for k in range(len(values))),
        )


def as_in(system: System, z: np.ndarray, expression: Expression) -> Expression:
    """Return an expression in which each corner is replaced by its branch in the modes `z`."""
    modes = [c.modes[int(k)] for c, k in zip(system.model.all_components(), z, strict=True)]
    values = {n: e.tree for mode in modes for n, e in mode.set.items() if n.startswith((VARIABLE, SIGN))}
    tree = expression.tree
    while names_of(tree) & values.keys():
        tree = with_names(tree, values)
    return expression if tree is expression.tree else of_tree(tree, expression.place)


def _readable(text: str, component: str) -> str:
    """Return the expression of a guard as readable text, without internal names."""
    if text.startswith(ATTRACTION):
        return (
            f"attraction of {component}, half the sum of the rates at which both sides approach the surface"
        )
    return re.sub(rf"{SIGN}\d+", component, text)


def candidate(system: System, decision: Decision, look: Look) -> Candidate:
    """Return one combination of modes that was examined at an event, with the values of its guards."""
    guards = [g for c in look.components for g in system.automata[c].guards[look.z[c]]]
    shown = tuple(views(system, look.at, look.z, guards, look.decreed))
    modes = {system.automata[c].name: system.automata[c].modes[look.z[c]] for c in look.components}
    return Candidate(modes, _VERDICTS.get(look.verdict, _OPEN), shown, decision.has_taken(look))


def way(system: System, look: Look) -> str:
    """Return the modes of a combination as text, such as "f: stick, g: slip+"."""
    return ", ".join(
        f"{system.automata[c].name} {system.automata[c].modes[look.z[c]]}" for c in look.components
    )
