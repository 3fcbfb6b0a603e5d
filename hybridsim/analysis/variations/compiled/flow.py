"""This module passes the parts of a run to `hybridsim.analysis.variations.compiled.collocation`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.analysis.variations.compiled.collocation import (
    FlowScratch,
    FlowTapes,
    Rule,
    RunArrays,
    over_parts,
    speeds_at,
)
from hybridsim.analysis.variations.smooth import CANCELS, GAUSS, TAIL, Steps
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.simd.vectors import WIDTH
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.tangent_panel import panel
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System

_RULE = packed(Rule(*map(np.ascontiguousarray, (GAUSS.A, GAUSS.b, GAUSS.coefficients[-TAIL:]))))
_over_parts, _speeds_at = Precompiled(over_parts), Precompiled(speeds_at)


@per_structure
def _tapes(system: System, modes: bytes) -> Any:
    """Return the packed instruction tapes of the combinations of modes (T, C)."""
    combinations = np.frombuffer(modes, dtype=np.int64).reshape(-1, max(len(system.automata), 1))
    tapes = [tangent_tape(system, z[: len(system.automata)]) for z in combinations]
    begins = np.cumsum([0, *(len(tape.rows) for tape in tapes)])
    rows = np.concatenate([np.zeros((0, 5), dtype=np.int64), *(tape.rows for tape in tapes)])
    return packed(FlowTapes(rows, begins, np.array([tape.outputs for tape in tapes]).reshape(len(tapes), -1)))


class CompiledFlow:
    """Computes derivatives of the states over parts of the segments of a run.

    Parameters
    ----------
    segments : those of the run (`hybridsim.engine.record.block_list.SegmentBlockList`).
    moving : numbers of the discrete states, parameters and values of tables that change.
    scale (n,), constants (q,) : sizes of the states and of the constants.
    """

    def __init__(
        self,
        system: System,
        segments: Any,
        vector: VectorSlopes,
        moving: Sequence[int],
        scale: np.ndarray,
        constants: np.ndarray,
    ) -> None:
        self._system, self._segments, n = system, segments, system.n
        modes = segments.modes()
        radix = np.cumprod([1, *(len(a.modes) + 1 for a in system.automata)])[: modes.shape[1]]
        _, first, tape = np.unique(modes @ radix, return_index=True, return_inverse=True)
        if not modes.shape[1]:
            modes = np.zeros((len(modes), 1), dtype=np.int64)
        self._tapes = _tapes(system, np.ascontiguousarray(modes[first]).tobytes())
        chosen = [*range(n), *(n + 1 + k for k in moving)]
        vectors = np.concatenate([block.vectors for block in segments.blocks])
        fixed, by_origin = (np.ascontiguousarray(each[:, chosen]) for each in vector.seeds_and_rates())
        own = np.zeros((0, *fixed.shape))
        if not vector.is_fixed:
            own = np.array([vector.seeds(p)[:, chosen] for p in vectors])
        self._run = packed(
            RunArrays(
                tape.astype(np.int64).reshape(-1),
                vectors,
                vectors[:, system.layout.origin_at].copy(),
                fixed,
                by_origin,
                own,
                scale,
                CANCELS / constants,
            )
        )
        width = fixed.shape[1]
        self._work = packed(
            FlowScratch(
                panel(system.registers.count, width),
                np.zeros(fixed.shape),
                np.zeros((WIDTH * n, WIDTH * n + width)),
                np.zeros((2, n, n)),
            )
        )

    def over(self, parts: Steps) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (K, n, n + q) over parts, and how well they are resolved; NaN means no derivative."""
        lengths = parts.ends - parts.begins
        s = (parts.begins[:, None] + lengths[:, None] * GAUSS.nodes).ravel()
        x = self._segments.states(np.repeat(parts.number, WIDTH), s)
        matrices, tails = np.empty((len(lengths), *self._shape)), np.empty(len(lengths))
        number = np.ascontiguousarray(parts.number, dtype=np.int64)
        _over_parts(
            self._tapes, self._system.registers.inputs, _RULE, self._run, self._work, (number, lengths), (s, x),
            matrices, tails,
        )  # fmt: skip
        return matrices, tails

    @property
    def _shape(self) -> tuple[int, int]:
        return self._system.n, self._run.fixed.shape[1]

    def speeds(self, number: np.ndarray, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return a bound (m,) of the eigenvalues of the Jacobian of the rates, at points in ascending order."""
        found = np.empty(len(s))
        _speeds_at(
            self._tapes, self._system.registers.inputs, self._run, self._work, number, s,
            np.ascontiguousarray(x), found,
        )  # fmt: skip
        return found
