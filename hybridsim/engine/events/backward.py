"""Run backward in time inside modes and through transversal crossings; other events have no unique past."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.engine.events.choice.verdict import LEAVES
from hybridsim.engine.events.outcome import Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.system.system import System


def held(system: System, z: np.ndarray) -> str:
    """Return the reason why a state held at a surface has no unique past, or an empty text if no state is held."""
    names = [a.name for a, m in zip(system.automata, z, strict=True) if a.has_surface and m == a.hold]
    return (
        f"{', '.join(names)} is in a holding mode, which several motions can enter: the past is not unique"
        if names
        else ""
    )


def message_on_direction(t0: float, t1: float) -> str:
    """Return a note for a backward run that stopped early, in case t1 < t0 was a mistake."""
    return (
        f"; this run goes backward in time, from t = {t0!r} to {t1!r}: swap the ends of t_span to run forward"
    )


def entered_here(system: System, z: np.ndarray, fired: tuple[int, ...]) -> str:
    """Return the reason why a component without a surface cannot cross a guard backward in time, or an empty text."""
    for g in fired:
        automaton = system.automata[int(system.owner[g])]
        if not (automaton.has_surface or automaton.is_corner):
            mode = automaton.modes[z[system.owner[g]]]
            return f"mode {mode} of {automaton.name} began here or was entered by a transition: its past is not unique"
    return ""


def has_no_past(
    system: System,
    z: np.ndarray,
    fired: tuple[int, ...],
    stopping: tuple[int, ...],
    schedules: tuple[int, ...],
) -> str:
    """Return the reason why the event at the end of a segment has no unique past, or an empty text.

    The arguments are the guards, the stopping monitors and the schedules of that event.
    """
    model = system.model
    resets = [model.schedules[k].name for k in schedules if model.schedules[k].reset]
    resets += [system.monitor_names[k] for k in stopping if model.monitors[k].reset]
    if resets:
        return f"the reset of {', '.join(resets)} cannot be inverted, so the past of this event is not unique"
    return entered_here(system, z, fired)


@dataclass(frozen=True)
class Entry:
    """A guard of another mode; its transition may have started the present mode."""

    z: np.ndarray  # modes (C,) in which the guard is evaluated
    guard: int  # its number
    label: str


def entries(system: System, z: np.ndarray) -> tuple[Entry, ...]:
    """Return the declared transitions into the present modes that have no reset."""
    found = []
    for c, automaton in enumerate(system.automata):
        if automaton.has_surface or automaton.is_corner:
            continue
        for m, guards in enumerate(automaton.guards):
            for j, g in enumerate(guards):
                for number, target in enumerate(automaton.targets[m][j]):
                    if target == z[c] and m != z[c] and ("choice", c, m, j, number) not in system.resets:
                        other = z.copy()
                        other[c] = m
                        name = f"guard {automaton.guard_names[m][j]} of mode {automaton.modes[m]} ({automaton.name})"
                        found.append(Entry(other, g, name))
    return tuple(found)


def cross_backward(system: System, at: Situation, fired: tuple[int, ...]) -> Outcome:
    """Cross a surface backward in time if the motion crossed it; else end with the status ``backward-nonunique``.

    The past is unique if the motion enters from the other side, leaves on this side, and cannot have been held in
    between. For a force with a limit that is a passage of the velocity through zero.
    """
    before = at.z.copy()
    outcome = EventResolution(system, at, before, forward=False).run(fired, [])
    for g in fired:
        c = int(system.owner[g])
        automaton = system.automata[c]
        if automaton.is_corner:
            continue
        other = automaton.below if before[c] == automaton.above else automaton.above
        rest = before.copy()
        rest[c] = automaton.hold
        forward = EventResolution(system, at, rest, forward=True)
        forward.on_surface[c] = True
        could_rest = forward.verdict(rest, [c]) != LEAVES
        if outcome.status or could_rest or outcome.z[c] != other:
            outcome.status = "backward-nonunique"
            outcome.message = (
                f"{automaton.name} reaches a surface at which the past of the motion is not unique"
            )
            break
    return outcome
