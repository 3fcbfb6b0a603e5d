"""This module defines the interface from which a solution reads the results of a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from hybridsim.expr import evaluate
from hybridsim.expr.grammar import TIME
from hybridsim.model import Contact, Model
from hybridsim.presentation.tables import Table
from hybridsim.solution.event import Event, ModeInterval


def relative_velocity(contact: str) -> str:
    """Return the name of the relative velocity of a contact in `Solution.output`."""
    return f"v_rel({contact})"


class RunTrajectory(Protocol):
    """The trajectory of a run, which `Solution` evaluates after checking the arguments."""

    model: Any  # the Model or MechanicalSystem
    integrator: str
    save: str | float  # the stored part of the run, as in `simulate`
    grid: np.ndarray | None  # requested times of the solution
    reason: str  # why "auto" chose the integrator

    @property
    def names(self) -> tuple[str, ...]: ...  # states, in the order of rows of y
    @property
    def quantities(self) -> tuple[str, ...]: ...  # what `values` knows in addition to the states
    @property
    def components(self) -> Sequence[Any]: ...  # named objects, those of `modes`
    @property
    def event_names(self) -> Sequence[str]: ...  # what `event_times` knows
    @property
    def t_start(self) -> float: ...
    @property
    def t_end(self) -> float: ...
    @property
    def has_states(self) -> bool: ...  # whether anything was computed
    @property
    def own_times(self) -> np.ndarray: ...  # (m,), event times twice
    @property
    def own_states(self) -> np.ndarray: ...  # (n, m) at `own_times`
    @property
    def x_end(self) -> np.ndarray: ...  # (n,)
    @property
    def events(self) -> Sequence[Event]: ...
    @property
    def corners(self) -> tuple[Event, ...]: ...
    @property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]: ...
    @property
    def status(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def warnings(self) -> tuple[str, ...]: ...
    @property
    def stats(self) -> dict[str, float]: ...
    @property
    def work(self) -> dict[str, float] | None: ...  # energy by source; None if the run did not measure it

    def states(self, times: np.ndarray, side: str) -> np.ndarray:
        """Return states (k, n) at times (k,), just after ("+") or before ("-") events."""

    def values(self, name: str, times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (k,) of a state or a quantity at times (k,)."""

    def friction_powers(self, times: np.ndarray) -> np.ndarray:
        """Return the friction force times the relative velocity (k, contacts) of each contact at times (k,)."""

    def own_values(self, name: str) -> np.ndarray:
        """Return the values (m,) of a state or a quantity at `own_times`."""

    def event_times(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times (m,) of the events of a component."""

    def event_states(self, component: str, kind: str | None, side: str) -> np.ndarray:
        """Return the states (m, n) at the events of a component, in a new array."""

    def table(self, times: np.ndarray | None) -> Table:
        """Return states, quantities and modes at given times, or at `own_times`."""

    def summary(self) -> list[str]:
        """Return the lines of a summary that come between the message and the warnings."""


def contacts_without_stick(model: Model, with_stick: Collection[str]) -> dict[str, Contact]:
    """Return the contacts by the names of their relative velocities, except those with a surface for stick."""
    contacts = {relative_velocity(contact.name): contact for contact in model.contacts}
    return {name: contact for name, contact in contacts.items() if name not in with_stick}


def velocity_of(
    contact: Contact, values: Mapping[str, np.ndarray], times: np.ndarray, parameters: Mapping[str, float]
) -> np.ndarray:
    """Return the relative velocity (k,) of a contact at times (k,), from the values (k,) of its variables."""
    names = (*values, TIME)
    rows = zip(*(column.tolist() for column in (*values.values(), times)), strict=True)
    known = (dict(parameters) | dict(zip(names, row, strict=True)) for row in rows)
    return np.array([evaluate(contact.velocity, here) for here in known])
