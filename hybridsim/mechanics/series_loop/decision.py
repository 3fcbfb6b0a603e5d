"""This module chooses the modes of node j at time tau, after contact `fired` (-1: none) has left its mode.

A candidate gives each contact at zero relative velocity a mode. It is admissible if, just after the instant,
the forces of all sticking contacts stay within their limits and all slipping contacts move in their
directions. The signs follow from short series by the rules of `hybridsim.engine.events.choice.verdict`, with exact
zeros known from the event. Starting with all contacts in stick, the contacts that violate a condition are changed
together (block principal pivoting, J. J. Judice and F. M. Pires, Computers & Operations Research 21 (1994) 587,
doi:10.1016/0305-0548(94)90106-6), and one by one if that does not settle. The latter cannot cycle for positive
definite Delassus matrices (K. G. Murty, Mathematical Programming 7 (1974) 26). No combinations are enumerated.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.verdict import open_question, side_after
from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.mechanics.codes import AT, FIRED, INCONSISTENT, JOINT_CHOICE, NODE, STICK, UPPER, VELOCITY
from hybridsim.mechanics.polynomials import state_at
from hybridsim.mechanics.series_loop.clusters import factorise, project
from hybridsim.mechanics.series_loop.expansion import base_coefficient, base_speed, expanded, gather

_SHORT = 4  # order of the short series in q: accelerations and their first two derivatives
_UNIT = 2.0**-53
_TERMS = (
    8.0  # rounding of a sum of products, in units of the sum of their sizes, for the state and for the sum
)
_BLOCK = 8  # rounds in which all violations are changed together
DECIDED = 0


@inlined
def joint_choice(arrays: Any, laws: Any, state: Any, scratch: Any, j: int, tau: float, fired: int) -> int:
    """Call `joint_choice` with the arguments stored in the state.

    The node's series are replaced by its positions and exact velocities at tau.
    """
    state.whole[NODE], state.whole[FIRED], state.real[AT] = j, fired, tau
    return call_kernel(state.kernels[JOINT_CHOICE], (arrays, laws, state, scratch))


def choose_jointly(arrays: Any, laws: Any, state: Any, scratch: Any) -> int:
    """Run `joint_choice` as a kernel that is called by its address and finds its arguments in the state."""
    j, fired, tau = state.whole[NODE], state.whole[FIRED], state.real[AT]
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    _stop_at(arrays, state, j, tau)
    for c in range(first, last):
        scratch.before[c], scratch.at_limit[c] = state.mode[c], 0
        state.decree[c, 0], state.decree[c, 1], state.stamp[c] = 0, 0, tau
        state.held[c] = 0
        if c == fired:
            if state.guard[c] != VELOCITY:
                scratch.at_limit[c] = 1 if state.guard[c] == UPPER else -1
            state.mode[c] = STICK
    _set_velocities(arrays, state, scratch, j, tau)
    count = 0
    for c in range(first, last):  # contacts that came to rest with the others are known only now
        if state.mode[c] == STICK or _is_zero(arrays, state, c, tau):
            scratch.zero[count] = c
            count += 1
            state.mode[c] = STICK
    if count == 0:
        return DECIDED
    _set_velocities(arrays, state, scratch, j, tau)
    if fired >= 0:
        state.mode[fired] = scratch.at_limit[fired]
    for round in range(_BLOCK + 4 * count * count + 8):
        factorise(arrays, state, scratch, j)
        _hold_at_limits(arrays, state, scratch, j, count)
        scratch.nodes[0] = j
        nd, nc = gather(arrays, state, scratch, 1, tau, _SHORT)
        expanded(arrays, laws, state, scratch, 1, nd, nc, tau, _SHORT)
        _bounds(arrays, state, scratch, j, nd, tau)
        violations = _count_violations(arrays, state, scratch, count)
        if violations == 0:
            return DECIDED
        _change(state, scratch, count, round < _BLOCK)
    return INCONSISTENT


@kernel
def _stop_at(arrays: Any, state: Any, j: int, tau: float) -> None:
    """Replace the Taylor series of a node by its position and velocity at time tau."""
    d = tau - state.origin[j]
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        value, slope = state_at(state.series, x, d)
        for k in range(state.series.shape[0]):
            state.series[k, x] = 0.0
        state.series[0, x], state.series[1, x] = value, slope
    state.origin[j] = tau


@kernel
def _is_zero(arrays: Any, state: Any, c: int, tau: float) -> bool:
    """Return whether the relative velocity of a contact is zero within rounding."""
    base = base_speed(arrays, state, c, tau)
    total, size = -base, abs(base)
    for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
        term = arrays.w_val[e] * state.series[1, arrays.w_col[e]]
        total += term
        size += abs(term)
    return abs(total) <= _TERMS * _UNIT * size


@kernel
def _set_velocities(arrays: Any, state: Any, scratch: Any, j: int, tau: float) -> None:
    """Make the velocities of a node satisfy the constraints of its sticking contacts."""
    factorise(arrays, state, scratch, j)
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        state.x[1, x] = state.series[1, x]
    project(arrays, state, scratch, j, tau, state.x[1])
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        state.series[1, x] = state.x[1, x]


@kernel
def _bounds(arrays: Any, state: Any, scratch: Any, j: int, nd: int, tau: float) -> None:
    """Compute bounds of the rounding errors of accelerations, forces and relative velocities of a node.

    err[k, a]: coefficient k of the accelerations; err_f[k, c]: of the forces; err_f[_SHORT + k, c]: of the
    relative velocities. The instant is known to a few ulps of the step.
    """
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    m, instant = last - first, 4.0 * 2.0**-52 * max(abs(tau), state.clock[2])
    for k in range(_SHORT - 1):
        for a in range(nd):
            x = scratch.dofs[a]
            total = abs(arrays.still[x]) if k == 0 else 0.0
            for e in range(arrays.k_ptr[x], arrays.k_ptr[x + 1]):
                total += abs(arrays.k_val[e] * scratch.Q[k, scratch.loc[arrays.k_col[e]]])
            for e in range(arrays.c_ptr[x], arrays.c_ptr[x + 1]):
                total += abs(arrays.c_val[e] * (k + 1) * scratch.Q[k + 1, scratch.loc[arrays.c_col[e]]])
            for e in range(arrays.h_ptr[x], arrays.h_ptr[x + 1]):
                r = arrays.h_rate[e]
                total += abs(arrays.h_val[e, 0] * scratch.trig[r, 0, k]) + abs(
                    arrays.h_val[e, 1] * scratch.trig[r, 1, k]
                )
            for e in range(arrays.b_ptr[x], arrays.b_ptr[x + 1]):
                total += abs(arrays.b_val[e] * scratch.F[k, scratch.lcon[arrays.b_col[e]]])
            scratch.err[k, a] = _TERMS * _UNIT * total
        for c in range(first, last):
            total = 0.0
            if state.mode[c] == STICK and state.held[c] == 0:
                row = arrays.g_ptr[j] + (c - first) * m
                for i in range(m):
                    share = abs(state.pinv[row + i])
                    if share > 0.0:
                        part = (
                            _TERMS
                            * _UNIT
                            * (k + 1)
                            * abs(base_coefficient(arrays, scratch, first + i, k + 1))
                        )
                        for e in range(arrays.w_ptr[first + i], arrays.w_ptr[first + i + 1]):
                            part += abs(arrays.w_val[e]) * scratch.err[k, scratch.loc[arrays.w_col[e]]]
                        total += share * part
            if k < _SHORT - 2:
                total += instant * (k + 1) * abs(scratch.F[k + 1, scratch.lcon[c]])
            scratch.err_f[k, c] = total + _TERMS * _UNIT * abs(scratch.F[k, scratch.lcon[c]])
        for c in range(first, last):
            total = 0.0
            for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
                x = arrays.w_col[e]
                part = scratch.err[k, scratch.loc[x]]
                for f in range(arrays.b_ptr[x], arrays.b_ptr[x + 1]):
                    part += abs(arrays.b_val[f]) * scratch.err_f[k, arrays.b_col[f]]
                total += abs(arrays.w_val[e]) * part
            total += _TERMS * _UNIT * (k + 1) * abs(base_coefficient(arrays, scratch, c, k + 1))
            if k < _SHORT - 2:
                total += instant * (k + 1) * (k + 2) * abs(scratch.R[k + 2, scratch.lcon[c]])
            scratch.err_f[_SHORT + k + 1, c] = total / (k + 1)
    for c in range(first, last):
        scratch.err_f[_SHORT, c] = 0.0


@kernel
def _count_violations(arrays: Any, state: Any, scratch: Any, count: int) -> int:
    """Return the number of contacts that violate their mode, and write the required modes to scratch.next."""
    violations, is_continuous = 0, True
    for z in range(count):
        c = scratch.zero[z]
        if state.mode[c] != scratch.before[c]:
            side = 0 if state.mode[c] > 0 else 1
            released = (
                scratch.before[c] == STICK and scratch.at_limit[c] == state.mode[c] and arrays.smooth[c, side]
            )
            is_continuous = is_continuous and released
    for z in range(count):
        c = scratch.zero[z]
        i, mode = scratch.lcon[c], state.mode[c]
        scratch.next[c] = mode
        g, e = scratch.poly[:_SHORT], scratch.line[:_SHORT]
        if mode != STICK:
            released = is_continuous and scratch.before[c] == STICK
            for k in range(_SHORT):
                g[k], e[k] = mode * scratch.R[k, i], scratch.err_f[_SHORT + k, c]
            decreed = 2 if released else 1
            sign, order = side_after(g, e, decreed)
            state.decree[c, 0] = order if order < _SHORT else decreed
            if sign < 0:
                scratch.next[c] = STICK
                violations += 1
            elif sign == 0 and open_question(g, e, decreed):
                state.counts[4] += 1
            continue
        if state.held[c] != 0:
            continue
        for side in range(2):
            sigma = 1.0 if side == 0 else -1.0
            for k in range(_SHORT - 1):
                g[k], e[k] = -sigma * scratch.F[k, i], scratch.err_f[k, c]
            g[0] += arrays.limits[c, side]
            e[0] += _UNIT * arrays.limits[c, side]
            # a force that another contact's jump changes is no longer exactly at its limit
            decreed = 1 if is_continuous and scratch.at_limit[c] == sigma else 0
            sign, order = side_after(g[: _SHORT - 1], e[: _SHORT - 1], decreed)
            state.decree[c, side] = order if order < _SHORT - 1 else 0
            if sign < 0:
                if order > 0:
                    scratch.at_limit[c] = 1 if side == 0 else -1
                scratch.next[c] = 1 if side == 0 else -1
                violations += 1
    return violations


@kernel
def _change(state: Any, scratch: Any, count: int, together: bool) -> None:
    """Change the modes of all violating contacts, or only of the last violating contact."""
    if not together:
        last = -1
        for z in range(count):
            if scratch.next[scratch.zero[z]] != state.mode[scratch.zero[z]]:
                last = scratch.zero[z]
        for z in range(count):
            if scratch.zero[z] != last:
                scratch.next[scratch.zero[z]] = state.mode[scratch.zero[z]]
    for z in range(count):
        c = scratch.zero[z]
        if state.mode[c] == STICK and scratch.next[c] != STICK:
            state.mode[c] = scratch.next[c]
        elif state.mode[c] != STICK and scratch.next[c] == STICK:
            state.mode[c], state.held[c] = STICK, 0


@kernel
def _hold_at_limits(arrays: Any, state: Any, scratch: Any, j: int, count: int) -> None:
    """Hold slipping contacts at their limit force if sticking contacts prevent their motion; release all others."""
    for z in range(count):
        c = scratch.zero[z]
        if state.mode[c] == STICK and state.held[c] == 0:
            continue
        direction = state.held[c] if state.mode[c] == STICK else state.mode[c]
        if state.holds[j] > 0 and _is_held(arrays, state, j, c):
            state.mode[c], state.held[c] = STICK, direction
        else:
            state.mode[c], state.held[c] = direction, 0


@kernel
def _is_held(arrays: Any, state: Any, j: int, c: int) -> bool:
    """Return whether the direction of a contact is a combination of the directions of sticking contacts."""
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    m, at = last - first, arrays.g_ptr[j]
    own = arrays.g_val[at + (c - first) * m + (c - first)]
    left = own
    for a in range(m):
        if state.mode[first + a] == STICK and state.held[first + a] == 0 and first + a != c:
            for b in range(m):
                part = state.pinv[at + a * m + b]
                if part != 0.0:
                    left -= (
                        arrays.g_val[at + (c - first) * m + a] * part * arrays.g_val[at + b * m + (c - first)]
                    )
    return left <= 1e3 * m * _UNIT * own
