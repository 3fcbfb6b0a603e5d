"""Why an event went as it did: the decision made once more, with everything that it looked at."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.decide import FINE, LEAVES, side_after
from hybridsim.engine.jets import UNIT
from hybridsim.engine.outcome import Outcome, Situation
from hybridsim.engine.settle import Settling
from hybridsim.errors import UsageError
from hybridsim.model.switching import ATTRACTION

if TYPE_CHECKING:
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.system import System
    from hybridsim.solution.event import Event
    from hybridsim.solution.solution import Solution

_WORDS = {FINE: "admissible", LEAVES: "not admissible"}


@dataclass(frozen=True)
class GuardView:
    """A guard along the flow of one mode, at the instant of an event.

    Parameters
    ----------
    mode, guard, text : whose guard it is, and its expression.
    derivatives, bounds : its value and derivatives with respect to time (4,), and bounds of their rounding errors.
    decreed : how many of them, from the first on, are zero by decree and not looked at.
    side : its sign just after, 0 where that is a question of rounding; order : of the derivative that decides.
    """

    mode: str
    guard: str
    text: str
    derivatives: tuple[float, ...]
    bounds: tuple[float, ...]
    decreed: int
    side: int
    order: int

    def __str__(self) -> str:
        terms = []
        for k, (value, bound) in enumerate(zip(self.derivatives, self.bounds, strict=True)):
            name = "g" + "'" * k
            if k < self.decreed:
                terms.append(f"{name} = 0 by decree")
            elif k == self.order:
                terms.append(f"{name} = {value:.3g}")
                break
            else:
                terms.append(f"{name} = 0 within rounding ({bound:.1g})")
        sign = {1: "stays >= 0", -1: "goes negative", 0: "is undecided"}[self.side]
        return f"{self.guard} (g = {self.text}) {sign}: {', '.join(terms)}"


@dataclass(frozen=True)
class Candidate:
    """Modes that could hold just after, and what their guards say of it."""

    modes: dict[str, str]
    verdict: str
    guards: tuple[GuardView, ...]


@dataclass(frozen=True)
class Explanation:
    """Why an event went as it did; ``print`` it.

    Parameters
    ----------
    event : what is explained.
    fired : guards that were located at zero, as they went in the mode before.
    candidates : the combinations of modes that were looked at, in the order of looking.
    reason : why the one that was taken, in a sentence.
    """

    event: Event
    fired: tuple[GuardView, ...]
    candidates: tuple[Candidate, ...]
    reason: str

    def __str__(self) -> str:
        lines = [repr(self.event)[1:-1]]
        if self.fired:
            lines.append("  came to zero:")
            lines += [f"    {view.mode}: {view}" for view in self.fired]
        if self.candidates:
            lines.append("  modes that could hold just after:")
        for candidate in self.candidates:
            modes = ", ".join(f"{name} {mode}" for name, mode in candidate.modes.items())
            lines.append(f"    {modes}: {candidate.verdict}")
            lines += [f"      {view.mode}: {view}" for view in candidate.guards]
        return "\n".join([*lines, f"  {self.reason}"])


class _Watched(Settling):
    """A settling that remembers the candidates that it looked at."""

    seen: list[tuple[np.ndarray, list[int], int, np.ndarray]]

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        components = list(components)
        found = super().verdict(z, components)
        decreed = self._decreed(z, self._continuous(z, components))
        self.seen.append((z.copy(), components, found, decreed))
        return found


def explain(solution: Solution, number: int) -> Explanation:
    """The explanation of one of a solution's events; see `Solution.explain`."""
    events = solution.events
    if isinstance(number, bool) or not isinstance(number, int) or not -len(events) <= number < len(events):
        raise UsageError(
            f"the run has {len(events)} events, and event {number!r} is asked for",
            remedy="give the place of one",
        )
    event = events[number]
    if event.kind != "transition":
        return Explanation(event, (), (), _of_another_kind(solution, event))
    happened = [o for o in solution._trajectory.occurrences if o.kind != "corner"]
    occurrence = happened[number]
    together = [o for o in happened if o.instant == occurrence.instant]
    segment = _segment_before(solution, occurrence)
    fired = _fired(solution._system, segment, together)
    if not fired:
        reason = (
            "it was decided by a rule of the integrator's own"
            if not occurrence.guard
            else "a reset led there"
        )
        return Explanation(event, (), (), f"{reason}: no guard was located at zero")
    at = _situation(solution._system, segment, fired)
    views = tuple(
        _views(solution._system, at, segment.z, sorted(fired), np.zeros(solution._system.guard_count, int))
    )
    forward = solution._run.task.forward
    settling = _Watched(solution._system, at, at.z.copy(), forward)
    settling.seen = []
    x_minus = at.x.copy()
    outcome = settling.run(fired, [])
    candidates = tuple(_candidate(settling, *one) for one in settling.seen)
    return Explanation(event, views, candidates, _reason(solution, occurrence, settling, outcome, x_minus))


def _of_another_kind(solution: Solution, event: Event) -> str:
    if event.kind == "monitor":
        way = "rose" if event.direction > 0 else "fell"
        return f"the monitor {event.component} {way} through zero; it changes no mode"
    if event.kind == "scheduled":
        return f"the schedule {event.component} was due; it was stepped to, not searched for"
    return (
        f"guard {event.guard} of {event.component} came within rounding of zero and turned back: no event, "
        "but a slightly different run may have one here"
    )


def _segment_before(solution: Solution, occurrence: Occurrence) -> Segment:
    """The segment that the event ended."""
    if solution._save != "all":
        raise UsageError(
            f"the run was made with save={solution._save!r}",
            remedy="run it with save='all' to have events explained",
        )
    segments, ends = solution._segments, solution._ends
    for k in np.flatnonzero(ends == float(occurrence.instant)):
        segment = segments[int(k)]
        if abs(segment.end.minus(occurrence.instant)) == 0.0 and len(segment.s) > 1:
            return segment
    raise UsageError(
        f"no segment ends at t = {float(occurrence.instant)!r}",
        remedy="an event at the start of a run has no past",
    )


def _fired(system: System, segment: Segment, together: list[Occurrence]) -> list[int]:
    """Numbers of the guards that fired at one instant, in the modes of the segment before."""
    found = []
    for o in together:
        c = next((k for k, a in enumerate(system.automata) if a.name == o.component), -1)
        if c < 0 or not o.guard:
            continue
        mode = int(segment.z[c])
        if o.guard in system.automata[c].guard_names[mode]:
            found.append(system.automata[c].guards[mode][system.automata[c].guard_names[mode].index(o.guard)])
    return found


def _situation(system: System, segment: Segment, fired: list[int]) -> Situation:
    """The state before, with bounds of its rounding as the run itself has them."""
    s, x = float(segment.s[-1]), segment.x[-1].copy()
    s_error = 2.0 * math.ulp(s)
    series = system.series(s, x, segment.p, segment.z, np.zeros(system.n), 0.0)
    for value, slope, *_ in (series.guards[g] for g in fired):
        if slope != 0.0 and math.isfinite(value / slope):
            s_error = max(s_error, abs(value / slope))
    slopes = np.abs(system.flow(s, x, segment.p, segment.z)) if system.n else np.zeros(0)
    x_error = 4.0 * UNIT * np.abs(segment.x).max(axis=0) + s_error * slopes
    held = system.evaluated(segment.z)
    x_error[held] = UNIT * np.abs(x[held])
    return Situation(s, x, segment.p.copy(), segment.z.copy(), x_error, s_error)


def _views(
    system: System, at: Situation, z: np.ndarray, guards: list[int], decreed: np.ndarray
) -> Iterable[GuardView]:
    series = system.series(at.s, at.x, at.p, z, at.x_error, at.s_error)
    for g in guards:
        c = int(system.owner[g])
        automaton, mode = system.automata[c], int(z[c])
        j = automaton.guards[mode].index(g)
        values, bounds = series.guards[g], series.guard_bounds[g]
        side, order = side_after(values, bounds, int(decreed[g]))
        factorials = [math.factorial(k) for k in range(len(values))]
        yield GuardView(
            f"{automaton.name} {automaton.modes[mode]}",
            automaton.guard_names[mode][j],
            _in_words(system.model.all_components()[c].modes[mode].guards[j].expr.text),
            tuple(float(v) * f for v, f in zip(values, factorials, strict=True)),
            tuple(float(b) * f for b, f in zip(bounds, factorials, strict=True)),
            int(decreed[g]),
            int(side),
            int(order),
        )


def _in_words(text: str) -> str:
    """The expression of a guard; that of a surface's attraction is one of the program's own."""
    return f"pull of {text.removeprefix(ATTRACTION)}" if text.startswith(ATTRACTION) else text


def _candidate(
    settling: _Watched, z: np.ndarray, components: list[int], verdict: int, decreed: np.ndarray
) -> Candidate:
    system = settling.system
    guards = [g for c in components for g in system.automata[c].guards[z[c]]]
    views = tuple(_views(system, settling.at, z, guards, decreed))
    modes = {system.automata[c].name: system.automata[c].modes[z[c]] for c in components}
    return Candidate(modes, _WORDS.get(verdict, "a question of rounding"), views)


def _reason(
    solution: Solution, occurrence: Occurrence, settling: _Watched, outcome: Outcome, x_minus: np.ndarray
) -> str:
    system = settling.system
    if outcome.status:
        return f"the run ended here: {outcome.message}"
    names = [a.name for a in system.automata]
    c = names.index(occurrence.component)
    automaton = system.automata[c]
    after = automaton.modes[outcome.z[c]]
    changed = ", ".join(
        f"{name} from {a:.6g} to {b:.6g}"
        for name, a, b in zip(system.names, x_minus, outcome.x, strict=True)
        if a != b
    )
    if automaton.is_unilateral and changed and occurrence.source != automaton.modes[automaton.hold]:
        return f"an impact: its impulses change {changed}; {after} just after"
    if not automaton.has_surface:
        reset = f", with {changed}" if changed else ""
        return f"the first choice of guard {occurrence.guard} whose condition held leads to {occurrence.target}{reset}"
    admissible = [z for z, members, verdict, _ in settling.seen if c in members and verdict == FINE]
    if len(admissible) == 1:
        return f"{after} is the only mode that is admissible just after"
    if any(z[c] == automaton.hold for z in admissible) and outcome.z[c] == automaton.hold:
        return f"{after} and others are admissible; what holds comes before what slips"
    if not admissible:
        return (
            f"{after} is a question of rounding, and nothing else is better: the mode is kept where it can be"
        )
    return f"{after} is admissible, and the motion that is nearest to the one before"
