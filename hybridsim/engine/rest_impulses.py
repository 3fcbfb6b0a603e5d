"""Impulses that take the last of their motion from contacts that close: the other momentum stays what it was."""

from __future__ import annotations

import numpy as np


def stopped(x: np.ndarray, rates: np.ndarray, slopes: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """The states after impulses P along m contacts with which their rates (m,) come to zero.

    slopes, changes (m, n): of the rates by the states, and of the states by impulses (`System.impulses`). Where
    contacts depend on each other the P are the smallest.
    """
    impulses = np.linalg.lstsq(slopes @ changes.T, -rates, rcond=None)[0]
    return np.asarray(x + impulses @ changes)
