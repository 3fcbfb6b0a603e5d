"""This module chooses the sides of corners and loads, and finds guards that certainly fire."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from hybridsim.errors import UsageError
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.component import Corner, LoadAutomaton
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.reference.multiple_precision.program import Point
from hybridsim.reference.multiple_precision.programs import UNDECIDED, Modes, Programs
from hybridsim.reference.multiple_precision.transitions import Move

_MAX_CONTACTS_AT_REST = 4  # contacts at rest whose combinations of modes are tried
_ROUNDS_PER_MODE = (
    4  # rounds per mode: a corner waits for the corners inside it, and for the series orders before its own
)


class Sides:
    """The components of one model whose modes follow from the state, such as corners."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.components = programs, programs.components
        self.led = [c for c, one in enumerate(self.components) if isinstance(one, (Corner, LoadAutomaton))]
        self._owners = [c for c, one in enumerate(self.components) if not one.surface and c not in self.led]
        self._forced = Meanings(programs.model).forced
        self._most = _ROUNDS_PER_MODE * sum(len(self.components[c].modes) for c in self.led)

    def others(self, guards: Iterable[tuple[int, int]]) -> set[tuple[int, int]]:
        """Return the guards (component, number) of components whose modes do not follow from the state."""
        return {(c, j) for c, j in guards if c not in self.led}

    def along(self, point: Point, modes: Modes) -> Modes:
        """Return the modes in which every corner and load is on the side that the flow enters."""
        if not self.led:
            return modes
        has_flow = UNDECIDED not in modes
        for _ in range(self._most):
            expansion = self.programs.expand(point, self.programs.decided(modes))
            after = list(modes)
            for c in self.led:
                for guard, quantity in zip(
                    self.components[c].mode(modes[c]).guards, expansion.guards[c], strict=True
                ):
                    side, order = expansion.side_after(quantity)
                    if side < 0 and (has_flow or order == 0):
                        after[c] = guard.then[0].to
                        break
            if tuple(after) == modes:
                return modes
            modes = tuple(after)
        raise UsageError(
            f"at t = {float(point.t)!r} the non-smooth expressions change sides without end, which the "
            "multiple-precision run does not support",
            remedy="use reference='runs'",
        )

    def taken(self, point: Point, modes: Modes, moves: list[Move]) -> Modes:
        """Put every corner and load on the side that the flow enters, and append the changes of mode to `moves`."""
        after = self.along(point, modes)
        for c in self.led:
            if after[c] != modes[c]:
                guard = self.components[c].mode(modes[c]).guards[0].name
                moves.append(Move(c, modes[c], after[c], guard))
        return after

    def leaving_in_any_case(self, point: Point, modes: Modes) -> set[tuple[int, int]]:
        """Return the guards that are negative just after an event in all modes of resting contacts.

        With too many combinations, it returns the guards that are negative by value and independent of
        contact forces.
        """
        if not self._owners:
            return set()
        trial = list(self.programs.modes_by_side(point, modes))
        surfaces = [c for c, component in enumerate(self.components) if component.surface]
        expansion = self.programs.expand(point, tuple(trial))
        zero = [c for c, one in zip(surfaces, expansion.surfaces, strict=True) if expansion.is_zero(one)]
        if len(zero) > _MAX_CONTACTS_AT_REST:
            negative = self._negative(point, tuple(trial), by_value=True)
            return {(c, j) for c, j in negative if self._is_free(c, trial[c], j)}
        found: set[tuple[int, int]] = set()
        combinations = itertools.product(*([mode.name for mode in self.components[c].modes] for c in zero))
        for number, combination in enumerate(combinations):
            for c, mode in zip(zero, combination, strict=True):
                trial[c] = mode
            negative = self._negative(point, self.along(point, tuple(trial)))
            found = found & negative if number else negative
            if not found:
                break
        return found

    def _negative(self, point: Point, modes: Modes, by_value: bool = False) -> set[tuple[int, int]]:
        expansion = self.programs.expand(point, modes)
        sides = {
            (c, j): expansion.side_after(guard)
            for c in self._owners
            for j, guard in enumerate(expansion.guards[c])
        }
        return {place for place, (side, order) in sides.items() if side < 0 and not (by_value and order)}

    def _is_free(self, c: int, mode: str, j: int) -> bool:
        """Return whether a guard is independent of contact forces."""
        return not names_of(self.components[c].mode(mode).guards[j].expr.tree) & self._forced
