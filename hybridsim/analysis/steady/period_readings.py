"""This module computes amplitudes, energies and times in modes from summaries of motions over a period."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from hybridsim.engine.system.system import System
    from hybridsim.ensemble.points import PeriodSummary

_OF_STATES = ("amplitude", "peak", "maximum", "minimum", "mean", "rms", "energy")
_OF_CONTACTS = ("stick_fraction", "stops_per_period")


class Summarised(Protocol):
    """The motions of several points, each over its own period, with the lengths and summaries of the periods."""

    @property
    def periods(self) -> np.ndarray:
        """Lengths (m,) of the periods."""

    @property
    def summary(self) -> PeriodSummary:
        """The summaries, one row of each array per point."""


Reader = Callable[[Any], np.ndarray]


def period_reader(word: str, system: System) -> Reader | None:
    """Return a function that computes a measure (m,) from summaries of periods, or None if they do not contain it."""
    head, _, name = word.partition(".")
    if head in _OF_STATES and name in system.names:
        return _of_state(head, system.names.index(name))
    contacts = [automaton.name for automaton in system.automata]
    if head in _OF_CONTACTS and name in contacts:
        return _of_contact(head, contacts.index(name))
    component, _, mode = name.rpartition(".")
    if head == "mode_fraction" and component in contacts:
        c = contacts.index(component)
        modes = system.automata[c].modes
        return _of_mode(c, modes.index(mode)) if mode in modes else None
    return None


def summed(head: str, found: Summarised, system: System) -> dict[str, float]:
    """Return the values of one measure of states, contacts or modes for the motion of a single point."""
    modes = [f"{automaton.name}.{mode}" for automaton in system.automata for mode in automaton.modes]
    names = [*system.names, *(automaton.name for automaton in system.automata), *modes]
    readers = {name: period_reader(f"{head}.{name}", system) for name in names}
    return {name: float(read(found)[0]) for name, read in readers.items() if read is not None}


def _of_contact(head: str, c: int) -> Reader:
    def stick_fraction(found: Summarised) -> np.ndarray:
        return np.asarray(found.summary.held[:, 0, c] / found.periods)

    def stops_per_period(found: Summarised) -> np.ndarray:
        # an interval across the end of the period counts once, permanent stick counts zero
        return np.asarray(found.summary.held[:, 1, c] - found.summary.holding[:, :, c].all(axis=1))

    return stick_fraction if head == "stick_fraction" else stops_per_period


def _of_mode(c: int, mode: int) -> Reader:
    return lambda found: np.asarray(found.summary.times[:, c, mode] / found.periods)


def _of_state(head: str, i: int) -> Reader:
    def read(found: Summarised) -> np.ndarray:
        low, high = found.summary.extremes[:, :, i].T
        whole, squares = found.summary.integrals[:, :, i].T
        if head == "amplitude":
            return np.asarray(0.5 * (high - low))
        if head == "peak":
            return np.maximum(np.abs(low), np.abs(high))
        if head == "mean":
            return np.asarray(whole / found.periods)
        if head == "rms":
            return np.sqrt(squares / found.periods)
        return {"maximum": high, "minimum": low, "energy": squares}[head]

    return read
