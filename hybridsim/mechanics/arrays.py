"""The arrays that the kernels of a mechanical system read and write, by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# mode of a contact at rest (+1, -1: slip forward, backward); no event in sight
STICK, OPEN_END = (
    0,
    2.0**1000,
)
VELOCITY, UPPER, LOWER, EXPIRY = 0, 1, 2, 3  # what ends a mode; a series that reaches no further
DONE, FULL, INCONSISTENT, NONUNIQUE, CASCADE, LOST, LIMITED = range(7)  # why the loop came back, or was left


# numbers that a kernel reached by its address is given; FIRST: where a run of neighbours begins, -1 where it is none
COUNT, DOFS, CONS, ORDER, NODE, FIRED, FIRST = range(7)
AT, LONGEST, RTOL, LENGTH = range(4)  # and real ones; the length of a stretch comes back
# these kernels; then series to Bernstein form, for ever fewer terms
EXPAND, STRETCH, DECIDE, BERNSTEIN = range(4)


class State(NamedTuple):
    """Where a run is; P1 = order + 1.

    x: (2, n) positions and velocities at the origin of the present step. series (P1, n): of each coordinate, from
    the node's origin (within the step); both in whole vectors. mode (m,): 0 stick, else direction of slip. held
    (m,): -1 or +1 where the force of a contact at rest stays at its limit because others hold it. decree (m, 2),
    stamp (m,): leading coefficients of its guards that are zero just after an event, and when. until, guard (m,):
    next exit and its kind. pinv: pseudo-inverses of the Delassus matrices of what sticks, node by node. holds
    (nn,): how many stick. pin (n,): contact that fixes a coordinate, or -1. anchor (m,): coordinate that is
    evaluated from a contact's constraint, or -1. tree: tournament of the next times. clock: origin of the step
    (high, low), its length, last event. phase: angles at the origin. flags: see `loop`. counts: steps, events,
    restarts of patches, nodes restarted, undecided, grazings. kernels, whole, real: addresses of the large
    kernels, and what they are given.
    """

    x: np.ndarray
    series: np.ndarray
    origin: np.ndarray
    mode: np.ndarray
    held: np.ndarray
    decree: np.ndarray
    stamp: np.ndarray
    until: np.ndarray
    guard: np.ndarray
    pinv: np.ndarray
    holds: np.ndarray
    pin: np.ndarray
    anchor: np.ndarray
    tree: np.ndarray
    clock: np.ndarray
    phase: np.ndarray
    flags: np.ndarray
    counts: np.ndarray
    tolerance: np.ndarray
    kernels: np.ndarray
    whole: np.ndarray
    real: np.ndarray


class Room(NamedTuple):
    """Scratch: the patch under work (nodes, coordinates, contacts and where these are), its series, and polynomials.

    Q, R, F and sums have rows of one length, in whole vectors. lane, lane_ptr, place, V: registers of the tapes, see
    `expansion`. strips, W, laid: what `runs` lays out for each eight neighbours, their registers, and for whom (number
    of the first, and one). line: a series about another point, see `polynomials`.
    """

    nodes: np.ndarray
    dofs: np.ndarray
    cons: np.ndarray
    loc: np.ndarray
    lcon: np.ndarray
    stamp: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    F: np.ndarray
    acc: np.ndarray
    trig: np.ndarray
    lane: np.ndarray
    lane_ptr: np.ndarray
    place: np.ndarray
    V: np.ndarray
    poly: np.ndarray
    bern: np.ndarray
    stack: np.ndarray
    before: np.ndarray
    zero: np.ndarray
    at_limit: np.ndarray
    next: np.ndarray
    err: np.ndarray
    err_f: np.ndarray
    square: np.ndarray
    tall: np.ndarray
    order: np.ndarray
    exits: np.ndarray
    kinds: np.ndarray
    line: np.ndarray
    strips: np.ndarray
    W: np.ndarray
    laid: np.ndarray
    sums: np.ndarray


class Record(NamedTuple):
    """What is kept: pieces (node, row of the first series; start as high, low, local), their series, and events."""

    piece: np.ndarray
    start: np.ndarray
    series: np.ndarray
    event: np.ndarray
    when: np.ndarray
    used: np.ndarray
