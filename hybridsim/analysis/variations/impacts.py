"""This module computes derivatives of the states through impacts of unilateral contacts.

The contacts that close, stay open, slip or stick in an impact are those of the run. The impulses then solve a linear
system, which is differentiated (see `hybridsim.engine.events.jumps.impulse` for the law).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from hybridsim.engine.events.jumps.impulse import Answer, ImpactProblem, answers
from hybridsim.engine.series.dual_numbers import Dual, differentiated, values_and_slopes
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError

_SAME = 1e-9  # of their terms: impulses and rates that differ by less are equal


class Impacts:
    """Computes the states just after impacts, with derivatives in M directions."""

    def __init__(self, system: System) -> None:
        module: Any = system.code.module
        self.system, self._m = system, len(system.surface_of)
        self._impulses, self._rates = differentiated(module.impulses), differentiated(module.stepped)
        self._restitutions = differentiated(module.restitutions)

    def after(
        self, closing: Iterable[int], t: float, s: Dual, x: list[Dual], p: list[Any], z: np.ndarray
    ) -> list[Dual]:
        """Return the states just after the impact of some components whose gaps close.

        t : time of the impact, for messages. s, x, p, z : local time, states, run-time vector and modes before it.
        """
        states, closing = list(x), set(closing)
        for cluster in self.system.clusters:
            if not closing.isdisjoint(cluster):
                states = self._cluster(cluster, closing, t, s, states, p, np.maximum(z, 0))
        return states

    def _cluster(
        self,
        cluster: tuple[int, ...],
        closing: set[int],
        t: float,
        s: Dual,
        x: list[Dual],
        p: list[Any],
        z: np.ndarray,
    ) -> list[Dual]:
        """Return the states just after a simultaneous impact of coupled contacts."""
        system, n, m, width = self.system, self.system.n, self._m, len(s.slope)
        out: list[Any] = [0.0] * (2 * m * (n + m))
        self._impulses(s, x, p, z, out)
        values, slopes = values_and_slopes(out, width)
        changes, d_changes = (
            values[m * n : 2 * m * n].reshape(m, n),
            slopes[m * n : 2 * m * n].reshape(m, n, width),
        )
        rows, d_rows = values[: m * n].reshape(m, n), slopes[: m * n].reshape(m, n, width)
        loads, d_loads = values[2 * m * n :].reshape(2, m, m), slopes[2 * m * n :].reshape(2, m, m, width)
        place = {c: k for k, c in enumerate(system.surface_of)}
        automata = system.automata
        normal = [
            c for c in cluster if c in closing or (automata[c].is_unilateral and z[c] == automata[c].hold)
        ]
        normal_rows = [place[c] for c in normal]
        rubbing = [c for c in cluster if loads[:, place[c]][:, normal_rows].any()]
        members = np.array([place[c] for c in (*normal, *rubbing)])
        out = [0.0] * (m + 2 * m * n + 4 * m * m)
        self._rates(s, x, p, z, out)
        speeds, d_speeds = (each[:m][members] for each in values_and_slopes(out, width))
        for i, c in enumerate((*normal, *rubbing)):
            if z[c] == automata[c].hold and c not in closing:
                speeds[i], d_speeds[i] = 0.0, 0.0
        k = len(normal)
        e, d_e = self._restitution(s, x, p, z, normal_rows, speeds[:k], d_speeds[:k])
        effects = rows[members] @ changes[members].T
        d_effects = np.einsum("inw,jn->ijw", d_rows[members], changes[members])
        d_effects += np.einsum("in,jnw->ijw", rows[members], d_changes[members])
        ends = [loads[side][np.ix_(members[k:], members[:k])] for side in (0, 1)]
        d_ends = [d_loads[side][np.ix_(members[k:], members[:k])] for side in (0, 1)]
        problem = ImpactProblem(effects, speeds, e, *ends)
        names = ", ".join(automata[c].name for c in (*normal, *rubbing))
        matrix, answer = self._system(problem, names, t)
        d_right = -d_speeds.copy()
        approach = np.maximum(-speeds[:k], 0.0)
        d_right[:k] += (
            d_e * approach[:, None] + e[:, None] * np.where(approach > 0.0, 1.0, 0.0)[:, None] * -d_speeds[:k]
        )
        d_left = np.einsum("ijw,j->iw", d_effects, answer.impulses)
        kinds = _kinds(problem, answer)
        d_right = np.where((kinds == 1)[:, None], d_right - d_left, 0.0)
        for i in range(k, len(members)):
            if kinds[i] > 1:
                side = kinds[i] - 2
                d_right[i] = (1.0, -1.0)[side] * np.einsum(
                    "jw,j->w", d_ends[side][i - k], answer.impulses[:k]
                )
        d_impulses = np.linalg.solve(matrix, d_right)
        _refuse_undecided(problem, answer, kinds, d_impulses, names, t)
        moved = changes[members].T @ d_impulses + np.einsum("inw,i->nw", d_changes[members], answer.impulses)
        jump = changes[members].T @ answer.impulses
        return [Dual(one.value + jump[i], one.slope + moved[i]) for i, one in enumerate(x)]

    def _restitution(
        self,
        s: Dual,
        x: list[Dual],
        p: list[Any],
        z: np.ndarray,
        rows: list[int],
        speeds: np.ndarray,
        slopes: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients of restitution (k,) and their derivatives (k, M)."""
        width = len(s.slope)
        approach = [Dual(0.0, np.zeros(width)) for _ in range(self._m)]
        for row, speed, slope in zip(rows, speeds.tolist(), slopes, strict=True):
            if speed < 0.0:
                approach[row] = Dual(-speed, -slope)
        out: list[Any] = [0.0] * self._m
        self._restitutions(s, [*x, *approach], p, z, out)
        values, found = values_and_slopes(out, width)
        return np.clip(values[rows], 0.0, 1.0), found[rows]

    def _system(self, problem: ImpactProblem, names: str, t: float) -> tuple[np.ndarray, Answer]:
        """Return the matrix of the linear equations for the impulses, and the impulses."""
        found = answers(problem)
        if len(found) != 1 or found[0].reduced:
            reason = "whose rebound was reduced to lose energy" if found else "whose outcome is not unique"
            raise UsageError(
                f"derivatives are not supported through the impact of {names} at t = {t:.9g}, {reason}",
                remedy="use a run that ends before this time",
            )
        answer, k = found[0], problem.normal
        matrix = np.eye(len(problem.before))
        for i, kind in enumerate(_kinds(problem, answer)):
            if kind == 1:
                matrix[i] = problem.effects[i]
            elif kind == 2:
                matrix[i, :k] = -problem.up[i - k]
            elif kind == 3:
                matrix[i, :k] = problem.down[i - k]
        return matrix, answer


def _kinds(problem: ImpactProblem, answer: Answer) -> np.ndarray:
    """Return the behaviour of each contact: 0 open, 1 closed or sticking, 2 and 3 slipping forward and backward."""
    k = problem.normal
    rebound = problem.restitution * np.maximum(-problem.before[:k], 0.0)
    kinds = np.ones(len(problem.before), dtype=np.int64)
    kinds[:k] = (answer.impulses[:k] > 0.0) | (np.abs(answer.after[:k] - rebound) <= answer.bounds[:k])
    pushed = answer.impulses[:k] > 0.0
    is_loaded = (problem.up[:, pushed] != 0.0).any(axis=1) | (problem.down[:, pushed] != 0.0).any(axis=1)
    slips = np.where(answer.after[k:] > 0.0, 2, 3)
    kinds[k:] = np.where(is_loaded, np.where(answer.zero[k:], 1, slips), 0)
    return kinds


def _refuse_undecided(
    problem: ImpactProblem, answer: Answer, kinds: np.ndarray, d_impulses: np.ndarray, names: str, t: float
) -> None:
    """Raise an error for an impact between two outcomes if a small change decides which one occurs."""
    k, P = problem.normal, answer.impulses
    size = _SAME * np.abs(P).max(initial=0.0)
    border = np.zeros(len(P), dtype=bool)
    border[:k] = (kinds[:k] == 1) & (P[:k] <= size)
    most, least = problem.up @ P[:k], -(problem.down @ P[:k])
    border[k:] = (kinds[k:] == 1) & ((P[k:] >= most - size) | (P[k:] <= least + size))
    moves = np.abs(d_impulses).max(axis=1, initial=0.0) > _SAME * np.abs(d_impulses).max(initial=0.0)
    if (border & moves).any():
        raise UsageError(
            f"at t = {t:.9g} {names} have an impact exactly on the border between two outcomes, so there is no "
            "derivative",
            remedy="use other parameters, or a run that ends before this time",
        )
