"""The input and the result of resolving an event."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridsim.engine.system.system import System

_STATE = (
    "x", "p", "z", "sides", "orders", "monitor_sides", "monitor_orders", "x_error", "guard_floors", "monitor_floors",
)  # fmt: skip


@dataclass
class Situation:
    """The state before an event, with the error bounds of the state and of the time."""

    s: float  # local time
    x: np.ndarray  # states (n,)
    p: np.ndarray  # run-time vector
    z: np.ndarray  # modes (C,); -1 for a component without a mode yet
    x_error: np.ndarray  # error bounds (n,) of the states
    s_error: float  # error bound of the local time
    is_put: bool = (
        False  # a start or reset set the state: zeros are accurate to the roundoff of the model's numbers
    )


@dataclass(frozen=True)
class Change:
    """One transition of one component: its modes before and after."""

    component: int
    guard: str
    source: int
    target: int
    x_minus: np.ndarray
    x_plus: np.ndarray


@dataclass
class Outcome:
    """The state just after an event, or the reason why there is none."""

    x: np.ndarray
    p: np.ndarray
    z: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    monitor_sides: np.ndarray
    monitor_orders: np.ndarray
    x_error: np.ndarray  # error bounds (n,) of the states that remain after locating the event
    guard_floors: np.ndarray  # error bounds of guards that start from zero
    monitor_floors: np.ndarray  # the same for monitors
    changes: list[Change] = field(default_factory=list)
    continuous: bool = False  # the flow has no jump, so the step size may be kept
    status: str = ""
    message: str = ""
    warnings: list[str] = field(default_factory=list)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return by name the arrays that a run needs to continue from this state."""
        state = {name: getattr(self, name) for name in _STATE}
        return state | {"continuous": np.array(self.continuous)}

    @classmethod
    def of_arrays(cls, arrays: dict[str, np.ndarray]) -> Outcome:
        """Return an outcome with copies of the given arrays."""
        state: dict[str, Any] = {name: arrays[name].copy() for name in _STATE}
        return cls(**state, continuous=bool(arrays["continuous"]))

    @classmethod
    def blank(cls, system: System, p: np.ndarray) -> Outcome:
        """Return an outcome with zero states and first modes, with all guards positive and without monitors."""
        guards, n, whole = system.guard_count, system.n, np.int64
        x, modes, none = np.zeros(n), np.zeros(len(system.automata), dtype=whole), np.zeros(0, dtype=whole)
        sides, orders = np.ones(guards, dtype=whole), np.zeros(guards, dtype=whole)
        return cls(x, p, modes, sides, orders, none, none, np.zeros(n), np.zeros(guards), np.zeros(0))

    def leave_zeros(self) -> None:
        """Mark all guards as positive and all monitors as different from zero."""
        self.sides[:], self.orders[:], self.guard_floors[:] = 1, 0, 0.0
        self.monitor_orders[:], self.monitor_floors[:] = 0, 0.0

    def copy(self) -> Outcome:
        """Return a copy with its own arrays."""
        return Outcome(
            self.x.copy(), self.p.copy(), self.z.copy(), self.sides.copy(), self.orders.copy(),
            self.monitor_sides.copy(), self.monitor_orders.copy(), self.x_error.copy(),
            self.guard_floors.copy(), self.monitor_floors.copy(),
            self.changes, self.continuous, self.status, self.message, self.warnings,
        )  # fmt: skip
