"""This module applies declared transitions: it selects the choices of guards and combines all resets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from hybridsim.errors import SimulationError
from hybridsim.expr import Expression, Increment
from hybridsim.reference.multiple_precision.precision import Number
from hybridsim.reference.multiple_precision.program import Point
from hybridsim.reference.multiple_precision.programs import Modes, Programs


@dataclass(frozen=True)
class Move:
    """A change of the mode of one component."""

    component: int
    source: str
    target: str
    guard: str


class Transitions:
    """The declared transitions of one model."""

    def __init__(self, programs: Programs) -> None:
        self.programs = programs
        self.states = [state.name for state in programs.model.states]
        self.discrete = [part.name for part in programs.model.discrete]

    def take(
        self,
        point: Point,
        modes: Modes,
        fired: Iterable[tuple[int, int]],
        resets: list[Mapping[str, Expression]],
        moves: list[Move],
        is_located: bool = False,
    ) -> tuple[Point, Modes]:
        """Take the declared choices of the guards that fired, and apply all resets together.

        is_located: the guards reached zero together, so that no guard of a component precedes another.
        """
        after, modes = list(modes), self.programs.modes_by_side(point, modes)
        ways: dict[int, list[tuple[str, Mapping[str, Expression]]]] = {}
        for c, j in sorted(fired):
            component = self.programs.components[c]
            guard = component.mode(modes[c]).guards[j]
            if guard.fatal:
                raise SimulationError(f"at t = {float(point.t)!r}: {guard.fatal}")
            if component.surface:
                continue
            choice = next(
                (
                    way
                    for way in guard.then
                    if way.when is None or self.programs.value(way.when, point, modes)
                ),
                None,
            )
            if choice is None:
                raise SimulationError(
                    f"at t = {float(point.t)!r} guard {guard.name} of {component.name} becomes negative, but no "
                    "condition of its choices is true"
                )
            way, known = (choice.to, choice.reset), ways.setdefault(c, [])
            if known and not is_located:
                continue
            if known and known[0][0] != choice.to:
                raise SimulationError(
                    f"at t = {float(point.t)!r} two guards of {component.name} reach zero at once "
                    "and lead to different modes"
                )
            if way not in known or any(isinstance(expr, Increment) for expr in choice.reset.values()):
                moves.append(Move(c, modes[c], choice.to, guard.name))
                known.append(way)
            after[c] = choice.to
        made = [reset for known in ways.values() for _, reset in known]
        values = self._reset_values(point, modes, [*made, *resets])
        x = tuple(values.get(name, value) for name, value in zip(self.states, point.x, strict=True))
        discrete = tuple(
            values.get(name, value) for name, value in zip(self.discrete, point.discrete, strict=True)
        )
        return replace(point, x=x, discrete=discrete), tuple(after)

    def _reset_values(
        self, point: Point, modes: Modes, resets: list[Mapping[str, Expression]]
    ) -> dict[str, Number]:
        values: dict[str, Number] = {}
        added: dict[str, list[Number]] = {}
        before = dict(zip((*self.states, *self.discrete), (*point.x, *point.discrete), strict=True))
        context, zero = self.programs.precision.context, self.programs.precision.zero
        for reset in resets:
            for name, expr in reset.items():
                value = self.programs.value(expr, point, modes)
                if isinstance(expr, Increment):
                    added.setdefault(name, []).append(value)
                elif abs(context.fsub(values.setdefault(name, value), value)) > zero * max(
                    abs(value), abs(before[name])
                ):
                    raise SimulationError(
                        f"two resets at t = {float(point.t)!r} set {name} to {float(values[name])!r} and to "
                        f"{float(value)!r}"
                    )
        for name, amounts in added.items():
            if name in values:
                raise SimulationError(
                    f"at t = {float(point.t)!r} one reset sets {name} and another reset adds to it"
                )
            values[name] = context.fsum([before[name], *amounts])
        return values
