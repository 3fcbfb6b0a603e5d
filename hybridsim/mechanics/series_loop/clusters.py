"""This module computes the constraint forces and consistent velocities of sticking contacts.

A set of sticking contacts may be redundant (two in one direction, or more contacts than coordinates). The
motion is still unique. Of the possible forces those of least norm are used, f = G^+ g (A. Ben-Israel, T. N.
E. Greville, Generalized Inverses, 2nd ed., Springer 2003, section 7.6: full-rank factors)."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.system.instant import two_product, two_sum
from hybridsim.mechanics.codes import STICK
from hybridsim.mechanics.series_loop.expansion import base_speed

# A pivot below this fraction of its diagonal, times the size, is a rounding error of zero in a positive
# semidefinite elimination (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section
# 10.3.2).
_RANK = 64 * 2.0**-53
_CORRECTIONS = 2  # the first removes the rounding of G^+, the second that of the velocities


@kernel
def factorise(arrays: Any, state: Any, scratch: Any, j: int) -> None:
    """Compute the pseudo-inverse of the Delassus matrix of the sticking contacts of node j."""
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    m, size = last - first, 0
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        state.pin[x] = -1
    for c in range(first, last):
        state.anchor[c] = -1
        if state.mode[c] == STICK and state.held[c] == 0:
            scratch.order[size] = c - first
            size += 1
            if arrays.unit[c]:
                state.pin[arrays.w_col[arrays.w_ptr[c]]] = c
    state.holds[j] = size
    if size == 0:
        return
    _anchors(arrays, state, first, last)
    at = arrays.g_ptr[j]
    if m == 1:
        state.pinv[at] = 1.0 / arrays.g_val[at]
        return
    for i in range(m * m):
        state.pinv[at + i] = 0.0
    pseudo_inverse(arrays.g_val[at : at + m * m], m, scratch.order, size, scratch.tall, scratch.square)
    for a in range(size):
        for b in range(size):
            state.pinv[at + scratch.order[a] * m + scratch.order[b]] = scratch.square[a, b]


@kernel
def _anchors(arrays: Any, state: Any, first: int, last: int) -> None:
    """For each sticking contact on several coordinates, choose the coordinate that satisfies its constraint exactly.

    It is the coordinate with the largest weight. Contacts that share coordinates are solved by least squares only.
    """
    for c in range(first, last):
        if state.mode[c] != STICK or arrays.unit[c]:
            continue
        best, shares = 0.0, False
        for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
            x = arrays.w_col[e]
            for other in range(first, last):
                if other == c or state.mode[other] != STICK:
                    continue
                for f in range(arrays.w_ptr[other], arrays.w_ptr[other + 1]):
                    shares = shares or arrays.w_col[f] == x
            if abs(arrays.w_val[e]) > best:
                best, state.anchor[c] = abs(arrays.w_val[e]), x
        if shares:
            state.anchor[c] = -1


@kernel
def pseudo_inverse(G: Any, m: int, order: Any, size: int, L: Any, P: Any) -> int:
    """Write the pseudo-inverse of the submatrix `order` of a semidefinite matrix G, and return its rank.

    Pivoted Cholesky gives G = L L^T with L of full column rank; then G^+ = L (L^T L)^-2 L^T.
    """
    for a in range(size):
        for b in range(size):
            P[a, b] = G[order[a] * m + order[b]]
    rank = 0
    for _ in range(size):  # the pivots are not moved; a used row is marked by a negative diagonal
        pivot, best = -1, 0.0
        for a in range(size):
            scale = G[order[a] * m + order[a]]
            if P[a, a] > _RANK * size * scale and P[a, a] > best:
                pivot, best = a, P[a, a]
        if pivot < 0:
            break
        root = math.sqrt(best)
        for a in range(size):
            L[a, rank] = P[a, pivot] / root if P[a, a] >= 0.0 or a == pivot else 0.0
        for a in range(size):
            if a != pivot and P[a, a] >= 0.0:
                for b in range(size):
                    if b != pivot and P[b, b] >= 0.0:
                        P[a, b] -= L[a, rank] * L[b, rank]
                if P[a, a] < 0.0:
                    P[a, a] = 0.0
        P[pivot, pivot] = -1.0
        for a in range(size):
            if a != pivot:
                P[a, pivot] = P[pivot, a] = 0.0
        rank += 1
    _from_factor(L, size, rank, P)
    return rank


@kernel
def _from_factor(L: Any, size: int, rank: int, P: Any) -> None:
    """Set P = L (L^T L)^-2 L^T, where L is in the first `rank` columns; the other columns of L are overwritten."""
    # Compute S = L^T L = R R^T in the upper-left of P.
    for a in range(rank):
        for b in range(a + 1):
            total = 0.0
            for i in range(size):
                total += L[i, a] * L[i, b]
            P[a, b] = total
    for b in range(rank):
        for a in range(b, rank):
            total = P[a, b]
            for k in range(b):
                total -= P[a, k] * P[b, k]
            P[a, b] = math.sqrt(max(total, 0.0)) if a == b else total / P[b, b]
    # Replace the rows of L by rows of L S^-1.
    for i in range(size):
        for a in range(rank):
            total = L[i, a]
            for k in range(a):
                total -= P[a, k] * L[i, k]
            L[i, a] = total / P[a, a]
        for a in range(rank - 1, -1, -1):
            total = L[i, a]
            for k in range(a + 1, rank):
                total -= P[k, a] * L[i, k]
            L[i, a] = total / P[a, a]
    for i in range(size):
        for b in range(size):
            total = 0.0
            for a in range(rank):
                total += L[i, a] * L[b, a]
            P[i, b] = total


@inlined
def misfit(arrays: Any, c: int, v: Any, base: float) -> float:
    """Return the relative velocity w . v - base of a contact, summed in double-double precision."""
    high, low = -base, 0.0
    for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
        product, error = two_product(arrays.w_val[e], v[arrays.w_col[e]])
        high, rest = two_sum(high, product)
        low += error + rest
    return high + low


@kernel
def project(arrays: Any, state: Any, scratch: Any, j: int, tau: float, v: Any) -> None:
    """Make the velocities v (n,) satisfy the stick constraints of node j; call `factorise` first.

    Single coordinates are set exactly. The others get the least change in kinetic energy, v -= M^-1 W^T f
    with f = G^+ (W v - base), with the misfit in doubled precision; the remaining error is the rounding of v.
    """
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    m, several = last - first, False
    if m == 1 and arrays.unit[first]:
        if state.mode[first] == STICK:
            e = arrays.w_ptr[first]
            v[arrays.w_col[e]] = base_speed(arrays, state, first, tau) / arrays.w_val[e]
        return
    for c in range(first, last):
        if state.mode[c] == STICK and arrays.unit[c]:
            e = arrays.w_ptr[c]
            v[arrays.w_col[e]] = base_speed(arrays, state, c, tau) / arrays.w_val[e]
        several = several or (state.mode[c] == STICK and not arrays.unit[c])
    if not several:
        return
    for _ in range(_CORRECTIONS):
        for c in range(first, last):
            scratch.tall[c - first, 0] = 0.0
            if state.mode[c] == STICK and state.held[c] == 0:
                scratch.tall[c - first, 0] = misfit(arrays, c, v, base_speed(arrays, state, c, tau))
        for c in range(first, last):
            total, row = 0.0, arrays.g_ptr[j] + (c - first) * m
            for i in range(m):
                total += state.pinv[row + i] * scratch.tall[i, 0]
            scratch.tall[c - first, 1] = total
        for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
            if state.pin[x] < 0:
                for e in range(arrays.b_ptr[x], arrays.b_ptr[x + 1]):
                    v[x] -= arrays.b_val[e] * scratch.tall[arrays.b_col[e] - first, 1]
    for c in range(first, last):
        x = state.anchor[c]
        if state.mode[c] == STICK and x >= 0 and state.pin[x] < 0:
            left = misfit(arrays, c, v, base_speed(arrays, state, c, tau))
            for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
                if arrays.w_col[e] == x:
                    v[x] -= left / arrays.w_val[e]
