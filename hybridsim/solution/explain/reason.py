"""This module explains an event in one sentence: its cause, and the rule by which the mode was chosen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from hybridsim.engine.events.choice.verdict import FINE
from hybridsim.engine.events.outcome import Change
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.system.system import System
from hybridsim.model import Model
from hybridsim.solution.explain.candidate import GuardView, views, way
from hybridsim.solution.explain.impact_text import errors_beside, friction, is_struck, restitution
from hybridsim.solution.explain.one_instant import BY_RESET, changes_text, resets_before
from hybridsim.solution.explain.recorded_resolution import Decision, Look
from hybridsim.solution.explain.stages import Place

_RULE = "fewer changes of mode are preferred, then holding before slipping"


def reason(
    model: Model,
    occurrence: Occurrence,
    place: Place,
    decision: Decision | None,
    changed: str,
    has_choices: bool,
    impact_guard: GuardView | None,
) -> str:
    """Return a sentence with the reason for an event."""
    stage, change = place.stage, place.change
    resolution, outcome = stage.resolution, stage.outcome
    system = resolution.system
    if outcome.status:
        return f"the run ended here: {outcome.message}"
    c = next(k for k, a in enumerate(system.automata) if a.name == occurrence.component)
    automaton = system.automata[c]
    after = automaton.modes[outcome.z[c]]
    led = _Led(*_led(place)) if change is not None else _Led([stage.due] if stage.due else [], [])
    how = change.guard if change is not None and automaton.has_surface else ""
    if how == BY_RESET:
        is_contact = any(contact.name == automaton.name for contact in model.contacts)
        gave = "gave it a velocity" if is_contact else "moved the state off its surface"
        gave += f", to the side of {occurrence.target}, which determines the mode"
        return f"{led.subject or 'a reset at this instant'} {gave}"
    if how == "impact":
        return f"{led.subject or 'an impact at this instant'} made its gap open, which determines the mode"
    if automaton.is_unilateral and changed and occurrence.source != automaton.modes[automaton.hold]:
        # the run knew the rate to within the rounding of its own steps
        if after != occurrence.target and change is None:
            return f"an impact after which the gap opens by no more than rounding: {occurrence.target} from here on"
        text = restitution(model, stage, c, impact_guard) if impact_guard else ""
        text = f"an impact{text}: its impulses change {changed}{friction(stage, c)}; {occurrence.target} just after"
        if decision is not None and len(decision.fine) > 1:
            text += f"; {_of_several(system, decision)}"
        return text
    if not automaton.has_surface:
        reset = f", with {changed}" if changed else ""
        first = "the first choice of guard {} whose condition held leads" if has_choices else "guard {} leads"
        leads = f"{first.format(occurrence.guard)} to {occurrence.target}{reset}"
        if impact_guard is not None:
            return leads
        subject = led.subject or "another event of this instant"
        return f"{subject} made the guard negative (it was not at zero before); {leads}"
    if decision is None:
        return f"{led.start or 'at this instant: '}{occurrence.target} from here on"
    return led.start + _decided(system, decision, c)


class _Led(NamedTuple):
    """The causes of a change: earlier events at the same instant."""

    clauses: list[str]
    nouns: list[str]

    @property
    def subject(self) -> str:
        """Return the causes as the subject of a sentence, or an empty text if there are none."""
        text = " and ".join([*self.clauses, *self.nouns])
        return f"{text}, which" if self.clauses else text

    @property
    def start(self) -> str:
        """Return the causes as the start of a sentence, or an empty text if there are none."""
        after = [f"after {' and '.join(self.nouns)}"] if self.nouns else []
        text = " and ".join([*self.clauses, *after])
        return f"{text}: " if text else ""


def _led(place: Place) -> tuple[list[str], list[str]]:
    """List the causes of a change: due events, transitions, resets and impacts."""
    stage, change = place.stage, place.change
    resolution = stage.resolution
    assert change is not None
    system, changes = resolution.system, resolution.changes
    number = next(k for k, one in enumerate(changes) if one is change)
    is_decided = system.automata[change.component].has_surface
    clauses = [stage.due] if stage.due else []
    clauses += _transitions(system, changes[:number]) if is_decided else []
    resets, struck = resets_before(resolution, change), _impacts(system, changes, change)
    nouns = [resets] if resets else []
    if struck and is_decided:
        error = errors_beside(stage, change.component)
        moved = changes_text(system.names, stage.before.x, stage.outcome.x, error)
        nouns.append(f"the impact of {' and '.join(struck)}" + (f" ({moved})" if moved else ""))
    return clauses, nouns


def _transitions(system: System, changes: Sequence[Change]) -> list[str]:
    """List the transitions of other components that set no state."""
    found = []
    for one in changes:
        automaton = system.automata[one.component]
        if automaton.has_surface or automaton.is_corner or (one.x_minus != one.x_plus).any():
            continue
        found.append(f"guard {one.guard} of {automaton.name} led to {automaton.modes[one.target]}")
    return found


def _impacts(system: System, changes: Sequence[Change], of: Change) -> list[str]:
    """Return the names of the contacts in an impact, except the contact whose change is explained."""
    struck = [one.component for one in changes if is_struck(system, one) and one.component != of.component]
    return [system.automata[c].name for c in struck]


def _decided(system: System, decision: Decision, c: int) -> str:
    """Describe the rule by which the mode of one component was chosen."""
    fine, undecided, taken = decision.fine, decision.undecided, decision.taken
    whose = _whose(system, c, int(decision.z[c]))
    if taken is not None and taken.verdict != FINE:
        shown = _open_modes(system, taken) or whose
        better = "" if fine else "no other combination is better, and "
        return f"{shown}: rounding leaves the choice open; {better}a mode stays if possible"
    if len(fine) > 1:
        return _of_several(system, decision)
    if not fine:
        return f"{whose}: rounding leaves the choice open; no other combination is better, and a mode stays if possible"
    is_joint = len(fine[0].components) > 1
    if not undecided:
        if is_joint:
            alone = "the only admissible one of all combinations of the coupled components"
            return f"{way(system, fine[0])} together: {alone}"
        return f"{whose} is the only mode that is admissible just after"
    what = f"{way(system, fine[0])} together" if is_joint else whose
    return f"{what}: taken, because it is certainly admissible; {_open(system, undecided, fine[0])}"


def _of_several(system: System, decision: Decision) -> str:
    """Describe how one of several admissible combinations was chosen."""
    fine, taken = decision.fine, decision.taken
    ways = " and ".join(f"({way(system, look)})" for look in fine)
    first = taken or fine[0]
    same = all(look.is_as(first) for look in fine)
    rule = f"{ways} are admissible, and ({way(system, first)}) is taken: {_RULE}"
    rule += "; they are the same motion to rounding" if same else ""
    return rule + (f"; {_open(system, decision.undecided, first)}" if decision.undecided else "")


def _open(system: System, undecided: Sequence[Look], taken: Look) -> str:
    """Describe the combinations of modes whose admissibility is uncertain because of rounding."""
    ways = " and ".join(f"({way(system, look)})" for look in undecided)
    are = "is a question" if len(undecided) == 1 else "are questions"
    same = ": the same motion to rounding" if all(look.is_as(taken) for look in undecided) else ""
    return f"{ways} {are} of rounding{same}"


def _open_modes(system: System, look: Look) -> str:
    """Return the modes of a combination whose guards have an uncertain sign."""
    guards = [g for c in look.components for g in system.automata[c].guards[look.z[c]]]
    shown = views(system, look.at, look.z, guards, look.decreed)
    return " and ".join(dict.fromkeys(view.mode for view in shown if view.is_open))


def _whose(system: System, c: int, mode: int) -> str:
    automaton = system.automata[c]
    return f"{automaton.name} {automaton.modes[mode]}" if len(system.automata) > 1 else automaton.modes[mode]
