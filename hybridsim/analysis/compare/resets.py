"""This module finds the events of a model that make its states jump."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.model import Model
from hybridsim.model.parts.impact import CLOSED, OPEN
from hybridsim.reference.trajectory import EventLike


@dataclass(frozen=True)
class Resets:
    """The set of events whose guard, monitor or schedule resets a state; test with ``event in resets``.

    Parameters
    ----------
    transitions : (component, source, target) of mode changes.
    names : names of monitors and schedules.
    """

    transitions: frozenset[tuple[str, str, str]] = frozenset()
    names: frozenset[str] = frozenset()

    def __contains__(self, event: EventLike) -> bool:
        if event.kind == "transition":
            return (event.component, event.source, event.target) in self.transitions
        return bool({event.guard, event.component} & self.names)


def resets_of(model: Model) -> Resets:
    """Return the events that reset a state, as the model declares them."""
    states = {state.name for state in model.states}
    transitions = frozenset(
        (component.name, mode.name, choice.to)
        for component in model.all_components()
        for mode in component.modes
        for guard in mode.guards
        for choice in guard.then
        if states & choice.reset.keys()
    )
    transitions |= {
        (component.name, mode.name, component.limit.to)
        for component in model.all_components()
        if component.limit and states & component.limit.reset.keys()
        for mode in component.modes
    }
    transitions |= {
        (impact.name, source, target)
        for impact in model.impacts
        for source, target in ((OPEN, OPEN), (OPEN, CLOSED), (CLOSED, OPEN))
    }
    declared = [(monitor.name, monitor.reset) for monitor in model.monitors]
    declared += [(schedule.name, schedule.reset) for schedule in model.schedules]
    return Resets(transitions, frozenset(name for name, reset in declared if states & reset.keys()))
