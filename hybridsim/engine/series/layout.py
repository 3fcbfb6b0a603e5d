"""This module defines the run-time vector p: parameters, discrete states, time origin, inputs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

SIGNAL_SLOTS = 5  # with d = t - c4: c0 + d (c1 + d (c2 + d c3)), or c3 sin(c0 + d (c1 + d c2)) for a chirp


@dataclass(frozen=True)
class Layout:
    """The offsets of quantities in the run-time vector p of a model."""

    parameters: int
    discrete: int
    phases: int
    signals: int

    @cached_property
    def discrete_at(self) -> int:
        """Return the offset of the first discrete state."""
        return self.parameters

    @cached_property
    def discrete_slice(self) -> slice:
        """Return the slice of the discrete states."""
        return slice(self.discrete_at, self.discrete_at + self.discrete)

    @cached_property
    def origin_at(self) -> int:
        """Return the offset of the origin of local time, for expressions in absolute time."""
        return self.parameters + self.discrete

    @cached_property
    def pin_at(self) -> int:
        """Return the offset of the flag that says whether held states are computed from constraints."""
        return self.origin_at + 1

    @cached_property
    def phases_at(self) -> int:
        """Return the offset of the angles rate*origin modulo 2 pi, one for each angular rate."""
        return self.pin_at + 1

    @cached_property
    def signals_at(self) -> int:
        """Return the offset of the present coefficients of each input."""
        return self.phases_at + self.phases

    @cached_property
    def size(self) -> int:
        """Return the length of the run-time vector."""
        return self.signals_at + SIGNAL_SLOTS * self.signals
