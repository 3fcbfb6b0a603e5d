"""Compute the impulses of simultaneous impacts and the rates after them, without access to the model.

Of the contacts that take part, some are normal (their rates are those of gaps) and the others tangential:

    u+ = u- + G P
    normal      0 <= P_i,   u+_i >= e_i max(-u-_i, 0),   and one of the two with equality
    tangential  -down_i . P <= P_i <= up_i . P,   P_i at the upper end where u+_i > 0, at the lower where u+_i < 0

A friction impulse counts as positive where it opposes a positive velocity, as the force does.

Energy. With p = (P, -P_t) the work of the impulses is p . (u- + u+)/2. For normal impulses it is the sum of
-(1 - e_i)/2 P_i |u-_i|; for friction without rebound (e = 0) it is -p . G p/2 or less; with friction and rebound
together it may be positive (Kane's paradox). Then the impulses are taken on the straight line from those without
rebound to those of the law, as far as no energy is gained. Admissible impulses form a convex set, so these are
admissible too.

Sources: J. J. Moreau, in Nonsmooth Mechanics and Applications (Springer, 1988) 1, doi:10.1007/978-3-7091-2624-0_1;
C. Glocker, Multibody Syst. Dyn. 29 (2013) 77, doi:10.1007/s11044-012-9316-9, on the energy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from hybridsim.engine.series.bounded import UNIT

MAX_COMBINATIONS = 3**8  # largest number of combinations of closed, open, slipping and sticking contacts
_OPERATIONS = 64.0  # largest number of roundings per contact in a number of the solution
_OFF, _ON, _FORWARD, _BACKWARD = range(4)


@dataclass(frozen=True)
class ImpactProblem:
    """The data of an impact on several contacts: normal contacts first, then friction contacts.

    Parameters
    ----------
    effects : G (m, m).
    before : u- (m,), exactly zero if it is known to be.
    restitution : e (k,) of the k normal contacts.
    up, down : friction impulse limits at the upper and lower end for a unit of each normal impulse, (m - k, k).
    """

    effects: np.ndarray
    before: np.ndarray
    restitution: np.ndarray
    up: np.ndarray
    down: np.ndarray

    @property
    def normal(self) -> int:
        """Return the number of normal contacts."""
        return len(self.restitution)


@dataclass(frozen=True)
class Answer:
    """One solution of the impact law: the impulses, and the rates after the impact."""

    impulses: np.ndarray  # P (m,)
    after: np.ndarray  # rates after the impact (m,)
    bounds: np.ndarray  # their error bounds (m,)
    zero: np.ndarray  # mask (m,) of rates that are exactly zero by the law
    reduced: bool = False  # whether the impulses were reduced because energy would have grown


def count(problem: ImpactProblem) -> int:
    """Return how many combinations of contact states have to be tried."""
    return 2**problem.normal * 3 ** (len(problem.before) - problem.normal)


def answers(problem: ImpactProblem) -> list[Answer]:
    """Return the solutions of the impact law, with one solution for each different motion."""
    rebound = problem.restitution * np.maximum(-problem.before[: problem.normal], 0.0)
    found = _answers(problem, rebound)
    if len(found) != 1 or not _gains(problem, found[0].impulses) or not rebound.any():
        return found
    dead = _answers(problem, np.zeros(problem.normal))
    return [_between(problem, dead[0], found[0])] if len(dead) == 1 else dead


def energy(problem: ImpactProblem, impulses: np.ndarray) -> tuple[float, float]:
    """Return the work of the impulses, and a bound of its rounding error."""
    n = problem.normal
    sign = np.where(np.arange(len(impulses)) < n, 1.0, -1.0)
    p, metric = sign * impulses, problem.effects * sign
    change = metric @ p
    terms = np.abs(p) @ (np.abs(problem.before) + 0.5 * np.abs(metric) @ np.abs(p))
    return float(p @ (problem.before + 0.5 * change)), float(_rounding(problem) * terms)


def _gains(problem: ImpactProblem, impulses: np.ndarray) -> bool:
    work, bound = energy(problem, impulses)
    return work > bound


def _rounding(problem: ImpactProblem) -> float:
    return _OPERATIONS * len(problem.before) * UNIT


def _answers(problem: ImpactProblem, rebound: np.ndarray) -> list[Answer]:
    """Solve for the impulses of all combinations, and return the solutions that satisfy the impact law."""
    m, n = len(problem.before), problem.normal
    state = _combinations(problem)
    matrix, right = np.tile(np.eye(m), (len(state), 1, 1)), np.zeros((len(state), m))
    on = state == _ON
    rows, members = np.nonzero(on)
    matrix[rows, members] = problem.effects[members]
    right[:, :n] = np.where(on[:, :n], rebound - problem.before[:n], 0.0)
    right[:, n:] = np.where(on[:, n:], -problem.before[n:], 0.0)
    for slips, ends in ((_FORWARD, -problem.up), (_BACKWARD, problem.down)):
        rows, members = np.nonzero(state == slips)
        matrix[rows, members, :n] = ends[members - n]
    regular = np.linalg.det(matrix) != 0.0
    state, on, matrix, right = state[regular], on[regular], matrix[regular], right[regular]
    inverse = np.linalg.inv(matrix)
    impulses = np.where(state == _OFF, 0.0, np.einsum("sij,sj->si", inverse, right))
    unit, sizes = _rounding(problem), np.abs(impulses)
    off = unit * np.einsum("sij,sjk,sk->si", np.abs(inverse), np.abs(matrix), sizes)
    impulses[:, :n] = np.where(sizes[:, :n] <= off[:, :n], 0.0, impulses[:, :n])
    after = problem.before + impulses @ problem.effects.T
    bounds = (
        unit * (np.abs(problem.before) + sizes @ np.abs(problem.effects).T) + off @ np.abs(problem.effects).T
    )
    after, bounds = np.where(on, 0.0, after), np.where(on, 0.0, bounds)
    after[:, :n] = np.where(on[:, :n], rebound, after[:, :n])
    normal, tangential = impulses[:, :n], impulses[:, n:]
    most, least = normal @ problem.up.T + off[:, n:], -(normal @ problem.down.T) - off[:, n:]
    admitted = (normal >= 0.0).all(axis=1) & (after[:, :n] >= rebound - bounds[:, :n]).all(axis=1)
    admitted &= (~on[:, n:] | ((tangential <= most) & (tangential >= least))).all(axis=1)
    admitted &= ((state != _FORWARD) | (after >= -bounds)).all(axis=1)
    admitted &= ((state != _BACKWARD) | (after <= bounds)).all(axis=1)
    found: list[Answer] = []
    for k in np.flatnonzero(admitted):
        zero = on[k] & (after[k] == 0.0)
        zero[:n] |= np.abs(after[k, :n]) <= bounds[k, :n]
        one = Answer(impulses[k], np.where(zero, 0.0, after[k]), bounds[k], zero)
        if not any(_same(one, other) for other in found):
            found.append(one)
    return found


def _combinations(problem: ImpactProblem) -> np.ndarray:
    """Return the combinations of contact states, one per row; rows with more closed contacts come first."""
    found = []
    for normal in product((_ON, _OFF), repeat=problem.normal):
        pushed = np.array(normal) == _ON
        loaded = (problem.up[:, pushed] != 0.0).any(axis=1) | (problem.down[:, pushed] != 0.0).any(axis=1)
        ways = [(_ON, _FORWARD, _BACKWARD) if is_loaded else (_OFF,) for is_loaded in loaded]
        found += [(*normal, *tangential) for tangential in product(*ways)]
    return np.array(found, dtype=np.int64)


def _same(one: Answer, other: Answer) -> bool:
    return bool((np.abs(one.after - other.after) <= one.bounds + other.bounds).all())


def _between(problem: ImpactProblem, dead: Answer, lively: Answer) -> Answer:
    """Mix `lively` impulses, which do positive work, with `dead` impulses, so that the work is not positive.

    The work is quadratic in the position w on this line, not positive at 0 and positive at 1.
    """
    start, end = energy(problem, dead.impulses)[0], energy(problem, lively.impulses)[0]
    middle = energy(problem, 0.5 * (dead.impulses + lively.impulses))[0]
    start = min(start, 0.0)
    square = 2.0 * (start + end - 2.0 * middle)
    linear = end - start - square
    root = math.sqrt(max(linear * linear - 4.0 * square * start, 0.0))
    way = -2.0 * start / (linear + root) if linear + root > 0.0 else 0.0
    way = min(max(way, 0.0), 1.0) * (1.0 - _rounding(problem))
    impulses = dead.impulses + way * (lively.impulses - dead.impulses)
    after = dead.after + way * (lively.after - dead.after)
    zero = dead.zero & (lively.zero | (way == 0.0))
    return Answer(impulses, np.where(zero, 0.0, after), dead.bounds + lively.bounds, zero, reduced=True)
