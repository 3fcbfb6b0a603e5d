"""This module defines the errors of integrators that cannot take a step."""

from __future__ import annotations


class StepFailure(Exception):
    """Raised if the integrator cannot continue from the present state; the message gives the reason."""


class Collapsed(StepFailure):
    """Raised if the step size became too small without success."""


class Creeping(Collapsed):
    """Raised if steps are too short for progress; the solution ends at the local time `since`."""

    def __init__(self, message: str, since: float) -> None:
        super().__init__(message)
        self.since = since
