"""This module stores a run as Taylor series for each node and time interval, and evaluates the run at any time."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.system.instant import phase_of
from hybridsim.mechanics.polynomials import value_and_slope
from hybridsim.mechanics.series_loop.clusters import factorise, project
from hybridsim.mechanics.series_loop.expansion import expanded, whole


@kernel
def evaluate(
    node_dof: Any, ptr: Any, begins: Any, start: Any, row: Any, series: Any, times: Any, right: bool, out: Any
) -> None:
    """Evaluate positions and velocities (k, 2n) at times, from segments sorted by node and then by time."""
    n = out.shape[1] // 2
    for j in range(node_dof.shape[0] - 1):
        for i in range(times.shape[0]):
            low, high = ptr[j], ptr[j + 1] - 1
            while low < high:  # the last segment that begins at or before the time
                middle = (low + high + 1) // 2
                if begins[middle] < times[i] or (right and begins[middle] == times[i]):
                    low = middle
                else:
                    high = middle - 1
            d = max(((times[i] - start[low, 0]) - start[low, 1]) - start[low, 2], 0.0)
            if begins[low] == times[i]:
                d = 0.0
            for x in range(node_dof[j], node_dof[j + 1]):
                value, slope = value_and_slope(series[row[low] + x - node_dof[j]], d)
                out[i, x], out[i, n + x] = value, slope


@kernel
def quantities(
    arrays: Any,
    laws: Any,
    state: Any,
    scratch: Any,
    when: Any,
    event: Any,
    first: Any,
    times: Any,
    order: Any,
    right: bool,
    out: Any,
    forces: Any,
    velocities: Any,
) -> None:
    """Apply the stick constraints to velocities, and compute forces and relative velocities (k, m).

    order sorts the times; first: modes at the start; out (k, 2n): states, whose velocities are changed in place.
    """
    n, at, nodes = out.shape[1] // 2, 0, arrays.node_dof.shape[0] - 1
    for c in range(first.shape[0]):
        state.mode[c], state.held[c] = first[c], 0
    for j in range(nodes):
        factorise(arrays, state, scratch, j)
        state.origin[j] = 0.0
    for i in order:
        while at < when.shape[0] and (when[at] < times[i] or (right and when[at] == times[i])):
            c = event[at, 0]
            state.mode[c] = event[at, 2]
            factorise(arrays, state, scratch, arrays.con_node[c])
            at += 1
        for r in range(arrays.rates.shape[0]):
            state.phase[r] = phase_of(times[i], 0.0, arrays.rates[r], 0.0)
        for j in range(nodes):
            if state.holds[j] > 0:
                project(arrays, state, scratch, j, 0.0, out[i, n:])
        for x in range(n):
            state.x[0, x], state.x[1, x] = out[i, x], out[i, n + x]
        nd, nc = whole(arrays, state, scratch, 2)
        expanded(arrays, laws, state, scratch, nodes, nd, nc, 0.0, 2)
        for c in range(nc):
            forces[i, c], velocities[i, c] = scratch.F[0, c], scratch.R[0, c]


class NodeSegments:
    """All segments of a run, sorted by node and then by time."""

    def __init__(self, arrays: Any, chunks: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
        self.arrays = arrays
        n_nodes = len(arrays.node_dof) - 1
        segments = [chunk[0] for chunk in chunks]
        offsets = np.cumsum([0, *(len(chunk[2]) for chunk in chunks)])
        node = np.concatenate([p[:, 0] for p in segments])
        row = np.concatenate([p[:, 1] + offset for p, offset in zip(segments, offsets[:-1], strict=True)])
        order = np.argsort(node, kind="stable")
        self.start = np.ascontiguousarray(np.concatenate([chunk[1] for chunk in chunks])[order])
        self.row = np.ascontiguousarray(row[order])
        self.series = np.concatenate([chunk[2] for chunk in chunks])
        self.ptr = np.searchsorted(node[order], np.arange(n_nodes + 1)).astype(np.int64)
        self.begins = instants(self.start)

    def states(self, times: np.ndarray, right: bool) -> np.ndarray:
        """Return positions and velocities (k, 2n) at given times, in the order of the arrays."""
        out = np.empty((len(times), 2 * len(self.arrays.dof_node)))
        arguments = (self.ptr, self.begins, self.start, self.row, self.series)
        evaluate(self.arrays.node_dof, *arguments, np.ascontiguousarray(times), right, out)
        return out


def instants(parts: np.ndarray) -> np.ndarray:
    """Return times as doubles, from the terms (high, low, local) of each time, (k, 3)."""
    return parts[:, 0] + (parts[:, 1] + parts[:, 2]) if len(parts) else np.zeros(0)
