"""Select the transitions of a mode if several of its guards reach zero together and lead to one mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.lowering.reset_keys import amounts_of

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Situation

Failure = tuple[str, str]  # status and message


def guards_taken_together(
    resolution: EventData, read_from: Situation, component: int, leaving: Sequence[int]
) -> tuple[list[tuple[int, int]], Failure | None]:
    """Return the guards whose transitions are taken, each with the number of its chosen transition, or an error.

    leaving: positions of the guards that become negative, in the order in which they reached zero. read_from: the
    situation that conditions and resets read. If several guards are negative when the mode begins, the first declared
    one is taken.
    """
    system, mode = resolution.system, int(resolution.at.z[component])
    automaton = system.automata[component]
    guards = automaton.guards[mode]
    place = resolution.rank.get(guards[leaving[0]]) if leaving else None
    first = [j for j in leaving if resolution.fired[guards[j]] and resolution.rank.get(guards[j]) == place]
    first = first or list(leaving[:1])
    if fatal := next((automaton.fatal[mode][j] for j in first if automaton.fatal[mode][j]), ""):
        return [], ("inconsistent", str(fatal))
    numbers = {
        j: system.choose(component, mode, j, read_from.s, read_from.x, read_from.p, read_from.z)
        for j in first
    }
    if first and max(numbers.values()) < 0:
        return [], (
            "inconsistent",
            f"guard {automaton.guard_names[mode][first[0]]} of mode {automaton.modes[mode]} ({automaton.name}) would "
            f"become negative, and no condition of its transitions holds",
        )
    declared = system.model.all_components()[component].modes[mode].guards
    found: dict[object, tuple[int, int]] = {}
    for j, number in numbers.items():
        if number >= 0:
            choice = declared[j].then[number]
            what = (choice.to, tuple((n, e.text) for n, e in choice.reset.items()))
            # a second reset that only sets values changes nothing
            found.setdefault((what, j if amounts_of(choice.reset) else -1), (j, number))
    taken = list(found.values())
    apart = _apart(resolution, component, taken)
    return ([], ("nonunique", apart)) if apart else (taken, None)


def _apart(resolution: EventData, component: int, taken: Sequence[tuple[int, int]]) -> str:
    """Return an error text if several guards lead to different modes, else an empty text."""
    automaton, mode = resolution.system.automata[component], int(resolution.at.z[component])
    targets = [automaton.modes[automaton.targets[mode][j][number]] for j, number in taken]
    if len(set(targets)) <= 1:
        return ""
    ways = [
        f"{automaton.guard_names[mode][j]} leads to {to}" for (j, _), to in zip(taken, targets, strict=True)
    ]
    return (
        f"guards of mode {automaton.modes[mode]} ({automaton.name}) reach zero at the same instant and lead to "
        f"different modes: {' and '.join(ways)}; add conditions (`when`) that select one, or use one target mode"
    )
