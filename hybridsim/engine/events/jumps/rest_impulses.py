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


def loaded(changes: np.ndarray, loads: np.ndarray, sliding: np.ndarray) -> np.ndarray:
    """Changes (m, n) of the states by impulses together with the friction that these load.

    loads (2, m, m): of friction by a load, forward and backward (`System.impulses`); sliding (m,): 1, -1, or 0 for
    what does not slide.
    """
    shares = np.where(sliding[:, None] > 0, loads[0], np.where(sliding[:, None] < 0, -loads[1], 0.0))
    return np.asarray(changes + shares.T @ changes)
