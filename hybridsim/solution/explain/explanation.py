"""This module explains an event by repeating its decision, and shows every quantity that was used."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after
from hybridsim.engine.events.zeno.accumulation import SAME_FACTOR, turn_of
from hybridsim.engine.events.zeno.limits import LIMIT
from hybridsim.engine.system.automaton import CORNER
from hybridsim.errors import UsageError
from hybridsim.expr import assignment
from hybridsim.model.checks.units import label_of, units_of
from hybridsim.presentation.readable import Readable
from hybridsim.solution.event import Event
from hybridsim.solution.explain.candidate import candidate, views
from hybridsim.solution.explain.grazing import grazed
from hybridsim.solution.explain.impact_text import errors_beside, is_struck
from hybridsim.solution.explain.monitor_way import way_of_monitor
from hybridsim.solution.explain.one_instant import BY_RESET, at_same_instant, changes_text, fired_guards
from hybridsim.solution.explain.reason import reason
from hybridsim.solution.explain.remarks import change_of_side, remarks
from hybridsim.solution.explain.stages import place_of, situation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hybridsim.engine.events.outcome import Situation
    from hybridsim.engine.record.segments import Occurrence, Segment
    from hybridsim.engine.system.system import System
    from hybridsim.model.parts.component import Choice
    from hybridsim.model.parts.monitor import Monitor
    from hybridsim.model.parts.schedule import Schedule
    from hybridsim.solution.explain.candidate import Candidate, GuardView
    from hybridsim.solution.explain.recorded_resolution import Decision
    from hybridsim.solution.explain.stages import Place
    from hybridsim.solution.solution import Solution

_LEGEND = """\
  (a mode holds while its guards g are >= 0; g' and g'' are the time derivatives of g in that mode, and the first one
   that is not zero decides; exactly: the event itself makes the value zero, without rounding error)"""
_SERIES = 24  # events that are used to describe an accumulation


@dataclass(frozen=True)
class Explanation(Readable):
    """The reason for an event and the quantities that decided it, as text for `print`.

    Parameters
    ----------
    event : Event
        The explained event.
    fired : tuple of GuardView
        Guards that were located at zero, in the mode before; for a near-grazing, the guard that came near zero.
    candidates : tuple of Candidate
        The combinations of modes that the deciding choice judged, in their order.
    reason : str
        Why the chosen combination was taken, in one sentence.
    state : str, optional
        States just before the event, and the values that a condition or a contact reads, as text with units.
    choices : tuple of str, optional
        For a guard with an ordered choice: each condition with its values and its outcome, as text.
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
            when = "there" if is_near else "just after the previous event" if is_limit else "just before"
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
            lines.append(f"  choices of guard {self.event.guard}; the first whose condition holds is taken:")
        lines += [f"  note: {remark}" for remark in self.remarks]
        lines.append(f"  so: {self.reason}")
        if (self.fired or self.candidates) and not is_near:
            lines.append(_LEGEND)
        return "\n".join(lines)


def explain(solution: Solution, number: int | Event) -> Explanation:
    """Return the explanation of one event of a solution, as `Solution.explain` does."""
    events, occurrences = solution.events, solution._of_model.occurrences
    if isinstance(number, Event) and number in solution.corners:
        k = [i for i, o in enumerate(occurrences) if o.kind == CORNER][solution.corners.index(number)]
        corner = occurrences[k]
        found = Explanation(number, (), (), change_of_side(solution, corner), _state(solution, number))
        return replace(found, remarks=remarks(solution, corner, at_same_instant(occurrences, k)))
    if isinstance(number, Event) and number in events:
        number = events.index(number)
    if isinstance(number, bool) or not isinstance(number, int) or not -len(events) <= number < len(events):
        raise UsageError(
            f"there is no event {number!r}: the run has {len(events)} events",
            remedy=f"use a number from 0 to {len(events) - 1}, or -1 for the last" if events else None,
        )
    k = solution._of_model.event_positions[number]
    together = at_same_instant(occurrences, k)
    found = _explained(solution, events[number], occurrences[k], [o for o in together if o.kind != CORNER])
    return replace(found, remarks=remarks(solution, occurrences[k], together))


def _explained(
    solution: Solution, event: Event, occurrence: Occurrence, together: list[Occurrence]
) -> Explanation:
    """Return the explanation without remarks; `together` contains the records of all events of the same instant."""
    if event.kind == "near-grazing":
        near, why = grazed(solution, occurrence), _of_another_kind(solution, event, occurrence)
        return Explanation(event, near, (), why, _state(solution, event))
    if event.kind != "transition":
        return Explanation(event, (), (), _of_another_kind(solution, event, occurrence))
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
        x_minus, x_plus = (
            change.x_minus,
            change.x_plus,
        )  # its own round: other changes of the instant may precede or follow it
    texts = {name: f" ({assignment('', reset).strip()})" for name, reset in resets.items() if reset.names}
    # A smaller change is rounding left over by a zero that was set exactly.
    error = (
        errors_beside(stage, change.component)
        if change is not None and is_struck(system, change)
        else at.x_error
    )
    changed = changes_text(solution.names, x_minus, x_plus, error, texts)
    impact_guard = next(
        (view for view in fired_views if view.mode == f"{event.component} {event.source}"), None
    )
    why = reason(solution.model, occurrence, place, decision, changed, bool(choices), impact_guard)
    return Explanation(event, fired_views, candidates, why, state, choices)


def _decision(place: Place, occurrence: Occurrence) -> Decision | None:
    """Return the decision that changed a mode or followed an impact, or None if there was no decision."""
    resolution, change = place.stage.resolution, place.change
    system = resolution.system
    c = next(k for k, a in enumerate(system.automata) if a.name == occurrence.component)
    if change is None:
        return resolution.decision_after(c, -1)
    number = next(k for k, one in enumerate(resolution.changes) if one is change)
    found = resolution.decision_of(c, number)
    if found is None and system.is_unilateral[c] and change.guard != BY_RESET:
        found = resolution.decision_after(c, number)
        if found is not None and any(
            one.component == c for one in resolution.changes[found.first : found.last]
        ):
            return None  # which has an event of its own
    return found


def _is_declared(solution: Solution, event: Event) -> bool:
    """Return whether the guard that an event names is declared in the mode that the event left."""
    component = next(c for c in solution.components if c.name == event.component)
    return any(guard.name == event.guard for guard in component.mode(event.source).guards)


def _of_accumulation(solution: Solution, event: Event) -> str:
    """Explain an accumulation of events, which does not end a segment."""
    times = [e.t for e in solution.events if e.kind == "transition" and e.t < event.t]
    gaps = [b - a for a, b in pairwise(times[-_SERIES:]) if b > a]
    clear_gaps = takewhile(
        lambda gap: gap * SAME_FACTOR > math.ulp(event.t), gaps
    )  # smaller gaps are affected by rounding of the instants
    turn, factor = turn_of(list(clear_gaps), 3, 2.0 * SAME_FACTOR)
    shown = ", ".join(f"{gap:.3g}" for gap in gaps[-4:])
    every = "each" if turn == 1 else f"every {turn} of them"
    series = f", {every} shorter by the factor {factor:.6g}" if turn else ""
    component = next(c for c in solution.components if c.name == event.component)
    end = ", as declared by its limit" if component.limit else ""
    return (
        f"events accumulate: the last intervals between them are {shown}{series}; the event times "
        f"converge to t = {event.t!r}, "
        f"and mode {event.target} begins there{end}"
    )


def _without_a_segment(solution: Solution, event: Event) -> str:
    """Explain a change of mode without a motion before it, as at the start of a run."""
    if event.t == solution.t[0]:
        return (
            "the run starts here: the sides of corners and the admissible modes are found from the initial values, "
            "before anything moves"
        )
    if not solution.success and event.t == solution.t[-1]:
        return f"the run ended here: {solution.message}"
    return "the change followed the earlier events of this instant immediately: no time passed between them"


def _without_guards(solution: Solution, event: Event, together: list[Occurrence]) -> str:
    """Explain a change of mode for which no guard was located at zero."""
    due = sorted({o.component for o in together if o.kind == "scheduled"})
    if due:
        return f"{', '.join(due)} was due at this instant; the modes just after it were determined again"
    if event.guard and any(o.kind == "monitor" for o in together):
        return "a reset at this instant changed the mode: no guard was located at zero"
    if solution.model.inputs and solution._run.method.has_compiled_loop:
        names = ", ".join(declared.name for declared in solution.model.inputs)
        return (
            f"no guard reached zero: an input has a knot here ({names}), and the modes were determined again"
        )
    return "the integrator changed the mode by its own rule: no guard was located at zero"


def _state(solution: Solution, event: Event) -> str:
    """Return the states just before an event as text with units."""
    units = units_of(solution.model)
    return ", ".join(
        f"{name} = {_with_unit(value, units.get(name, ''))}"
        for name, value in zip(solution.names, event.x_minus, strict=True)
    )


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}".rstrip()


def _taken(solution: Solution, event: Event, at: Situation) -> tuple[tuple[Choice, ...], int]:
    """Return the choices of the guard that fired, and the index of the choice that was taken."""
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
    """Describe the choices of the guard that fired: conditions, the values of the conditions, and the outcome."""
    then, taken = _taken(solution, event, at)
    if len(then) < 2:
        return ()
    model = solution.model
    known = dict(zip(solution.names, event.x_minus.tolist(), strict=True)) | model.parameter_values()
    units = units_of(model) | {q.name: label_of(q.unit) for q in model.parameters}
    lines = []
    for k, choice in enumerate(then):
        condition = "in all other cases"
        if choice.when is not None:
            read = [n for n in sorted(choice.when.names) if n in known]
            values = ", ".join(f"{n} = {_with_unit(known[n], units.get(n, ''))}" for n in read)
            condition = f"when {choice.when.text}" + (f" ({values})" if values else "")
        came = "does not hold" if k < taken else "holds, and is taken" if k == taken else "is not reached"
        lines.append(f"{condition}: {came} -> {choice.to}")
    return tuple(lines)


def _of_another_kind(solution: Solution, event: Event, occurrence: Occurrence) -> str:
    if event.kind == "monitor":
        way = way_of_monitor(solution, event, occurrence)
        sets = _sets(event, solution.model.monitors)
        return f"the monitor {event.component} {way}; it changes no mode" + sets
    if event.kind == "scheduled":
        sets = _sets(event, solution.model.schedules)
        return f"the schedule {event.component} was due; a step ended exactly there, without a search" + sets
    return (
        f"guard {event.guard} of {event.component} came within rounding of zero and turned back: there "
        "is no event, "
        "but a slightly different run may have one here"
    )


def _sets(event: Event, parts: Sequence[Monitor | Schedule]) -> str:
    """Describe the reset that a monitor or a schedule declares, or return an empty text."""
    part = next((part for part in parts if part.name == event.component), None)
    resets = part.reset.items() if part else ()
    values = ", ".join(assignment(name, value) for name, value in resets)
    return f"; it sets {values}" if values else ""


def _segment_before(solution: Solution, occurrence: Occurrence) -> Segment | None:
    """Return the segment that ends with an event, or None."""
    if solution._save != "all":
        raise UsageError(
            f"the run was made with keep={solution._save!r}, but explain() needs the whole run",
            remedy="repeat the run with keep='all'",
        )
    segments = solution._segments
    last = int(np.searchsorted(solution._of_model.frame.starts, float(occurrence.instant), side="right"))
    for k in range(last - 1, max(last - 4, -1), -1):  # segments of zero length may follow it
        segment = segments[k]
        if abs(segment.end.minus(occurrence.instant)) == 0.0 and len(segment.s) > 1:
            return segment
    return None


def _met(system: System, at: Situation, fired: list[int]) -> list[int]:
    """Return further guards that are zero at the event and would become negative just after it."""
    series = system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    found = []
    for g in np.flatnonzero(system.active(at.z)):
        side, order = side_after(series.guards[g], series.guard_bounds[g], 0)
        if side < 0 < order and g not in fired and not system.is_corner[system.owner[g]]:
            found.append(int(g))
    return found
