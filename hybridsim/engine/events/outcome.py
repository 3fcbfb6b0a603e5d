"""What goes into the decision of an event and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

_STATE = (
    "x", "p", "z", "sides", "orders", "monitor_sides", "monitor_orders", "x_error", "guard_floors", "monitor_floors",
)  # fmt: skip


@dataclass
class Situation:
    """Where an event happens: the state before it, and how well its instant is known."""

    s: float
    x: np.ndarray
    p: np.ndarray
    z: np.ndarray
    x_error: np.ndarray
    s_error: float
    # a start or a reset has put the state where it is: zeros are known to the roundoff of the model's numbers
    is_put: bool = False


@dataclass(frozen=True)
class Change:
    """One transition of one component."""

    component: int
    guard: str
    source: int
    target: int
    x_minus: np.ndarray
    x_plus: np.ndarray


@dataclass
class Outcome:
    """What holds just after an event, or why nothing does."""

    x: np.ndarray
    p: np.ndarray
    z: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    monitor_sides: np.ndarray
    monitor_orders: np.ndarray
    x_error: np.ndarray  # how well the states are known: what locating the event left over
    guard_floors: np.ndarray  # the same for the guards and monitors that start from zero
    monitor_floors: np.ndarray
    changes: list[Change] = field(default_factory=list)
    continuous: bool = False  # the flow went on without a jump: the step size may be kept
    status: str = ""
    message: str = ""
    warnings: list[str] = field(default_factory=list)

    def arrays(self) -> dict[str, np.ndarray]:
        """What a run needs to go on from here, by names."""
        state = {name: getattr(self, name) for name in _STATE}
        return state | {"continuous": np.array(self.continuous)}

    @classmethod
    def of_arrays(cls, arrays: dict[str, np.ndarray]) -> Outcome:
        """The outcome of these arrays, with arrays of its own."""
        state: dict[str, Any] = {name: arrays[name].copy() for name in _STATE}
        return cls(**state, continuous=bool(arrays["continuous"]))

    def copy(self) -> Outcome:
        """The same with arrays of its own."""
        return Outcome(
            self.x.copy(), self.p.copy(), self.z.copy(), self.sides.copy(), self.orders.copy(),
            self.monitor_sides.copy(), self.monitor_orders.copy(), self.x_error.copy(),
            self.guard_floors.copy(), self.monitor_floors.copy(),
            self.changes, self.continuous, self.status, self.message, self.warnings,
        )  # fmt: skip
