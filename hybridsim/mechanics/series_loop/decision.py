"""This module decides which contacts of a node stick, slip or release, as one complementarity problem.

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
from hybridsim.mechanics.arrays import AT, DECIDE, FIRED, INCONSISTENT, NODE, STICK, UPPER, VELOCITY
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
def decided(plant: Any, laws: Any, state: Any, room: Any, j: int, tau: float, fired: int) -> int:
    """Decide node j at tau, where contact `fired` (-1: none) ended its mode; return DECIDED or INCONSISTENT.

    The node's series are replaced by its positions and exact velocities at tau.
    """
    state.whole[NODE], state.whole[FIRED], state.real[AT] = j, fired, tau
    return call_kernel(state.kernels[DECIDE], (plant, laws, state, room))


def decide(plant: Any, laws: Any, state: Any, room: Any) -> int:
    """Run `decided` with the arguments in the state."""
    j, fired, tau = state.whole[NODE], state.whole[FIRED], state.real[AT]
    first, last = plant.node_con[j], plant.node_con[j + 1]
    _stop_at(plant, state, j, tau)
    for c in range(first, last):
        room.before[c], room.at_limit[c] = state.mode[c], 0
        state.decree[c, 0], state.decree[c, 1], state.stamp[c] = 0, 0, tau
        state.held[c] = 0
        if c == fired:
            if state.guard[c] != VELOCITY:
                room.at_limit[c] = 1 if state.guard[c] == UPPER else -1
            state.mode[c] = STICK
    _set_velocities(plant, state, room, j, tau)
    count = 0
    for c in range(first, last):  # contacts that came to rest with the others are known only now
        if state.mode[c] == STICK or _is_zero(plant, state, c, tau):
            room.zero[count] = c
            count += 1
            state.mode[c] = STICK
    if count == 0:
        return DECIDED
    _set_velocities(plant, state, room, j, tau)
    if fired >= 0:
        state.mode[fired] = room.at_limit[fired]
    for round in range(_BLOCK + 4 * count * count + 8):
        factorise(plant, state, room, j)
        _hold_at_limits(plant, state, room, j, count)
        room.nodes[0] = j
        nd, nc = gather(plant, state, room, 1, tau, _SHORT)
        expanded(plant, laws, state, room, 1, nd, nc, tau, _SHORT)
        _bounds(plant, state, room, j, nd, tau)
        violations = _judge(plant, state, room, count)
        if violations == 0:
            return DECIDED
        _change(state, room, count, round < _BLOCK)
    return INCONSISTENT


@kernel
def _stop_at(plant: Any, state: Any, j: int, tau: float) -> None:
    """Replace the series of a node by position and velocity at tau."""
    d = tau - state.origin[j]
    for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
        value, slope = state_at(state.series, x, d)
        for k in range(state.series.shape[0]):
            state.series[k, x] = 0.0
        state.series[0, x], state.series[1, x] = value, slope
    state.origin[j] = tau


@kernel
def _is_zero(plant: Any, state: Any, c: int, tau: float) -> bool:
    """Return whether the relative velocity of a contact is zero to rounding."""
    base = base_speed(plant, state, c, tau)
    total, size = -base, abs(base)
    for e in range(plant.w_ptr[c], plant.w_ptr[c + 1]):
        term = plant.w_val[e] * state.series[1, plant.w_col[e]]
        total += term
        size += abs(term)
    return abs(total) <= _TERMS * _UNIT * size


@kernel
def _set_velocities(plant: Any, state: Any, room: Any, j: int, tau: float) -> None:
    """Make the velocities of a node satisfy the constraints of its sticking contacts."""
    factorise(plant, state, room, j)
    for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
        state.x[1, x] = state.series[1, x]
    project(plant, state, room, j, tau, state.x[1])
    for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
        state.series[1, x] = state.x[1, x]


@kernel
def _bounds(plant: Any, state: Any, room: Any, j: int, nd: int, tau: float) -> None:
    """Bound the rounding errors of accelerations, forces and relative velocities of a node, in the short series.

    err[k, a]: coefficient k of the accelerations; err_f[k, c]: of the forces; err_f[_SHORT + k, c]: of the
    relative velocities. The instant is known to a few ulps of the step.
    """
    first, last = plant.node_con[j], plant.node_con[j + 1]
    m, instant = last - first, 4.0 * 2.0**-52 * max(abs(tau), state.clock[2])
    for k in range(_SHORT - 1):
        for a in range(nd):
            x = room.dofs[a]
            total = abs(plant.still[x]) if k == 0 else 0.0
            for e in range(plant.k_ptr[x], plant.k_ptr[x + 1]):
                total += abs(plant.k_val[e] * room.Q[k, room.loc[plant.k_col[e]]])
            for e in range(plant.c_ptr[x], plant.c_ptr[x + 1]):
                total += abs(plant.c_val[e] * (k + 1) * room.Q[k + 1, room.loc[plant.c_col[e]]])
            for e in range(plant.h_ptr[x], plant.h_ptr[x + 1]):
                r = plant.h_rate[e]
                total += abs(plant.h_val[e, 0] * room.trig[r, 0, k]) + abs(
                    plant.h_val[e, 1] * room.trig[r, 1, k]
                )
            for e in range(plant.b_ptr[x], plant.b_ptr[x + 1]):
                total += abs(plant.b_val[e] * room.F[k, room.lcon[plant.b_col[e]]])
            room.err[k, a] = _TERMS * _UNIT * total
        for c in range(first, last):
            total = 0.0
            if state.mode[c] == STICK and state.held[c] == 0:
                row = plant.g_ptr[j] + (c - first) * m
                for i in range(m):
                    share = abs(state.pinv[row + i])
                    if share > 0.0:
                        part = _TERMS * _UNIT * (k + 1) * abs(base_coefficient(plant, room, first + i, k + 1))
                        for e in range(plant.w_ptr[first + i], plant.w_ptr[first + i + 1]):
                            part += abs(plant.w_val[e]) * room.err[k, room.loc[plant.w_col[e]]]
                        total += share * part
            if k < _SHORT - 2:
                total += instant * (k + 1) * abs(room.F[k + 1, room.lcon[c]])
            room.err_f[k, c] = total + _TERMS * _UNIT * abs(room.F[k, room.lcon[c]])
        for c in range(first, last):
            total = 0.0
            for e in range(plant.w_ptr[c], plant.w_ptr[c + 1]):
                x = plant.w_col[e]
                part = room.err[k, room.loc[x]]
                for f in range(plant.b_ptr[x], plant.b_ptr[x + 1]):
                    part += abs(plant.b_val[f]) * room.err_f[k, plant.b_col[f]]
                total += abs(plant.w_val[e]) * part
            total += _TERMS * _UNIT * (k + 1) * abs(base_coefficient(plant, room, c, k + 1))
            if k < _SHORT - 2:
                total += instant * (k + 1) * (k + 2) * abs(room.R[k + 2, room.lcon[c]])
            room.err_f[_SHORT + k + 1, c] = total / (k + 1)
    for c in range(first, last):
        room.err_f[_SHORT, c] = 0.0


@kernel
def _judge(plant: Any, state: Any, room: Any, count: int) -> int:
    """Return the number of violations; room.next[c] is the required mode of a violating contact, else its own."""
    violations, is_continuous = 0, True
    for z in range(count):
        c = room.zero[z]
        if state.mode[c] != room.before[c]:
            side = 0 if state.mode[c] > 0 else 1
            released = room.before[c] == STICK and room.at_limit[c] == state.mode[c] and plant.smooth[c, side]
            is_continuous = is_continuous and released
    for z in range(count):
        c = room.zero[z]
        i, mode = room.lcon[c], state.mode[c]
        room.next[c] = mode
        g, e = room.poly[:_SHORT], room.line[:_SHORT]
        if mode != STICK:
            released = is_continuous and room.before[c] == STICK
            for k in range(_SHORT):
                g[k], e[k] = mode * room.R[k, i], room.err_f[_SHORT + k, c]
            decreed = 2 if released else 1
            sign, order = side_after(g, e, decreed)
            state.decree[c, 0] = order if order < _SHORT else decreed
            if sign < 0:
                room.next[c] = STICK
                violations += 1
            elif sign == 0 and open_question(g, e, decreed):
                state.counts[4] += 1
            continue
        if state.held[c] != 0:
            continue
        for side in range(2):
            sigma = 1.0 if side == 0 else -1.0
            for k in range(_SHORT - 1):
                g[k], e[k] = -sigma * room.F[k, i], room.err_f[k, c]
            g[0] += plant.limits[c, side]
            e[0] += _UNIT * plant.limits[c, side]
            # a force that another contact's jump changes is no longer exactly at its limit
            decreed = 1 if is_continuous and room.at_limit[c] == sigma else 0
            sign, order = side_after(g[: _SHORT - 1], e[: _SHORT - 1], decreed)
            state.decree[c, side] = order if order < _SHORT - 1 else 0
            if sign < 0:
                if order > 0:
                    room.at_limit[c] = 1 if side == 0 else -1
                room.next[c] = 1 if side == 0 else -1
                violations += 1
    return violations


@kernel
def _change(state: Any, room: Any, count: int, together: bool) -> None:
    """Set the next modes of the violating contacts: of all, or of the last one in order."""
    if not together:
        kept = -1
        for z in range(count):
            if room.next[room.zero[z]] != state.mode[room.zero[z]]:
                kept = room.zero[z]
        for z in range(count):
            if room.zero[z] != kept:
                room.next[room.zero[z]] = state.mode[room.zero[z]]
    for z in range(count):
        c = room.zero[z]
        if state.mode[c] == STICK and room.next[c] != STICK:
            state.mode[c] = room.next[c]
        elif state.mode[c] != STICK and room.next[c] == STICK:
            state.mode[c], state.held[c] = STICK, 0


@kernel
def _hold_at_limits(plant: Any, state: Any, room: Any, j: int, count: int) -> None:
    """Hold slipping contacts that other contacts fix, with the force at its limit, and release the others."""
    for z in range(count):
        c = room.zero[z]
        if state.mode[c] == STICK and state.held[c] == 0:
            continue
        direction = state.held[c] if state.mode[c] == STICK else state.mode[c]
        if state.holds[j] > 0 and _is_held(plant, state, j, c):
            state.mode[c], state.held[c] = STICK, direction
        else:
            state.mode[c], state.held[c] = direction, 0


@kernel
def _is_held(plant: Any, state: Any, j: int, c: int) -> bool:
    """Return whether the direction of a contact lies in the span of the sticking ones, to rounding."""
    first, last = plant.node_con[j], plant.node_con[j + 1]
    m, at = last - first, plant.g_ptr[j]
    own = plant.g_val[at + (c - first) * m + (c - first)]
    left = own
    for a in range(m):
        if state.mode[first + a] == STICK and state.held[first + a] == 0 and first + a != c:
            for b in range(m):
                part = state.pinv[at + a * m + b]
                if part != 0.0:
                    left -= (
                        plant.g_val[at + (c - first) * m + a] * part * plant.g_val[at + b * m + (c - first)]
                    )
    return left <= 1e3 * m * _UNIT * own
