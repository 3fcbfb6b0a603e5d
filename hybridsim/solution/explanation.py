"""Why an event went as it did: the decision made once more, with everything that it looked at."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.accumulation import SAME_FACTOR, turn_of
from hybridsim.engine.decide import FINE, LEAVES, side_after
from hybridsim.engine.gathering import LIMIT
from hybridsim.engine.jets import UNIT
from hybridsim.engine.outcome import Outcome, Situation
from hybridsim.engine.settle import Settling
from hybridsim.errors import UsageError
from hybridsim.model.impact import SPEED
from hybridsim.model.one_sided import number_of
from hybridsim.model.switching import ATTRACTION
from hybridsim.model.units import rate_of, time_unit, unit_of, units_of
from hybridsim.solution.one_instant import (
    BY_RESET,
    change_of,
    changes_in_words,
    fired_guards,
    resets_before,
)

if TYPE_CHECKING:
    from hybridsim.engine.outcome import Change
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.system import System
    from hybridsim.model.component import Choice
    from hybridsim.solution.event import Event
    from hybridsim.solution.solution import Solution

_LEGEND = """\
  (a mode lasts while its guards g are >= 0; g', g'' are their rates along the motion in that mode, and the first that
  is not zero decides; exactly: the event itself makes it zero, so that there is no rounding in it)"""
_WORDS = {FINE: "admissible", LEAVES: "not admissible"}
_SERIES = 12  # events that are looked at to say how they accumulated


@dataclass(frozen=True)
class GuardView:
    """A guard along the flow of one mode, at the instant of an event.

    Parameters
    ----------
    mode, guard, text : whose guard it is, and its expression.
    derivatives, bounds : its value and derivatives with respect to time (4,), and bounds of their rounding errors.
    decreed : how many of them, from the first on, the event itself makes zero: they are not looked at.
    side : its sign just after, 0 where that is a question of rounding; order : of the derivative that decides.
    units : of the guard and its derivatives (4,), empty where they are not known.
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
        """Whether its sign just after is a question of rounding: nothing decides, and it is not zero identically."""
        left = (*self.derivatives[self.decreed :], *self.bounds[self.decreed :])
        return self.side == 0 and any(left)

    def __str__(self) -> str:
        if not self.is_open and self.side == 0:
            still = "g = 0 exactly" if self.decreed else "g = 0"
            return f"{self.guard} (g = {self.text}) stays >= 0: {still} and does not move"
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
    """Modes that could hold just after, what their guards say of it, and whether they were taken."""

    modes: dict[str, str]
    verdict: str
    guards: tuple[GuardView, ...]
    taken: bool = False


@dataclass(frozen=True)
class Explanation:
    """Why an event went as it did; ``print`` it.

    Parameters
    ----------
    event : Event
        What is explained.
    fired : tuple of GuardView
        Guards that were located at zero, as they went in the mode before.
    candidates : tuple of Candidate
        The combinations of modes that were looked at, in the order of looking.
    reason : str
        Why the one that was taken, in a sentence.
    state : str, optional
        States just before, and what a condition or a contact reads, as text with units.
    choices : tuple of str, optional
        Of a guard with an ordered choice, in words: each condition with its values, and what came of it.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.simulate("dfcs", (0, 0.1)).explain(0).reason
    'slip+ is the only mode that is admissible just after'
    """

    event: Event
    fired: tuple[GuardView, ...]
    candidates: tuple[Candidate, ...]
    reason: str
    state: str = ""
    choices: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [repr(self.event)[1:-1]]
        if self.state:
            lines.append(f"  just before: {self.state}")
        if self.fired:
            lines.append("  came to zero:")
            lines += [f"    {view.mode}: {view}" for view in self.fired]
        if self.candidates:
            lines.append("  modes that could hold just after:")
        for candidate in self.candidates:
            modes = ", ".join(f"{name} {mode}" for name, mode in candidate.modes.items())
            lines.append(f"    {modes}: {candidate.verdict}{', and taken' if candidate.taken else ''}")
            lines += [f"      {view.mode}: {view}" for view in candidate.guards]
        if self.choices:
            lines.append(f"  choices of guard {self.event.guard}, the first that holds is taken:")
            lines += [f"    {choice}" for choice in self.choices]
        lines.append(f"  so: {self.reason}")
        if self.fired or self.candidates:
            lines.append(_LEGEND)
        return "\n".join(lines)


class _Watched(Settling):
    """A settling that remembers the candidates that it looked at, which are all."""

    is_thorough = True
    seen: list[tuple[np.ndarray, list[int], int, np.ndarray]]

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        components = list(components)
        found = super().verdict(z, components)
        decreed = self._decreed(z, self._continuous(z, components))
        self.seen.append((z.copy(), components, found, decreed))
        return found


def explain(solution: Solution, number: int | Event) -> Explanation:
    """The explanation of one of a solution's events; see `Solution.explain`."""
    events = solution.events
    if number in events:
        number = events.index(number)
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
    if event.guard == LIMIT and (segment is None or not _is_declared(solution, event)):
        return Explanation(event, (), (), _of_accumulation(solution, event), _state(solution, event))
    if segment is None:
        raise UsageError(
            f"no segment ends at t = {event.t!r}", remedy="an event at the start of a run has no past"
        )
    fired = fired_guards(solution._system, segment, together, solution._run.method)
    state = _state(solution, event)
    if not fired:
        return Explanation(event, (), (), _without_guards(solution, event, together), state)
    at = _situation(solution._system, segment, fired)
    fired += _met(solution._system, at, fired)
    views = tuple(
        _views(solution._system, at, segment.z, sorted(fired), np.zeros(solution._system.guard_count, int))
    )
    forward = solution._run.task.forward
    settling = _Watched(solution._system, at, at.z.copy(), forward)
    settling.seen = []
    x_minus, x_error, choices = at.x.copy(), at.x_error.copy(), _choices(solution, event, at)
    then, taken = _taken(solution, event, at)
    resets = then[taken].reset if then else {}
    outcome = settling.run(fired, [])
    owners = {int(solution._system.owner[g]) for g in fired}
    touched = owners | set(np.flatnonzero(outcome.z != segment.z).tolist())
    seen = [one for one in settling.seen if touched & set(one[1])]
    candidates = tuple(_candidate(settling, outcome, *one) for one in seen)
    change, x_plus = change_of(settling, occurrence), outcome.x
    if change is not None and not solution._system.automata[change.component].has_surface:
        x_minus, x_plus = change.x_minus, change.x_plus  # its own round: others may go before it, or follow
    texts = {name: f" (= {reset.text})" for name, reset in resets.items() if reset.names}
    # less than the error is what rounding left of a zero, set exactly
    changed = changes_in_words(solution.names, x_minus, x_plus, x_error, texts)
    blow = next((view for view in views if view.mode == f"{event.component} {event.source}"), None)
    reason = _reason(solution, occurrence, settling, outcome, changed, choices, blow, candidates, change)
    return Explanation(event, views, candidates, reason, state, choices)


def _is_declared(solution: Solution, event: Event) -> bool:
    """Whether the mode that an event left declares the guard that it names."""
    component = next(c for c in solution.model.all_components() if c.name == event.component)
    return any(guard.name == event.guard for guard in component.mode(event.source).guards)


def _of_accumulation(solution: Solution, event: Event) -> str:
    """What led to an instant at which no segment ends: the limit of a series of events."""
    times = [e.t for e in solution.events if e.kind == "transition" and e.t < event.t]
    gaps = [b - a for a, b in pairwise(times[-_SERIES:]) if b > a]
    turn, factor = turn_of(gaps, 3, 2.0 * SAME_FACTOR)
    shown = ", ".join(f"{gap:.3g}" for gap in gaps[-4:])
    every = "each" if turn == 1 else f"every {turn} of them"
    series = f", {every} shorter by the factor {factor:.6g}" if turn else ""
    component = next(c for c in solution.model.all_components() if c.name == event.component)
    end = ", as its limit is declared" if component.limit else ""
    return (
        f"events accumulate: the last intervals between them are {shown}{series}; they add up to t = {event.t!r}, "
        f"and {event.target} is entered there{end}"
    )


def _without_guards(solution: Solution, event: Event, together: list[Occurrence]) -> str:
    """Why a mode changed where no guard was located at zero."""
    due = sorted({o.component for o in together if o.kind == "scheduled"})
    if due:
        return f"{', '.join(due)} was due at this instant; the modes that hold were found anew just after it"
    if event.guard and any(o.kind == "monitor" for o in together):
        return "a reset at this instant led there: no guard was located at zero"
    if solution.model.inputs and solution._run.method.leaps:
        names = ", ".join(declared.name for declared in solution.model.inputs)
        return f"no guard came to zero by itself: an input has a knot here (of {names}), and the modes were found anew"
    return "it was decided by a rule of the integrator's own: no guard was located at zero"


def _state(solution: Solution, event: Event) -> str:
    """The states just before, with their units."""
    units = units_of(solution.model)
    return ", ".join(
        f"{name} = {_with_unit(value, units.get(name, ''))}"
        for name, value in zip(solution.names, event.x_minus, strict=True)
    )


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}".rstrip()


def _taken(solution: Solution, event: Event, at: Situation) -> tuple[tuple[Choice, ...], int]:
    """The ordered choice of the guard that fired, and the place in it of what was taken; empty where it has none."""
    component = next((c for c in solution.model.all_components() if c.name == event.component), None)
    mode = next((m for m in component.modes if m.name == event.source), None) if component else None
    guard = next((g for g in mode.guards if g.name == event.guard), None) if mode else None
    if component is None or mode is None or guard is None or not guard.then:
        return (), 0
    system = solution._system
    number = [a.name for a in system.automata].index(event.component)
    place = component.modes.index(mode), mode.guards.index(guard)
    return guard.then, system.choose(number, *place, at.s, at.x, at.p, at.z)


def _choices(solution: Solution, event: Event, at: Situation) -> tuple[str, ...]:
    """The ordered choice of the guard that fired, if it has more than one: conditions, values, and what was taken."""
    then, taken = _taken(solution, event, at)
    if len(then) < 2:
        return ()
    model = solution.model
    known = dict(zip(solution.names, event.x_minus.tolist(), strict=True)) | model.parameter_values()
    units = units_of(model) | {q.name: q.unit for q in model.parameters}
    lines = []
    for k, choice in enumerate(then):
        said = "in all other cases"
        if choice.when is not None:
            read = [n for n in sorted(choice.when.names) if n in known]
            values = ", ".join(f"{n} = {_with_unit(known[n], units.get(n, ''))}" for n in read)
            said = f"when {choice.when.text}" + (f" ({values})" if values else "")
        came = "does not hold" if k < taken else "holds, and is taken" if k == taken else "is not reached"
        lines.append(f"{said}: {came} -> {choice.to}")
    return tuple(lines)


def _restitution(solution: Solution, settling: _Watched, outcome: Outcome, c: int, blow: GuardView) -> str:
    """How fast a gap closed and how fast it opens, and by which restitution."""
    system, automaton = settling.system, settling.system.automata[c]
    declared = next(i for i in solution.model.impacts if i.name == automaton.name).restitution
    z = outcome.z.copy()
    z[c] = 1 - automaton.hold  # open: it alone has the gap for a guard
    guard = automaton.guards[z[c]][0]
    at = replace(settling.at, x=outcome.x)
    (after,) = _views(system, at, z, [guard], np.zeros(system.guard_count, int))
    before, unit = -blow.derivatives[1], blow.units[1]
    known = solution.model.parameter_values() | {SPEED: before}
    value = number_of(declared.tree, known, {n: expr.tree for n, expr in solution.model.definitions}.get)
    e = declared.text if value is None or not declared.names else f"{declared.text} = {value:.6g}"
    speeds = [f"{max(speed, 0.0):.6g} {unit}".rstrip() for speed in (before, after.derivatives[1])]
    return f" with restitution {e}, the gap closing at {speeds[0]} and opening at {speeds[1]}"


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


def _segment_before(solution: Solution, occurrence: Occurrence) -> Segment | None:
    """The segment that the event ended; None where it ended none."""
    if solution._save != "all":
        raise UsageError(
            f"the run was made with save={solution._save!r}",
            remedy="run it with save='all' to have events explained",
        )
    segments = solution._segments
    last = int(np.searchsorted(solution._starts, float(occurrence.instant), side="right"))
    for k in range(last - 1, max(last - 4, -1), -1):  # behind it there may be segments of no length
        segment = segments[k]
        if abs(segment.end.minus(occurrence.instant)) == 0.0 and len(segment.s) > 1:
            return segment
    return None


def _met(system: System, at: Situation, fired: list[int]) -> list[int]:
    """Further guards that came to zero with those that fired and would go negative, whether or not a mode changed."""
    series = system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    found = []
    for g in np.flatnonzero(system.active(at.z)):
        side, order = side_after(series.guards[g], series.guard_bounds[g], 0)
        if side < 0 < order and g not in fired and not system.is_corner[system.owner[g]]:
            found.append(int(g))
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
    time = time_unit(system.model)
    for g in guards:
        c = int(system.owner[g])
        automaton, mode = system.automata[c], int(z[c])
        j = automaton.guards[mode].index(g)
        values, bounds = series.guards[g], series.guard_bounds[g]
        side, order = side_after(values, bounds, int(decreed[g]))
        declared = system.model.all_components()[c].modes[mode].guards[j].expr
        unit = "" if declared.text.startswith(ATTRACTION) else unit_of(system.model, declared)
        factorials = [math.factorial(k) for k in range(len(values))]
        yield GuardView(
            f"{automaton.name} {automaton.modes[mode]}",
            automaton.guard_names[mode][j],
            _in_words(declared.text),
            tuple(float(v) * f for v, f in zip(values, factorials, strict=True)),
            tuple(float(b) * f for b, f in zip(bounds, factorials, strict=True)),
            int(decreed[g]),
            int(side),
            int(order),
            tuple(rate_of(unit, time, k) for k in range(len(values))),
        )


def _in_words(text: str) -> str:
    """The expression of a guard; that of a surface's attraction is one of the program's own."""
    if not text.startswith(ATTRACTION):
        return text
    return f"pull of {text.removeprefix(ATTRACTION)}, half the sum of how fast its two sides drive towards it"


def _candidate(
    settling: _Watched,
    outcome: Outcome,
    z: np.ndarray,
    components: list[int],
    verdict: int,
    decreed: np.ndarray,
) -> Candidate:
    system = settling.system
    guards = [g for c in components for g in system.automata[c].guards[z[c]]]
    views = tuple(_views(system, settling.at, z, guards, decreed))
    modes = {system.automata[c].name: system.automata[c].modes[z[c]] for c in components}
    taken = not outcome.status and bool((z[components] == outcome.z[components]).all())
    return Candidate(modes, _WORDS.get(verdict, "a question of rounding"), views, taken)


def _reason(
    solution: Solution,
    occurrence: Occurrence,
    settling: _Watched,
    outcome: Outcome,
    changed: str,
    choices: tuple[str, ...],
    blow: GuardView | None,
    candidates: tuple[Candidate, ...],
    change: Change | None,
) -> str:
    system = settling.system
    if outcome.status:
        return f"the run ended here: {outcome.message}"
    names = [a.name for a in system.automata]
    c = names.index(occurrence.component)
    automaton = system.automata[c]
    after = automaton.modes[outcome.z[c]]
    led = resets_before(settling, change) if change is not None else ""
    if change is not None and change.guard == BY_RESET:
        is_contact = any(contact.name == automaton.name for contact in solution.model.contacts)
        gave = "gave it a velocity" if is_contact else "moved the state off its surface"
        gave += f", to the side of {occurrence.target}: nothing is left to decide"
        return f"{led or 'a reset at this instant'} {gave}"
    if automaton.is_unilateral and changed and occurrence.source != automaton.modes[automaton.hold]:
        if after != occurrence.target:  # the run had it closer to the rounding of its own steps
            return f"an impact after which the gap opens by less than its rounding: {occurrence.target} from here on"
        said = _restitution(solution, settling, outcome, c, blow) if blow else ""
        return f"an impact{said}: its impulses change {changed}; {after} just after"
    if not automaton.has_surface:
        reset = f", with {changed}" if changed else ""
        first = "the first choice of guard {} whose condition held leads" if choices else "guard {} leads"
        leads = f"{first.format(occurrence.guard)} to {occurrence.target}{reset}"
        if blow is not None:
            return leads
        return f"{led or 'what else happened at this instant'} made the guard leave: it was not at zero before; {leads}"
    whose = f"{automaton.name} {after}" if len(names) > 1 else after
    admissible = [z for z, members, verdict, _ in settling.seen if c in members and verdict == FINE]
    if len(admissible) == 1:
        members = next(m for z, m, verdict, _ in settling.seen if c in m and verdict == FINE)
        if len(members) > 1:
            all_of_them = ", ".join(f"{names[k]} {system.automata[k].modes[outcome.z[k]]}" for k in members)
            return f"{all_of_them} together: of all combinations of what acts on each other the only admissible one"
        return f"{whose} is the only mode that is admissible just after"
    if not admissible:
        views = (view for one in candidates if one.taken for view in one.guards)
        still_open = " and ".join(dict.fromkeys(view.mode for view in views if view.is_open)) or whose
        return f"{still_open}: a question of rounding, and nothing else is better: a mode is kept where it can be"
    fine = [one for one in candidates if one.verdict == _WORDS[FINE] and automaton.name in one.modes]
    ways = [", ".join(f"{name} {mode}" for name, mode in one.modes.items()) for one in fine]
    taken = next((way for way, one in zip(ways, fine, strict=True) if one.taken), whose)
    return (
        f"{' and '.join(f'({way})' for way in ways)} are admissible, and ({taken}) is taken: the fewest modes change, "
        "and where as many do, what holds comes before what slips"
    )
