"""Represent monitors as components whose modes are the signs of the monitors, so that compiled loops find all zeros.

Such a component is a corner, like one of ``abs``. Its two modes, ``+`` and ``-``, in which the monitor is positive and
negative, have the same rates. A zero of the monitor changes the mode and nothing else. The corners follow all other
components, and their guards follow all other guards, so that both keep their numbers. A monitor that resets a state or
ends the run has fatal guards, which the general mode loop resolves.

A monitor that is a multiple of a contact's relative velocity, or of another surface function, needs no corner. The mode
of the contact is its side: positive and negative in the two slip modes, and zero in stick.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.system.system import System
from hybridsim.expr import of_tree
from hybridsim.model.free_name import free_name, names_of_model
from hybridsim.model.parts.component import Choice, Guard, Mode, MonitorCorner
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.monitor import Monitor

# Largest number of monitors as corners. Compiled loops store tables for each combination of sides.
MOST = 32
_MODES = ("+", "-")
POSITIVE, NEGATIVE, ZERO = range(
    3
)  # sides of a monitor in the record; the first two are the modes of its corner
_DIRECTIONS = ("down", "up")  # in which a monitor leaves the modes
_POSITIVE = of_tree(ast.Constant(1.0))
_SIGNS = np.array([1, -1, 0])  # of the sides
_FATAL = "a monitor acts"  # never shown, because compiled loops leave such an event to the general loop


def _corner(name: str, monitor: Monitor) -> MonitorCorner:
    """Return the corner that represents a monitor."""
    modes = []
    for mode, other, direction in zip(_MODES, reversed(_MODES), _DIRECTIONS, strict=True):
        tree = monitor.expr.tree
        side = of_tree(tree if mode == "+" else ast.UnaryOp(ast.USub(), tree), monitor.expr.place)
        is_record = monitor.action == "record" or monitor.direction not in ("both", direction)
        guard = Guard("side", side, then=(Choice(other),)) if is_record else Guard("side", side, fatal=_FATAL)
        modes.append(Mode(mode, (guard,)))
    return MonitorCorner(name, tuple(modes), initial="+")


def _followed(system: System) -> dict[int, tuple[int, float]]:
    """Return the monitors whose sign follows from the mode of a component, each with this component and a factor.

    The monitor is the factor times the surface function of the component.
    """
    found = {}
    for k, (monitor, multiple) in enumerate(
        zip(system.model.monitors, system.code.data["monitored"], strict=True)
    ):
        if multiple is not None and monitor.action == "record":
            automaton = system.automata[multiple[0]]
            if {automaton.above, automaton.below, automaton.hold} == set(range(len(automaton.modes))):
                found[k] = multiple
    return found


def _with_corners(model: Model, numbers: Sequence[int]) -> Model:
    """Return the model with corners in place of its monitors; monitors with resets stay, but never fire.

    numbers : the monitors that have a corner.
    """
    taken, corners = set(names_of_model(model)), []
    for monitor in (model.monitors[k] for k in numbers):
        name = free_name(taken, f"side_of_{monitor.name}")
        taken.add(name)
        corners.append(_corner(name, monitor))
    # resets stay, because the run-time vector has their frequencies and kernels call them by number
    still = [replace(m, expr=_POSITIVE, action="reset") for m in model.monitors if m.reset]
    return replace(model, components=(*model.components, *corners), monitors=tuple(still))


def corners_of_monitors(system: System) -> MonitorCorners | None:
    """Return the monitors of a system as corners, from a cache, or None if corners cannot replace the monitors."""
    if len(system.monitor_names) > MOST or not system.has_tape:
        return None
    if system.with_corners is None:
        system.with_corners = MonitorCorners(system)
    found: MonitorCorners = system.with_corners
    return found


class MonitorCorners:
    """The system with corners in place of monitors, and conversions of states between both systems.

    Parameters
    ----------
    plain : the system of the model, which has monitors.
    """

    def __init__(self, plain: System) -> None:
        followed, count = _followed(plain), len(plain.monitor_names)
        self._numbers = np.array([k for k in range(count) if k not in followed], dtype=np.int64)
        numbered = self._numbers.tolist()
        model: Model = plain.model.once("monitor corners", lambda: _with_corners(plain.model, numbered))
        self.plain, self.system = plain, System(model.with_values_of(plain.model), as_written=True)
        numbers = np.array([a.guards for a in self.system.automata[len(plain.automata) :]], dtype=np.int64)
        self._guards = numbers.reshape(-1, 2)  # of each corner in its two modes
        # the monitors without corners: their numbers, their components, and by mode the side and the surface's guard
        self._followed = np.array(list(followed), dtype=np.int64)
        self._components = np.array([c for c, _ in followed.values()], dtype=np.int64)
        self._factors = np.array([abs(factor) for _, factor in followed.values()])
        self._sides, self._surfaces = (np.zeros((len(followed), 3), dtype=np.int64) for _ in range(2))
        for row, (c, factor) in enumerate(followed.values()):
            automaton, is_same = plain.automata[c], factor > 0.0
            self._sides[row, automaton.above] = POSITIVE if is_same else NEGATIVE
            self._sides[row, automaton.below] = NEGATIVE if is_same else POSITIVE
            self._sides[row, automaton.hold] = ZERO
            for mode in (automaton.above, automaton.below):
                self._surfaces[row, mode] = automaton.guards[mode][0]
        assert self.system.layout == plain.layout and np.array_equal(self.system.rates, plain.rates)

    def sides(self, modes: np.ndarray) -> np.ndarray:
        """Convert modes (E, C + corners) to modes and sides (E, C + M), with a column for each monitor."""
        if not len(self._followed):
            return modes
        own = len(self.plain.automata)
        found = np.empty((len(modes), own + len(self.plain.monitor_names)), dtype=np.int64)
        found[:, :own], found[:, own + self._numbers] = modes[:, :own], modes[:, own:]
        found[:, own + self._followed] = self._sides[range(len(self._followed)), modes[:, self._components]]
        return found

    def state(self, outcome: Outcome, p: np.ndarray) -> HybridState | None:
        """Return the state with corners for monitors, or None if the side of a monitor disagrees with the modes.

        Such a monitor is zero or not a number, or rounding hides its side at a surface.
        """
        modes = np.where(outcome.monitor_sides[self._numbers] > 0, POSITIVE, NEGATIVE)
        z = np.concatenate([outcome.z, modes])
        if not np.array_equal(_SIGNS[self.sides(z[None])[0, len(outcome.z) :]], outcome.monitor_sides):
            return None
        active = self._guards[np.arange(len(modes)), modes]
        sides, orders = (np.full(self.system.guard_count, k, dtype=np.int64) for k in (1, 0))
        floors, own = np.zeros(self.system.guard_count), self.plain.guard_count
        sides[:own], orders[:own], floors[:own] = outcome.sides, outcome.orders, outcome.guard_floors
        orders[active] = outcome.monitor_orders[self._numbers]
        floors[active] = outcome.monitor_floors[self._numbers]
        return HybridState.of(replace(outcome, z=z, sides=sides, orders=orders, guard_floors=floors), p)

    def outcome(self, state: HybridState) -> Outcome:
        """Convert a state of the system with corners to an outcome of the model with monitors."""
        whole, own, components = state.outcome(), self.plain.guard_count, len(self.plain.automata)
        sides = _SIGNS[self.sides(whole.z[None])[0, components:]]
        active = self._guards[np.arange(len(self._numbers)), whole.z[components:]]
        orders, floors = np.zeros(len(sides), dtype=np.int64), np.zeros(len(sides))
        orders[self._numbers], floors[self._numbers] = whole.orders[active], whole.guard_floors[active]
        at_surface = self._surfaces[range(len(self._followed)), whole.z[self._components]]
        is_off = sides[self._followed] != 0
        orders[self._followed] = np.where(is_off, whole.orders[at_surface], 0)
        floors[self._followed] = np.where(is_off, self._factors * whole.guard_floors[at_surface], 0.0)
        return replace(
            whole,
            z=whole.z[:components],
            sides=whole.sides[:own],
            orders=whole.orders[:own],
            guard_floors=whole.guard_floors[:own],
            monitor_sides=sides,
            monitor_orders=orders,
            monitor_floors=floors,
        )
