"""A storey on a sliding base under a record that is a polynomial between its knots, by matrix exponentials.

Between two knots and in one mode the system is linear with polynomial forcing, so that its state, augmented by
the powers of time, is an exponential of a matrix. Knots, events and decisions are handled here from scratch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PPoly

LOOKS = 64  # points between two knots at which signs are compared
SIGNS = {"slip+": 1.0, "slip-": -1.0, "stick": 0.0}


@dataclass(frozen=True)
class Run:
    """Events (t, mode after) and the states (x, v, d, w) at the knots."""

    events: list[tuple[float, str]]
    knots: np.ndarray
    states: np.ndarray


class ShakenStorey:
    """The scene with its numbers, driven by an acceleration given as pieces (at most cubic)."""

    def __init__(self, p: Mapping[str, float], ground: PPoly) -> None:
        self.p, self.ground = p, ground
        m_b, m_s, k, c = p["m_b"], p["m_s"], p["k_s"], p["c_s"]
        self.limit = p["mu"] * p["W"]
        self.bearing = p["W"] / p["R"]
        storey = np.array([0.0, 0.0, k, c])  # force of the storey on the base
        # what friction has to hold in stick, without the inertia m_b*a_g: S - bearing*x
        self.load = storey - np.array([self.bearing, 0.0, 0.0, 0.0])
        self.rows = {}
        for mode, sign in SIGNS.items():
            base = self.load / m_b if sign else np.zeros(4)
            rest = -sign * self.limit / m_b
            # absolute acceleration of the base is base.x + rest in slip; in stick the ground's own
            A = np.zeros((4, 4))
            A[0, 1], A[2, 3] = 1.0, 1.0
            A[1], A[3] = base, -storey / m_s - base
            B = np.array([0.0, -1.0 if sign else 0.0, 0.0, 0.0 if sign else -1.0])
            self.rows[mode] = (A, B, np.array([0.0, rest, 0.0, -rest]))

    def matrix(self, mode: str, coefficients: np.ndarray) -> np.ndarray:
        """Generator of X = (x, v, d, w, 1, s, s^2, s^3), s the time since the knot."""
        A, B, constant = self.rows[mode]
        M = np.zeros((8, 8))
        M[:4, :4], M[:4, 4] = A, constant
        M[:4, 4 : 4 + len(coefficients)] += np.outer(B, coefficients[::-1])
        for power in (1, 2, 3):
            M[4 + power, 3 + power] = power
        return M

    def run(self, t1: float) -> Run:
        """From rest, in stick, to the knot t1."""
        knots = self.ground.x[self.ground.x <= t1]
        x, mode = np.zeros(4), "stick"
        events: list[tuple[float, str]] = []
        states = [x]
        for i, (a, b) in enumerate(pairwise(knots)):
            coefficients, s = self.ground.c[:, i], 0.0
            while True:
                M, h = self.matrix(mode, coefficients), (b - a) - s
                step = exponential(M * (h / LOOKS))
                points = [np.array([*x, 1.0, s, s**2, s**3])]
                for _ in range(LOOKS):
                    points.append(step @ points[-1])
                found = first_negative(points, self.guards(mode, coefficients))
                if found is None:
                    x = points[-1][:4]
                    break
                k, row = found
                at = bisect(M, points[k], h / LOOKS, row)
                X = exponential(M * at) @ points[k]
                s += k * h / LOOKS + at
                x, mode = X[:4].copy(), self.after(mode, X, coefficients)
                x[1] = 0.0
                events.append((a + s, mode))
            states.append(x)
        return Run(events, knots, np.array(states))

    def held(self, coefficients: np.ndarray) -> np.ndarray:
        """The force that friction has to bear in stick, as a row over the augmented state."""
        row = np.zeros(8)
        row[:4] = self.load
        row[4 : 4 + len(coefficients)] = -self.p["m_b"] * coefficients[::-1]
        return row

    def guards(self, mode: str, coefficients: np.ndarray) -> list[np.ndarray]:
        """Rows that are positive while the mode lasts."""
        row = np.zeros(8)
        if SIGNS[mode]:
            row[1] = SIGNS[mode]
            return [row]
        limit = np.zeros(8)
        limit[4] = self.limit
        return [limit - self.held(coefficients), limit + self.held(coefficients)]

    def after(self, mode: str, X: np.ndarray, coefficients: np.ndarray) -> str:
        """What follows: friction holds if it can, else the base goes where it is pushed."""
        force = self.held(coefficients) @ X
        if SIGNS[mode] and abs(force) < self.limit:
            return "stick"
        return "slip+" if force > 0 else "slip-"


def exponential(M: np.ndarray) -> np.ndarray:
    """exp(M) by its Taylor series, for the small steps taken here: rates of some 30/s over at most 0.3 ms.

    (SciPy's is made for any matrix, and its many threads take a hundred times longer on one of 8 rows.)
    """
    total = term = np.eye(len(M))
    for k in range(1, 25):
        term = term @ M / k
        total = total + term
    return total


def first_negative(points: list[np.ndarray], rows: list[np.ndarray]) -> tuple[int, np.ndarray] | None:
    """Number of the point before the first at which a row is negative, and that row."""
    for k, X in enumerate(points[1:]):
        for row in rows:
            if row @ X < 0.0:
                return k, row
    return None


def bisect(M: np.ndarray, X: np.ndarray, h: float, row: np.ndarray) -> float:
    """Time in (0, h] at which a row falls through zero, to rounding."""
    low, high = 0.0, h
    for _ in range(53):
        middle = (low + high) / 2
        low, high = (middle, high) if row @ exponential(M * middle) @ X >= 0.0 else (low, middle)
    return high
