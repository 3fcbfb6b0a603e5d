"""Represent each monitor as a component whose mode is the sign of the monitor, so that compiled loops find its zeros.

Such a component is a corner, like one of ``abs``. Its two modes, ``+`` and ``-``, in which the monitor is positive and
negative, have the same rates. A zero of the monitor changes the mode and nothing else. The corners follow all other
components, and their guards follow all other guards, so that both keep their numbers. A monitor that resets a state or
ends the run has fatal guards, which the general mode loop resolves.
"""

from __future__ import annotations

import ast
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
_DIRECTIONS = ("down", "up")  # in which a monitor leaves the modes
_POSITIVE = of_tree(ast.Constant(1.0))
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


def _with_corners(model: Model) -> Model:
    """Return the model with a corner in place of each monitor; monitors with resets stay, but never fire."""
    taken, corners = set(names_of_model(model)), []
    for monitor in model.monitors:
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
        model: Model = plain.model.once("monitor corners", lambda: _with_corners(plain.model))
        self.plain, self.system = plain, System(model.with_values_of(plain.model), as_written=True)
        self.count = len(plain.monitor_names)
        numbers = np.array([a.guards for a in self.system.automata[len(plain.automata) :]], dtype=np.int64)
        self._guards = numbers.reshape(self.count, 2)  # of each monitor in its two modes
        assert self.system.layout == plain.layout and np.array_equal(self.system.rates, plain.rates)

    def state(self, outcome: Outcome, p: np.ndarray) -> HybridState | None:
        """Return the state with a corner for each monitor, or None if a monitor is zero or not a number."""
        if not outcome.monitor_sides.all():
            return None
        modes = np.where(outcome.monitor_sides > 0, 0, 1)
        active = self._guards[np.arange(self.count), modes]
        sides, orders = (np.full(self.system.guard_count, k, dtype=np.int64) for k in (1, 0))
        floors, own = np.zeros(self.system.guard_count), self.plain.guard_count
        sides[:own], orders[:own], floors[:own] = outcome.sides, outcome.orders, outcome.guard_floors
        orders[active], floors[active] = outcome.monitor_orders, outcome.monitor_floors
        z = np.concatenate([outcome.z, modes])
        return HybridState.of(replace(outcome, z=z, sides=sides, orders=orders, guard_floors=floors), p)

    def outcome(self, state: HybridState) -> Outcome:
        """Convert a state of the system with corners to an outcome of the model with monitors."""
        whole, own, components = state.outcome(), self.plain.guard_count, len(self.plain.automata)
        modes = whole.z[components:]
        active = self._guards[np.arange(self.count), modes]
        return replace(
            whole,
            z=whole.z[:components],
            sides=whole.sides[:own],
            orders=whole.orders[:own],
            guard_floors=whole.guard_floors[:own],
            monitor_sides=1 - 2 * modes,
            monitor_orders=whole.orders[active],
            monitor_floors=whole.guard_floors[active],
        )
