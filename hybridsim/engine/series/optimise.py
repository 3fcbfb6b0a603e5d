"""This module optimises the instruction tape of one combination of modes: no copies, constants computed once.

The rows of a tape (see `hybridsim.engine.series.tape`) are sorted by their operands. A row over constants has
one coefficient and runs once. A product with a constant, and the sine of an angle that grows linearly, cost
one multiplication per order instead of a convolution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.series import operations as ops

CONSTANT, LINEAR, SERIES = range(3)  # dependence of a register on time
PAIRED = (ops.SINCOS, ops.SINHCOSH, ops.TANGENT)  # operations with a companion in the next register


@dataclass(frozen=True)
class OptimisedTape:
    """An optimised instruction tape: rows (operation, a, b, c, out) over the registers of the original tape.

    Parameters
    ----------
    constant_rows : rows that run once per segment, at order 0.
    rows : rows that run at every order.
    states, derivatives, guards, surfaces, monitors : registers of the states, their rates and the results.
    """

    constant_rows: np.ndarray
    rows: np.ndarray
    states: np.ndarray
    derivatives: np.ndarray
    guards: np.ndarray
    surfaces: np.ndarray
    monitors: np.ndarray

    @cached_property
    def results(self) -> np.ndarray:
        """Return the registers of states, guards, surfaces and monitors."""
        return np.concatenate([self.states, self.guards, self.surfaces, self.monitors])


def separate_registers(tape: dict[str, Any]) -> dict[int, int]:
    """Return additional registers for values that are constant in some modes and vary in others.

    A compiled loop keeps its registers from mode to mode and writes only the leading coefficient of a
    constant. Without separate registers, the higher coefficients of another mode would remain.
    """
    kinds = [dict.fromkeys(tape["states"], SERIES) | {tape["time"]: LINEAR} for _ in range(2)]
    least, most = kinds
    paired: set[int] = set()
    for _, branches in tape["parts"]:
        found: dict[int, list[tuple[int, int]]] = {}
        for branch in branches:
            below, above = dict(least), dict(most)
            for op, *operands, out in branch:
                for kind in (below, above):
                    kind[out] = _kind(op, [kind.get(r, CONSTANT) for r in operands[: _registers(op)]])
                    if op in PAIRED:
                        kind[out + 1] = kind[out]
                if op in PAIRED:
                    paired.add(out)
                for r in (out, out + 1) if op in PAIRED else (out,):
                    found.setdefault(r, []).append((below[r], above[r]))
        for out, seen in found.items():
            least[out], most[out] = min(low for low, _ in seen), max(high for _, high in seen)
    separate: dict[int, int] = {}
    for out in sorted(most):
        if most[out] != CONSTANT and least[out] == CONSTANT and out not in separate:
            separate[out] = tape["registers"] + len(separate)
            if out in paired:
                separate[out + 1] = tape["registers"] + len(separate)
    return separate


def optimised(
    tape: dict[str, Any], rows: Any, active: Any, separate: Mapping[int, int] = MappingProxyType({})
) -> OptimisedTape:
    """Return the optimised rows (R, 5) of one combination of modes and its active guards."""
    rows = row_array(rows)
    kind = np.zeros(
        tape["registers"] + len(separate), dtype=np.int64
    )  # dependence on time, CONSTANT at first
    same = np.arange(len(kind))  # copy -> original register
    apart = same.copy()
    apart[list(separate)] = list(separate.values())
    kind[list(tape["states"])] = SERIES
    if tape["time"] >= 0:
        kind[tape["time"]] = LINEAR
    constant_rows, series_rows = np.empty_like(rows), np.empty_like(rows)
    constants, series = _sorted_rows(rows, apart, kind, same, constant_rows, series_rows)
    states, derivatives, guards, surfaces, monitors = (
        same[np.array(tape[key], dtype=np.int64)]
        for key in ("states", "derivatives", "guards", "surfaces", "monitors")
    )
    live = np.concatenate([derivatives, surfaces, monitors, guards[np.array(active, dtype=np.int64)]])
    live_series_rows = live_rows(series_rows[:series], live)
    read = np.concatenate([live, live_series_rows[:, 1:4].ravel()])
    return OptimisedTape(
        live_rows(constant_rows[:constants], read),
        live_series_rows,
        states,
        derivatives,
        guards,
        surfaces,
        monitors,
    )


@kernel
def _sorted_rows(
    rows: Any, apart: Any, kind: Any, same: Any, constant_rows: Any, series_rows: Any
) -> tuple[int, int]:
    """Separate rows of constants from rows of series, omit copies, and return the number of rows of each kind.

    apart: separate registers of values that are constant in these modes. kind, same: dependence on time, and the
    register in place of each copied register; both are updated.
    """
    constants = series = 0
    for i in range(rows.shape[0]):
        op, out = rows[i, 0], rows[i, 4]
        count = _registers(op)
        a, b, c = same[rows[i, 1]], rows[i, 2], rows[i, 3]
        if count > 1:
            b = same[b]
        if count > 2:
            c = same[c]
        if op == ops.COPY:
            same[out] = a
            continue
        first = kind[a]
        second = kind[b] if count > 1 else first
        third = kind[c] if count > 2 else first
        width = 2 if _is_paired(op) else 1
        for r in range(out, out + width):
            kind[r] = _kind_of(op, first, second, third)
        if kind[out] == CONSTANT:
            for r in range(out, out + width):
                same[r] = apart[r]
                kind[same[r]] = CONSTANT
            into, k, op, out = constant_rows, constants, op, same[out]
            constants += 1
        else:
            into, k = series_rows, series
            op, a, b = _special(op, a, b, count, first, second)
            series += 1
        into[k, 0], into[k, 1], into[k, 2], into[k, 3], into[k, 4] = op, a, b, c, out
    return constants, series


def has_corners(tape: dict[str, Any]) -> bool:
    """Return whether a corner or a jump depends on a state or time in any mode."""
    kind = dict.fromkeys(tape["states"], SERIES) | {tape["time"]: LINEAR}
    agreeing = set()
    for _, branches in tape["parts"]:
        for op, *operands, out in (row for branch in branches for row in branch):
            kinds = [kind.get(r, CONSTANT) for r in operands[: _registers(op)]]
            deciding = kinds[:1] if op == ops.SELECT else kinds
            if op == ops.LESS and operands[2] == ops.AGREEING:
                agreeing.add(out)
            elif op == ops.SELECT and operands[0] in agreeing:
                pass
            elif op >= ops.ABS and max(deciding) != CONSTANT:
                return True
            kind[out] = max(_kind(op, kinds), kind.get(out, CONSTANT))
            if op in PAIRED:
                kind[out + 1] = kind[out]
    return False


def row_array(rows: Any) -> np.ndarray:
    """Return rows as an array (R, 5)."""
    return np.array(rows, dtype=np.int64).reshape(-1, 5)


@inlined
def _registers(op: int) -> int:
    """Return how many of a, b and c in a row are registers; the other entries are flags of the operation."""
    if op == ops.SELECT:
        return 3
    is_of_one = op == ops.COPY or op == ops.NEG or op == ops.ABS or op == ops.SIGN or op == ops.NOT
    return 1 if is_of_one or op == ops.EXP or op == ops.SQRT or _is_paired(op) else 2


@inlined
def _is_paired(op: int) -> bool:
    """Return whether an operation has two results, such as sine and cosine."""
    return op == ops.SINCOS or op == ops.SINHCOSH or op == ops.TANGENT


@inlined
def _kind_of(op: int, first: int, second: int, third: int) -> int:
    """Return how the result of an operation depends on time, from three operands."""
    highest = max(first, second, third)
    if highest != LINEAR:
        return highest
    lowest = min(first, second, third)
    is_scaled = (op == ops.MUL and lowest == CONSTANT) or (op == ops.DIV and second == CONSTANT)
    return LINEAR if is_scaled or op == ops.ADD or op == ops.SUB or op == ops.NEG else SERIES


def _kind(op: int, kinds: list[int]) -> int:
    """Return how the result of an operation depends on time: constant, linear, or neither."""
    return _kind_of(op, kinds[0], *(kinds[1:3] + kinds[:1] * 2)[:2])


@inlined
def _special(op: int, a: int, b: int, count: int, first: int, second: int) -> tuple[int, int, int]:
    """Return a cheaper operation for an operation on a constant, or on an angle that is linear in time."""
    if op == ops.SINCOS and first == LINEAR:
        return ops.SINCOS_LINEAR, a, b
    if count != 2:
        return op, a, b
    if second == CONSTANT:
        if op == ops.ADD:
            op = ops.ADD_CONSTANT
        elif op == ops.SUB:
            op = ops.SUB_CONSTANT
        elif op == ops.MUL:
            op = ops.SCALE
        elif op == ops.DIV:
            op = ops.DIVIDE_BY
    elif first == CONSTANT:
        if op == ops.ADD:
            return ops.ADD_CONSTANT, b, a
        if op == ops.SUB:
            return ops.CONSTANT_SUB, b, a
        if op == ops.MUL:
            return ops.SCALE, b, a
    return op, a, b


def arguments_of(row: tuple[int, ...]) -> tuple[int, ...]:
    """Return the registers whose Taylor series a row reads."""
    return row[1 : 2 if row[0] >= ops.ADD_CONSTANT else 1 + _registers(row[0])]


def live_rows(rows: Any, live: Any) -> np.ndarray:
    """Return the rows (R, 5) on which the given registers depend, in order."""
    rows, needed = row_array(rows), np.array(list(live), dtype=np.int64)
    is_live = np.zeros(2 + max(rows.max(initial=0), needed.max(initial=0)), dtype=np.bool_)
    is_live[needed] = True
    is_selected = np.empty(len(rows), dtype=np.bool_)
    _select_live(rows, is_live, is_selected)
    return rows[is_selected]


@kernel
def _select_live(rows: Any, is_live: Any, is_selected: Any) -> None:
    """Mark the rows on which live registers depend; the registers that these rows read become live."""
    for i in range(rows.shape[0] - 1, -1, -1):
        op, out = rows[i, 0], rows[i, 4]
        has_companion = _is_paired(op) or op == ops.SINCOS_LINEAR
        is_selected[i] = is_live[out] or (has_companion and is_live[out + 1])
        if is_selected[i]:
            for j in range(1, 4):  # flags among them can only keep an unneeded row
                is_live[rows[i, j]] = True
