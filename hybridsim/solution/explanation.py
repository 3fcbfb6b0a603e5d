"""Why an event went as it did: the decision made once more, with everything that it looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.accumulation import SAME_FACTOR, turn_of
from hybridsim.engine.decide import side_after
from hybridsim.engine.gathering import LIMIT
from hybridsim.engine.system import CORNER
from hybridsim.errors import UsageError
from hybridsim.expr import assignment
from hybridsim.model.units import units_of
from hybridsim.readable import Readable
from hybridsim.solution.blow import errors_beside, is_struck
from hybridsim.solution.candidate import candidate, views
from hybridsim.solution.event import Event
from hybridsim.solution.grazing import grazed
from hybridsim.solution.monitor_way import way_of_monitor
from hybridsim.solution.one_instant import BY_RESET, changes_in_words, fired_guards
from hybridsim.solution.reason import reason
from hybridsim.solution.remarks import change_of_side, remarks
from hybridsim.solution.stages import place_of, situation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hybridsim.engine.outcome import Situation
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.system import System
    from hybridsim.model.component import Choice
    from hybridsim.model.monitor import Monitor
    from hybridsim.model.schedule import Schedule
    from hybridsim.solution.candidate import Candidate, GuardView
    from hybridsim.solution.solution import Solution
    from hybridsim.solution.stages import Place
    from hybridsim.solution.watched import Decision

_LEGEND = """\
  (a mode lasts while its guards g are >= 0; g', g'' are their rates along the motion in that mode, and the first that
  is not zero decides; exactly: the event itself makes it zero, so that there is no rounding in it)"""
_SERIES = 24  # events that are looked at to say how they accumulated


@dataclass(frozen=True)
class Explanation(Readable):
    """Why an event went as it did; ``print`` it.

    Parameters
    ----------
    event : Event
        What is explained.
    fired : tuple of GuardView
        Guards that were located at zero, as they went in the mode before; of a near-grazing the one that came near.
    candidates : tuple of Candidate
        The combinations of modes that the decision looked at which made this change, in the order of looking.
    reason : str
        Why the one that was taken, in a sentence.
    state : str, optional
        States just before, and what a condition or a contact reads, as text with units.
    choices : tuple of str, optional
        Of a guard with an ordered choice, in words: each condition with its values, and what came of it.
    remarks : tuple of str, optional
        Sentences about corners whose sides the guards depend on, loads that reach or leave zero, and other events at
        the same instant.

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
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = [repr(self.event)[1:-1]]
        is_near, is_limit = self.event.kind == "near-grazing", self.event.guard == LIMIT
        if self.state:
            when = "there" if is_near else "as the last event before left it" if is_limit else "just before"
            lines.append(f"  {when}: {self.state}")
        if self.fired:
            lines.append("  came near zero:" if is_near else "  came to zero:")
            lines += [f"    {view.mode}: {view.in_numbers() if is_near else view}" for view in self.fired]
        if self.candidates:
            lines.append("  modes that could hold just after:")
        for one in self.candidates:
            modes = ", ".join(f"{name} {mode}" for name, mode in one.modes.items())
            lines.append(f"    {modes}: {one.verdict}{', and taken' if one.taken else ''}")
            lines += [f"      {view.mode}: {view}" for view in one.guards]
        if self.choices:
            lines.append(f"  choices of guard {self.event.guard}, the first that holds is taken:")
            lines += [f"    {choice}" for choice in self.choices]
        lines += [f"  note: {remark}" for remark in self.remarks]
        lines.append(f"  so: {self.reason}")
        if (self.fired or self.candidates) and not is_near:
            lines.append(_LEGEND)
        return "\n".join(lines)


def explain(solution: Solution, number: int | Event) -> Explanation:
    """The explanation of one of a solution's events; see `Solution.explain`."""
    events, occurrences = solution.events, solution._trajectory.occurrences
    if isinstance(number, Event) and number in solution.corners:
        corner = [o for o in occurrences if o.kind == CORNER][solution.corners.index(number)]
        found = Explanation(number, (), (), change_of_side(solution, corner), _state(solution, number))
        return replace(found, remarks=remarks(solution, corner, occurrences))
    if isinstance(number, Event) and number in events:
        number = events.index(number)
    if isinstance(number, bool) or not isinstance(number, int) or not -len(events) <= number < len(events):
        raise UsageError(
            f"the run has {len(events)} events, and event {number!r} is asked for",
            remedy=f"give the place of one, 0 to {len(events) - 1}, or -1 for the last" if events else None,
        )
    happened = [o for o in occurrences if o.kind != CORNER]
    found = _explained(solution, events[number], happened, number)
    return replace(found, remarks=remarks(solution, happened[number], occurrences))


def _explained(solution: Solution, event: Event, happened: list[Occurrence], number: int) -> Explanation:
    """The explanation without the remarks; `happened`: what the events stand for, in their order."""
    if event.kind == "near-grazing":
        near = grazed(solution, happened[number])
        return Explanation(
            event, near, (), _of_another_kind(solution, event, happened[number]), _state(solution, event)
        )
    if event.kind != "transition":
        return Explanation(event, (), (), _of_another_kind(solution, event, happened[number]))
    occurrence = happened[number]
    together = [o for o in happened if o.instant == occurrence.instant]
    segment = _segment_before(solution, occurrence)
    if event.guard == LIMIT and (segment is None or not _is_declared(solution, event)):
        return Explanation(event, (), (), _of_accumulation(solution, event), _state(solution, event))
    if segment is None:
        return Explanation(event, (), (), _without_a_segment(solution, event), _state(solution, event))
    run, system = solution._run, solution._system
    fired = fired_guards(system, segment, together, run.method)
    at = situation(system, segment, fired)
    fired += _met(system, at, fired) if fired else []
    place, state = place_of(run, segment, together, fired, occurrence), _state(solution, event)
    if place is None:
        return Explanation(event, (), (), _without_guards(solution, event, together), state)
    stage, change = place.stage, place.change
    at = stage.before
    fired_views = tuple(views(system, at, segment.z, sorted(stage.fired), np.zeros(system.guard_count, int)))
    decision = _decision(place, occurrence)
    looks = decision.looks if decision is not None else []
    candidates = tuple(candidate(system, decision, look) for look in looks if decision is not None)
    choices = _choices(solution, event, at)
    then, taken = _taken(solution, event, at)
    resets = then[taken].reset if then else {}
    x_minus, x_plus = at.x, stage.outcome.x
    if change is not None and not system.automata[change.component].has_surface:
        x_minus, x_plus = change.x_minus, change.x_plus  # its own round: others may go before it, or follow
    texts = {name: f" ({assignment('', reset).strip()})" for name, reset in resets.items() if reset.names}
    # less than the error is what rounding left of a zero, set exactly
    error = (
        errors_beside(stage, change.component)
        if change is not None and is_struck(system, change)
        else at.x_error
    )
    changed = changes_in_words(solution.names, x_minus, x_plus, error, texts)
    blow = next((view for view in fired_views if view.mode == f"{event.component} {event.source}"), None)
    why = reason(solution.model, occurrence, place, decision, changed, bool(choices), blow)
    return Explanation(event, fired_views, candidates, why, state, choices)


def _decision(place: Place, occurrence: Occurrence) -> Decision | None:
    """The decision that made a change, or that an impact left to be made; None where it was made by a guard."""
    settling, change = place.stage.settling, place.change
    system = settling.system
    c = next(k for k, a in enumerate(system.automata) if a.name == occurrence.component)
    if change is None:
        return settling.decision_after(c, -1)
    number = next(k for k, one in enumerate(settling.changes) if one is change)
    found = settling.decision_of(c, number)
    if found is None and system.is_unilateral[c] and change.guard != BY_RESET:
        found = settling.decision_after(c, number)
        if found is not None and any(
            one.component == c for one in settling.changes[found.first : found.last]
        ):
            return None  # which has an event of its own
    return found


def _is_declared(solution: Solution, event: Event) -> bool:
    """Whether the mode that an event left declares the guard that it names."""
    component = next(c for c in solution.components if c.name == event.component)
    return any(guard.name == event.guard for guard in component.mode(event.source).guards)


def _of_accumulation(solution: Solution, event: Event) -> str:
    """What led to an instant at which no segment ends: the limit of a series of events."""
    times = [e.t for e in solution.events if e.kind == "transition" and e.t < event.t]
    gaps = [b - a for a, b in pairwise(times[-_SERIES:]) if b > a]
    told = takewhile(lambda gap: gap * SAME_FACTOR > math.ulp(event.t), gaps)  # from rounding of the instants
    turn, factor = turn_of(list(told), 3, 2.0 * SAME_FACTOR)
    shown = ", ".join(f"{gap:.3g}" for gap in gaps[-4:])
    every = "each" if turn == 1 else f"every {turn} of them"
    series = f", {every} shorter by the factor {factor:.6g}" if turn else ""
    component = next(c for c in solution.components if c.name == event.component)
    end = ", as its limit is declared" if component.limit else ""
    return (
        f"events accumulate: the last intervals between them are {shown}{series}; they add up to t = {event.t!r}, "
        f"and {event.target} is entered there{end}"
    )


def _without_a_segment(solution: Solution, event: Event) -> str:
    """Why a mode changed at an instant to which no motion leads: the start of a run, or where it ended."""
    if event.t == solution.t[0]:
        return (
            "the run starts here: the sides of corners and the modes that the initial values leave admissible are "
            "found before anything moves"
        )
    if not solution.success and event.t == solution.t[-1]:
        return f"the run ended here: {solution.message}"
    return "it followed at once on the events before it at this instant: nothing moved in between"


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
    component = next((c for c in solution.components if c.name == event.component), None)
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


def _of_another_kind(solution: Solution, event: Event, occurrence: Occurrence) -> str:
    if event.kind == "monitor":
        way = way_of_monitor(solution, event, occurrence)
        sets = _sets(event, solution.model.monitors)
        return f"the monitor {event.component} {way}; it changes no mode" + sets
    if event.kind == "scheduled":
        sets = _sets(event, solution.model.schedules)
        return f"the schedule {event.component} was due; it was stepped to, not searched for" + sets
    return (
        f"guard {event.guard} of {event.component} came within rounding of zero and turned back: no event, "
        "but a slightly different run may have one here"
    )


def _sets(event: Event, parts: Sequence[Monitor | Schedule]) -> str:
    """What the reset of a monitor or a schedule sets, as it is declared; a clock has none that is declared."""
    part = next((part for part in parts if part.name == event.component), None)
    resets = part.reset.items() if part else ()
    values = ", ".join(assignment(name, value) for name, value in resets)
    return f"; it sets {values}" if values else ""


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
