"""Rule 0 of `settling`: corners and loads on the sides that hold, and automata that leave whatever is decided."""

from __future__ import annotations

from collections.abc import Iterable

from hybridsim.analysis.multiple_precision.program import Point
from hybridsim.analysis.multiple_precision.programs import UNDECIDED, Modes, Programs
from hybridsim.analysis.multiple_precision.transitions import Move
from hybridsim.errors import UsageError
from hybridsim.model.component import Corner, LoadAutomaton
from hybridsim.model.meanings import Meanings
from hybridsim.model.one_sided import names_of

_ROUNDS_PER_MODE = 4  # a corner waits for those inside it, and for the orders of series before its own


class Sides:
    """The components of one model whose modes follow from the state."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.components = programs, programs.components
        self.led = [c for c, one in enumerate(self.components) if isinstance(one, (Corner, LoadAutomaton))]
        self._forced = Meanings(programs.model).forced
        self._most = _ROUNDS_PER_MODE * sum(len(self.components[c].modes) for c in self.led)

    def others(self, guards: Iterable[tuple[int, int]]) -> set[tuple[int, int]]:
        """The guards (component, number) of components whose modes are decided otherwise."""
        return {(c, j) for c, j in guards if c not in self.led}

    def along(self, point: Point, modes: Modes) -> Modes:
        """The modes with each corner and load on its side along their flow; by value where a contact has no mode."""
        if not self.led:
            return modes
        has_flow = UNDECIDED not in modes
        for _ in range(self._most):
            expansion = self.programs.expand(point, self.programs.decided(modes))
            after = list(modes)
            for c in self.led:
                for guard, watched in zip(
                    self.components[c].mode(modes[c]).guards, expansion.guards[c], strict=True
                ):
                    side, order = expansion.side_after(watched)
                    if side < 0 and (has_flow or order == 0):
                        after[c] = guard.then[0].to
                        break
            if tuple(after) == modes:
                return modes
            modes = tuple(after)
        raise UsageError(
            f"at t = {float(point.t)!r} the sides of corners follow from each other without end: that is not supported "
            "by the multiple-precision run",
            remedy="compare against runs",
        )

    def taken(self, point: Point, modes: Modes, moves: list[Move]) -> Modes:
        """The same, each change noted among the moves."""
        after = self.along(point, modes)
        for c in self.led:
            if after[c] != modes[c]:
                guard = self.components[c].mode(modes[c]).guards[0].name
                moves.append(Move(c, modes[c], after[c], guard))
        return after

    def leaving_in_any_case(self, point: Point, modes: Modes) -> set[tuple[int, int]]:
        """Guards of declared automata that are negative and free of the forces of contacts."""
        expansion = self.programs.expand(point, self.programs.decided(modes))
        found = set()
        for c, component in enumerate(self.components):
            if component.surface or c in self.led:
                continue
            for j, (guard, watched) in enumerate(
                zip(component.mode(modes[c]).guards, expansion.guards[c], strict=True)
            ):
                is_free = not names_of(guard.expr.tree) & self._forced
                if is_free and watched.c[0] < 0 and not expansion.is_zero(watched):
                    found.add((c, j))
        return found
