"""This module caches the equations of each combination of modes, and the series at one instant."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hybridsim.expr import Expression
from hybridsim.model import Model
from hybridsim.reference.multiple_precision.expansion import Expansion
from hybridsim.reference.multiple_precision.precision import Number, Precision
from hybridsim.reference.multiple_precision.program import Point, Program
from hybridsim.reference.multiple_precision.reading import Reading
from hybridsim.reference.multiple_precision.signals import Signal

Modes = tuple[str, ...]
"""Name of the mode of each component."""
UNDECIDED = ""
"""The mode of a contact before the first decision."""


class Programs:
    """Builds the equations and Taylor series of combinations of modes on demand, and caches them.

    Parameters
    ----------
    longest : the maximum reach of a series.
    """

    def __init__(
        self, model: Model, precision: Precision, signals: Sequence[Signal], longest: Number
    ) -> None:
        self.model, self.precision, self.signals, self.longest = model, precision, signals, longest
        self.components = model.all_components()
        self._programs: dict[Modes, Program] = {}
        self._expansions: dict[tuple[Modes, Point], Expansion] = {}

    @property
    def first_modes(self) -> Modes:
        """Return the declared initial modes; the other modes are undecided."""
        return tuple(component.initial or UNDECIDED for component in self.components)

    def decided(self, modes: Modes) -> Modes:
        """Return the modes with every undecided component in its holding mode."""
        return self.held(modes, [c for c, mode in enumerate(modes) if mode == UNDECIDED])

    def held(self, modes: Modes, components: Iterable[int]) -> Modes:
        """Return the modes with some components in their holding modes."""
        changed = list(modes)
        for c in components:
            surface = self.components[c].surface
            assert surface is not None
            changed[c] = surface.hold
        return tuple(changed)

    def modes_by_side(self, point: Point, modes: Modes) -> Modes:
        """Return the modes with each undecided component on the side of its surface, or holding at a zero surface."""
        if UNDECIDED not in modes:
            return modes
        decided = self.decided(modes)
        expansion, changed = self.expand(point, decided), list(decided)
        owners = [c for c, component in enumerate(self.components) if component.surface]
        for c, quantity in zip(owners, expansion.surfaces, strict=True):
            surface = self.components[c].surface
            assert surface is not None and surface.below is not None  # models with impacts are refused
            if modes[c] == UNDECIDED and not expansion.is_zero(quantity):
                changed[c] = surface.above if quantity.c[0] > 0 else surface.below
        return tuple(changed)

    def program(self, modes: Modes) -> Program:
        """Return the equations of motion in a combination of modes."""
        if modes not in self._programs:
            reading = Reading(self.model, modes, self.precision, self.signals)
            self._programs[modes] = Program(reading, self.precision, self.longest)
        return self._programs[modes]

    def new_instant(self) -> None:
        """Clear the series of the previous instant."""
        self._expansions.clear()

    def expand(self, point: Point, modes: Modes) -> Expansion:
        """Return the Taylor series of the motion from a point."""
        key = (modes, point)
        if key not in self._expansions:
            self._expansions[key] = self.program(modes).expand(point)
        return self._expansions[key]

    def value(self, expr: Expression, point: Point, modes: Modes) -> Number | bool:
        """Return the value of an expression at a point."""
        return self.program(self.decided(modes)).value(expr, point)

    def leaving(self, expansion: Expansion) -> list[tuple[int, int]]:
        """Return the guards, as (component, number), that are negative just after a point."""
        return [
            (c, j)
            for c, row in enumerate(expansion.guards)
            for j, guard in enumerate(row)
            if expansion.side_after(guard)[0] < 0
        ]
