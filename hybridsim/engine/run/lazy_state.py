"""The state at the origin of a segment, computed on demand; a run in one compiled call never needs it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


class LazyState:
    """The outcome of the last event and the run-time vector, both computed on demand.

    Parameters
    ----------
    make : makes the outcome.
    shared : outcome and vector stored elsewhere, for reading only.
    """

    def __init__(
        self,
        system: System,
        instant: Instant,
        forward: bool,
        make: Callable[[], Outcome],
        shared: tuple[Outcome, np.ndarray] | None = None,
    ) -> None:
        self._system, self._instant, self._forward, self._make, self._shared = (
            system,
            instant,
            forward,
            make,
            shared,
        )

    @cached_property
    def outcome(self) -> Outcome:
        """Return the outcome of the last event."""
        return self._make()

    @cached_property
    def p(self) -> np.ndarray:
        """Return the run-time vector: parameters, inputs and discrete states."""
        return self._system.vector(self._instant, self._system.discrete(self.outcome.p), self._forward)

    def read(self) -> tuple[Outcome, np.ndarray]:
        """Return the outcome and the run-time vector for reading; they must not be modified."""
        return self._shared or (self.outcome, self.p)
