"""This module defines the named arrays that the kernels of a mechanical system read and write."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class State(NamedTuple):
    """The state of a run with n coordinates, m contacts and nn nodes; P1 is the order plus one."""

    x: np.ndarray  # (2, n) positions and velocities at the origin of the present step
    series: np.ndarray  # (P1, n) series of each coordinate, padded to whole vectors
    origin: np.ndarray  # (nn,) origin of each node's series within the step
    mode: np.ndarray  # (m,) 0 stick, else the direction of slip
    held: np.ndarray  # (m,) -1 or +1 if other contacts hold this one, with its force at that limit; else 0
    decree: np.ndarray  # (m, 2) leading coefficients of its guards that an event has made zero
    stamp: np.ndarray  # (m,) time of that event
    until: np.ndarray  # (m,) time of the next exit
    guard: np.ndarray  # (m,) kind of the next exit
    pinv: np.ndarray  # pseudo-inverses of the Delassus matrices of sticking contacts, node by node
    holds: np.ndarray  # (nn,) number of sticking contacts
    pin: np.ndarray  # (n,) contact that fixes a coordinate, or -1
    anchor: np.ndarray  # (m,) coordinate that is evaluated from a contact's constraint, or -1
    tree: np.ndarray  # tournament tree of the next exit times
    clock: np.ndarray  # origin of the step (high, low), its length, time of the last event
    phase: np.ndarray  # angles of forcing and bases at the origin
    flags: np.ndarray  # see `loop`
    counts: np.ndarray  # steps, events, restarts of patches, nodes restarted, undecided, grazings
    tolerance: np.ndarray  # (2, n) absolute tolerances
    kernels: np.ndarray  # addresses of the large kernels
    whole: np.ndarray  # their integer arguments
    real: np.ndarray  # their real arguments


class Scratch(NamedTuple):
    """Scratch arrays: the current patch of nodes, its Taylor series, and polynomials.

    Rows of Q, R, F and sums have equal lengths, in whole vectors. lane, lane_ptr, place, V: registers of the
    tapes, see `expansion`. band_rows, W, band_first: coefficients of `banded_series` for each eight
    neighbours, their registers, and one more than the number of the first of them. line: a series about
    another point, see `polynomials`.
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
    band_rows: np.ndarray
    W: np.ndarray
    band_first: np.ndarray
    sums: np.ndarray


class Record(NamedTuple):
    """The record of a run: segments with their Taylor series, and events."""

    segment: np.ndarray  # node, row
    start: np.ndarray  # high, low, local
    series: np.ndarray
    event: np.ndarray
    when: np.ndarray
    used: np.ndarray
