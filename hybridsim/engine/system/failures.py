"""Why a step of an integrator cannot be taken."""

from __future__ import annotations


class StepFailure(Exception):
    """The integrator cannot go on from here; the message says why."""


class Collapsed(StepFailure):
    """No step is short enough."""


class Creeping(Collapsed):
    """The integrator has led nowhere for many steps: the solution ends at the local time `since`."""

    def __init__(self, message: str, since: float) -> None:
        super().__init__(message)
        self.since = since
