"""This module defines the part of a solution that gives events and modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.arguments import known_name, side_of_event, text
from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.solution.event import Event, ModeInterval
from hybridsim.solution.states import States

KINDS = "transition", "monitor", "scheduled", "near-grazing", "corner"  # of events


class EventsAndModes(States):
    """The events and modes of a run, as a part of `Solution`."""

    @property
    def events(self) -> Sequence[Event]:
        """All events in order of time: transitions, monitors, scheduled events, near-grazings.

        With ``moreau`` for a `MechanicalSystem` an event is at the beginning of the step with the new mode, and
        bounces are not events.
        """
        self._require_events()
        return self._trajectory.events

    @property
    def corners(self) -> tuple[Event, ...]:
        """Events of kind "corner": sign changes of the argument of an `abs`, `min` or `max` inside a mode.

        The model does not change there: the run continues with the equations of the other side. `events` and
        `modes` do not contain these instants. A `MechanicalSystem` has none.
        """
        self._require_events()
        return self._trajectory.corners

    @refusing
    def event_times(self, component: str, kind: str | None = None) -> np.ndarray:
        """Return the times (m,) of the events of one component, contact, impact, monitor or schedule."""
        self._check_component(component, kind)
        return self._trajectory.event_times(component, kind)

    @refusing
    def event_states(self, component: str, kind: str | None = None, side: str = "+") -> np.ndarray:
        """Return the states (m, n) at the m events of one component, in the order of `event_times`.

        With side "+" these are the states x+ just after each event, with "-" the states x-; columns are in
        the order of ``sol.names``. The values equal those in ``sol.events``, without an object for each
        event.
        """
        side = side_of_event(side)
        self._check_component(component, kind)
        return self._trajectory.event_states(component, kind, side)

    def _check_component(self, component: object, kind: object) -> None:
        self._require_events()
        if kind is not None:
            known_name(text(kind, "kind"), KINDS, "the kind of events cannot be", "kinds")
        known = list(self._trajectory.event_names)
        known_name(component, known, "the model has no component, monitor or schedule", "names")

    @property
    def components(self) -> Sequence[Any]:
        """Objects that describe the components in `modes`, in the same order.

        They are the components of a model and those for jumps in its rates, or the contacts and impacts of a
        `MechanicalSystem`.
        """
        return self._trajectory.components

    @property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each component in order, each with its time interval."""
        self._require_events()
        return self._trajectory.modes

    def _require_events(self) -> None:
        if self._save == "nothing":
            raise UsageError(
                "the run was made with keep='nothing', which keeps no events and no modes",
                remedy="repeat the run with keep='events', or 'last-period'",
            )
