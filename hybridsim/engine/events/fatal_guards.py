"""Find the messages of fatal guards, whose zeros end a run because no further mode is declared."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.system.system import System


def message_of_leaving(
    system: System, z: np.ndarray, leaving: Iterable[int], sides: np.ndarray
) -> str | None:
    """Return the message of the first fatal guard that is negative in the present modes of some components."""
    for c in leaving:
        automaton, mode = system.automata[c], int(z[c])
        for guard, message in zip(automaton.guards[mode], automaton.fatal[mode]):
            if message and sides[guard] < 0:
                return message
    return None


def is_only_fatal(system: System, outcome: Outcome) -> bool:
    """Return whether a fatal guard is the only reason why an event could not be resolved."""
    messages = (message for a in system.automata for row in a.fatal for message in row)
    return bool(outcome.status) and any(message and message == outcome.message for message in messages)


def message_of_located(system: System, z: np.ndarray, located: Iterable[int]) -> str | None:
    """Return the message of a fatal guard that is zero in the modes `z` before the event."""
    for automaton, mode in zip(system.automata, z.tolist()):
        if mode >= 0:
            for guard, message in zip(automaton.guards[mode], automaton.fatal[mode]):
                if message and guard in located:
                    return message
    return None


def message_of_every_mode(system: System, components: Iterable[int], sides: np.ndarray) -> str | None:
    """Return the message of the first component that has a negative fatal guard in each of its modes."""
    for c in components:
        automaton = system.automata[c]
        modes = zip(automaton.guards, automaton.fatal)
        found = [[m for g, m in zip(*mode) if m and sides[g] < 0] for mode in modes]
        if all(found):
            return str(found[0][0])
    return None
