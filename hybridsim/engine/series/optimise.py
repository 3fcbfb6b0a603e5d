"""This module optimises the instruction tape of one combination of modes: no copies, constants computed once.

The rows of a tape (see `hybridsim.engine.series.tape`) are sorted by their operands. A row over constants has
one coefficient and runs once. A product with a constant, and the sine of an angle that grows linearly, cost
one multiplication per order instead of a convolution.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from hybridsim.engine.series import operations as ops

CONSTANT, LINEAR, SERIES = range(3)  # dependence of a register on time
PAIRED = (ops.SINCOS, ops.SINHCOSH, ops.TANGENT)  # operations with a companion in the next register
# operations on one register; the others use two
_ONE = (ops.COPY, ops.NEG, ops.ABS, ops.SIGN, ops.NOT, ops.EXP, ops.SQRT, *PAIRED)
_LINEAR_OPERATIONS = (ops.ADD, ops.SUB, ops.NEG)


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
    """Return separate registers for values that are constant in some modes and vary in other modes.

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
    tape: dict[str, Any],
    rows: Iterable[tuple[int, ...]],
    active: Iterable[int],
    separate: Mapping[int, int] = MappingProxyType({}),
) -> OptimisedTape:
    """Return the optimised rows of one combination of modes and its active guards."""
    kind = dict.fromkeys(tape["states"], SERIES) | {tape["time"]: LINEAR}
    same: dict[int, int] = {}  # copy -> original register
    constant_rows: list[tuple[int, ...]] = []
    series_rows: list[tuple[int, ...]] = []
    for op, *operands, out in rows:
        count = _registers(op)
        a, b, c = (same.get(r, r) if i < count else r for i, r in enumerate(operands))
        if op == ops.COPY:
            same[out] = a
            continue
        kinds = [kind.get(r, CONSTANT) for r in (a, b, c)[:count]]
        kind[out] = _kind(op, kinds)
        if op in PAIRED:
            kind[out + 1] = kind[out]
        if kind[out] == CONSTANT:
            for r in (out, out + 1) if op in PAIRED else (out,):
                same[r] = separate.get(r, r)
                kind[same[r]] = CONSTANT
            constant_rows.append((op, a, b, c, same[out]))
        else:
            series_rows.append((*_special(op, a, b, c, kinds), out))

    def registers(key: str) -> np.ndarray:
        return np.array([same.get(r, r) for r in tape[key]], dtype=np.int64)

    states, derivatives, guards = registers("states"), registers("derivatives"), registers("guards")
    surfaces, monitors = registers("surfaces"), registers("monitors")
    live = {*derivatives, *surfaces, *monitors, *(guards[g] for g in active)}
    live_series_rows = live_rows(series_rows, live)
    constants = live_rows(constant_rows, live | {r for row in live_series_rows for r in row[1:4]})
    return OptimisedTape(
        _array(constants), _array(live_series_rows), states, derivatives, guards, surfaces, monitors
    )


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


def _array(rows: list[tuple[int, ...]]) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, 5)


def _registers(op: int) -> int:
    """Return how many of a, b and c in a row are registers; the other entries are flags of the operation."""
    return 1 if op in _ONE else 3 if op == ops.SELECT else 2


def _kind(op: int, kinds: list[int]) -> int:
    highest = max(kinds)
    if highest == LINEAR:
        scaled = (op == ops.MUL and min(kinds) == CONSTANT) or (op == ops.DIV and kinds[1] == CONSTANT)
        return LINEAR if scaled or op in _LINEAR_OPERATIONS else SERIES
    return highest


def _special(op: int, a: int, b: int, c: int, kinds: list[int]) -> tuple[int, int, int, int]:
    """Return a cheaper operation for an operation on a constant, or on an angle that is linear in time."""
    if op == ops.SINCOS and kinds[0] == LINEAR:
        return ops.SINCOS_LINEAR, a, b, c
    if len(kinds) == 2 and kinds[1] == CONSTANT:
        cheap = {
            ops.ADD: ops.ADD_CONSTANT,
            ops.SUB: ops.SUB_CONSTANT,
            ops.MUL: ops.SCALE,
            ops.DIV: ops.DIVIDE_BY,
        }
        return cheap.get(op, op), a, b, c
    if len(kinds) == 2 and kinds[0] == CONSTANT:
        cheap = {ops.ADD: ops.ADD_CONSTANT, ops.SUB: ops.CONSTANT_SUB, ops.MUL: ops.SCALE}
        return (cheap[op], b, a, c) if op in cheap else (op, a, b, c)
    return op, a, b, c


def arguments_of(row: tuple[int, ...]) -> tuple[int, ...]:
    """Return the registers whose Taylor series a row reads."""
    return row[1 : 2 if row[0] >= ops.ADD_CONSTANT else 1 + _registers(row[0])]


def live_rows(rows: list[tuple[int, ...]], live: set[int]) -> list[tuple[int, ...]]:
    """Return the rows on which the given registers depend, in order."""
    live = set(live)
    selected = []
    for row in reversed(rows):
        out = row[4]
        if out in live or (row[0] in (*PAIRED, ops.SINCOS_LINEAR) and out + 1 in live):
            selected.append(row)
            live |= set(row[1:4])  # flags among them can only keep an unneeded row
    return selected[::-1]
