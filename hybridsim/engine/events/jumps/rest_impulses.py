"""Compute impulses that stop closing contacts and leave the remaining momentum unchanged."""

from __future__ import annotations

import numpy as np


def stopped(x: np.ndarray, rates: np.ndarray, slopes: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Return the states after impulses at m contacts that bring the rates (m,) of their gaps to zero.

    slopes, changes (m, n): derivatives of the rates by the states, and of the states by impulses (`System.impulses`).
    If contacts depend on each other, P has the smallest norm.
    """
    impulses = np.linalg.lstsq(slopes @ changes.T, -rates, rcond=None)[0]
    return np.asarray(x + impulses @ changes)


def loaded(changes: np.ndarray, loads: np.ndarray, sliding: np.ndarray) -> np.ndarray:
    """Return the changes (m, n) of the states per unit normal impulse, including the friction that it causes.

    loads (2, m, m): friction per load, forward and backward (`System.impulses`). sliding (m,): 1, -1, or 0 for a
    contact that does not slide.
    """
    shares = np.where(sliding[:, None] > 0, loads[0], np.where(sliding[:, None] < 0, -loads[1], 0.0))
    return np.asarray(changes + shares.T @ changes)
