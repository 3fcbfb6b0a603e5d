"""Errors of integrators that cannot take a step."""

from __future__ import annotations


class StepFailure(Exception):
    """The integrator cannot continue from here; the message gives the reason."""


class Collapsed(StepFailure):
    """The step size became too small without success."""


class Creeping(Collapsed):
    """The steps have become too short for progress; the solution ends at the local time `since`."""

    def __init__(self, message: str, since: float) -> None:
        super().__init__(message)
        self.since = since
