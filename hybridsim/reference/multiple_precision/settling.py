"""This module finds state and modes after an event: transitions, resets and admissible modes.

The rules:

0.  A corner, a step in time and the load of a contact that opens have the side on which their argument is
just after the event. They take their sides first: at the start, at a located event, after each reset and each
change of another component, and in each combination of modes that is tried. While a contact has no mode yet,
their sides follow from their values alone.
1.  Guards of the present modes that are zero here and would be negative just after have fired. For an
automaton with choices, the first choice whose condition holds at x- is taken. All resets that are due,
including those of schedules and monitors, are evaluated at x- and applied together; two that set one variable
to different values are an error. Of several guards that are negative after a reset or at a start, the first
declared one is taken. An automaton whose guard is negative in every combination of modes of the contacts at
rest leaves before these are decided. So does one whose guard would still be negative if the contacts were
decided first; a located guard that would not be negative has only touched zero. A contact without a mode yet
is evaluated on the side on which it is.
2.  A component with a surface (a contact) that is off its surface is in the mode of its side.
3.  A component on its surface whose mode cannot continue is decided together with those whose forces act on
it. Every combination of modes is followed for a moment, with the surfaces exactly zero, and is admissible if
none of their guards becomes negative. Of the admissible ones, the choice keeps the most modes of the
components whose guards have not fired, then the most modes of all, then holds the most surfaces (stick before
slip). A tie, or no admissible combination, ends the run.
4.  Rules 1 to 3 are repeated until no guard of any component is about to be negative.

Located events come before scheduled events of the same instant, and inputs jump with the latter. At the start
of a run, where no motion has happened yet, the schedule comes first.

The sign of a quantity just after the event, or its vanishing, follows from its Taylor coefficients in the
trial mode. A coefficient below 10^-20 of the terms of its sum (with 32 digits) is zero, and the next one
decides. No rule prescribes in advance which quantities are zero at an event.

A monitor has the side of zero on which it is just after an event, or no side if it stays zero. It fires when
it leaves its side: between events when its series changes sign; at an event that changes a mode, or that a
schedule causes, if its side just after differs. Its reset is applied at once.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from hybridsim.errors import SimulationError, UsageError
from hybridsim.expr import Expression
from hybridsim.reference.multiple_precision.expansion import Expansion
from hybridsim.reference.multiple_precision.program import Point
from hybridsim.reference.multiple_precision.programs import UNDECIDED, Modes, Programs
from hybridsim.reference.multiple_precision.sides import Sides
from hybridsim.reference.multiple_precision.transitions import Move, Transitions

_MAX_JOINT_CONTACTS = 4  # contacts decided jointly; their 3^4 combinations are tried one by one
_MAX_ROUNDS = 50  # rounds at one instant; a cascade of resets is far shorter


@dataclass
class Settled:
    """The result of an event: the state, the modes and the series just after it, and the mode changes."""

    point: Point
    modes: Modes
    expansion: Expansion
    moves: list[Move] = field(default_factory=list)


class Rules:
    """The rules that choose state and modes after an event."""

    def __init__(self, programs: Programs) -> None:
        self.programs, self.components = programs, programs.components
        self.transitions, self.sides = Transitions(programs), Sides(programs)

    def resolve_event(
        self,
        point: Point,
        modes: Modes,
        located: Iterable[tuple[int, int]] = (),
        resets: Iterable[Mapping[str, Expression]] = (),
    ) -> Settled:
        """Resolve an event with the guards located at zero and the resets that are due."""
        moves: list[Move] = []
        fired = set(located)
        self.programs.new_instant()
        now = self.sides.taken(point, modes, moves)
        if fired:
            leaving = self._leaving(point, now)
            fired = leaving if now != modes else self.sides.others(fired) | leaving
            fired -= self._cancelled(point, now, fired)
        modes, due, is_located = now, list(resets), bool(fired)
        for _ in range(_MAX_ROUNDS):
            names = {
                c: self.components[c].mode(modes[c]).guards[j].name for c, j in sorted(fired, reverse=True)
            }
            point, modes = self.transitions.take(point, modes, fired, due, moves, is_located)
            modes = self.sides.taken(point, modes, moves)
            point, modes = self._leave_in_any_case(point, modes, moves)
            modes, open_ = self._take_sides(point, modes, moves)
            open_ |= {c for c in names if self.components[c].surface}
            point, modes = self._choose_jointly(point, modes, open_, names, moves)
            modes = self.sides.taken(point, modes, moves)
            fired, due, is_located = self._leaving(point, modes), [], False
            if not fired:
                return Settled(point, modes, self.programs.expand(point, modes), moves)
        moving = ", ".join(sorted({self.components[move.component].name for move in moves[-8:]}))
        raise UsageError(
            f"at t = {float(point.t)!r} the transitions of {moving} follow each other without end: motion along a "
            "surface of a general automaton is not supported by the multiple-precision run",
            remedy="use reference='runs'",
        )

    def _leaving(self, point: Point, modes: Modes) -> set[tuple[int, int]]:
        """Return the guards that are negative just after an event, except the guards of corners and loads."""
        return self.sides.others(self.programs.leaving(self.programs.expand(point, modes)))

    def _cancelled(self, point: Point, modes: Modes, fired: set[tuple[int, int]]) -> set[tuple[int, int]]:
        """Return the located guards that do not fire if the modes of contacts are chosen first."""
        open_ = {c for c, _ in fired if self.components[c].surface}
        if not open_ or all(c in open_ for c, _ in fired):
            return set()
        try:
            point, modes = self._choose_jointly(point, modes, set(open_), {}, [])
        except SimulationError:
            return set()
        leaving = self._leaving(point, self.sides.taken(point, modes, []))
        return {(c, j) for c, j in fired - leaving if c not in open_}

    def _leave_in_any_case(self, point: Point, modes: Modes, moves: list[Move]) -> tuple[Point, Modes]:
        """Change modes of automata with a guard that is negative for all values of undecided forces."""
        for _ in range(_MAX_ROUNDS if self._surfaces() else 0):
            leaving = self.sides.leaving_in_any_case(point, modes)
            if not leaving:
                break
            point, modes = self.transitions.take(point, modes, leaving, [], moves)
            modes = self.sides.taken(point, modes, moves)
        return point, modes

    def _surfaces(self) -> list[int]:
        return [c for c, component in enumerate(self.components) if component.surface]

    def _take_sides(self, point: Point, modes: Modes, moves: list[Move]) -> tuple[Modes, set[int]]:
        """Choose the mode of each surface that is not zero; return the undecided components whose surface is zero."""
        order = self._surfaces()
        if not order:
            return modes, set()
        expansion = self.programs.expand(point, self.programs.decided(modes))
        after, open_ = list(modes), set()
        for c, quantity in zip(order, expansion.surfaces, strict=True):
            surface = self.components[c].surface
            assert surface is not None and surface.below is not None  # models with impacts are refused
            if expansion.is_zero(quantity):
                if modes[c] == UNDECIDED:
                    open_.add(c)
                continue
            side = surface.above if quantity.c[0] > 0 else surface.below
            if after[c] != side:
                if after[c] != UNDECIDED:
                    moves.append(Move(c, after[c], side, "reset"))
                after[c] = side
        return tuple(after), open_

    def _choose_jointly(
        self, point: Point, modes: Modes, open_: set[int], names: Mapping[int, str], moves: list[Move]
    ) -> tuple[Point, Modes]:
        """Choose the modes of components on their surfaces, jointly with the components they affect."""
        deciding = {c for c in open_ if self._on_surface(c, point, modes)}
        while deciding:
            chosen = self._with_coupled(min(deciding), deciding, point, modes)
            if len(chosen) > _MAX_JOINT_CONTACTS:
                coupled = ", ".join(self.components[c].name for c in chosen)
                raise UsageError(
                    f"{len(chosen)} coupled contacts start or stop at once ({coupled}); the "
                    f"multiple-precision run supports at most {_MAX_JOINT_CONTACTS} contacts",
                    remedy="use reference='runs'",
                )
            point = self.programs.program(self.programs.held(self.programs.decided(modes), chosen)).project(
                point
            )
            best = self._best(point, modes, chosen, deciding)
            for c in chosen:
                if modes[c] not in (best[c], UNDECIDED):
                    moves.append(Move(c, modes[c], best[c], names.get(c, "")))
            modes = tuple(best[c] if c in chosen else mode for c, mode in enumerate(modes))
            deciding -= set(chosen)
        return point, modes

    def _on_surface(self, c: int, point: Point, modes: Modes) -> bool:
        expansion = self.programs.expand(point, self.programs.decided(modes))
        return expansion.is_zero(expansion.surfaces[self._surfaces().index(c)])

    def _with_coupled(self, first: int, deciding: set[int], point: Point, modes: Modes) -> list[int]:
        """Return a component with the undecided or holding components that are coupled to it by forces."""
        together = [c for c in self._surfaces() if c in deciding or self._holds(c, modes)]
        program = self.programs.program(self.programs.held(self.programs.decided(modes), together))
        program.begin(point)
        held = [c for c in self._surfaces() if self._holds(c, program.modes)]
        coupled = {c: {held[j] for j in program.coupled(i)} for i, c in enumerate(held)}
        found = {first}
        while more := set().union(*(coupled[c] for c in found)) & set(together) - found:
            found |= more
        return sorted(found)

    def _holds(self, c: int, modes: Modes) -> bool:
        surface = self.components[c].surface
        return surface is not None and modes[c] == surface.hold

    def _best(self, point: Point, modes: Modes, chosen: Sequence[int], deciding: set[int]) -> Modes:
        """Return the admissible modes with the fewest changes; changes of components without an event count most."""
        scores: dict[tuple[int, int, int], list[Modes]] = {}
        for combination in itertools.product(*([m.name for m in self.components[c].modes] for c in chosen)):
            candidate = list(self.programs.decided(modes))
            for c, mode in zip(chosen, combination, strict=True):
                candidate[c] = mode
            trial = self.sides.along(point, tuple(candidate))
            expansion = self.programs.expand(point, trial)
            if all(expansion.side_after(guard)[0] >= 0 for c in chosen for guard in expansion.guards[c]):
                unchanged = [c for c in chosen if trial[c] == modes[c]]
                held = sum(self._holds(c, trial) for c in chosen)
                scores.setdefault((len(set(unchanged) - deciding), len(unchanged), held), []).append(trial)
        best = scores[max(scores)] if scores else []
        if len(best) != 1:
            motions = "several motions are" if best else "no motion is"
            names = ", ".join(self.components[c].name for c in chosen)
            raise SimulationError(f"at t = {float(point.t)!r} {motions} admissible for {names}")
        return best[0]
