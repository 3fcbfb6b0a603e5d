"""This module rewrites instruction tapes for high orders, so that fewer operations in a row lead to the rates.

A coefficient depends on the one before it through every operation between a state and its rate. With a
compiled tape this latency is most of a step's time. Successive constants become one factor, a sum adds its
latest term last, and the last factor of a rate includes the division by the order. The rounding differs from
that of the optimised tape's rows. Therefore the orders by which events are decided keep those rows, and so do
guards at any order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.optimise import PAIRED, arguments_of, live_rows

# Operations at orders k > 0 alone, each with flags: out_k = a_k f, and a_{k+1} of a state out, a_k f / (k + 1), where
# f is the product of the constants b and c, or of their reciprocals, and a sign.
FACTOR, INTEGRATE = 64, 96
# And out_k of a constant over b, with b_k = a_k c, a_k / c or a_k and a sign:
# -(sum_{0<i<k} out_i b_{k-i} + out_0 b_k) / b_0, in which only one product and one difference depend on a_k.
RECIPROCAL = 128
HAS_B, OVER_B, HAS_C, OVER_C, NEGATIVE = 1, 2, 4, 8, 16

Row = tuple[int, ...]
_SAME, _TURNED = (
    (ops.ADD_CONSTANT, ops.SUB_CONSTANT),
    (ops.NEG, ops.CONSTANT_SUB),
)  # copies and negations at high orders
# latency in cycles; operations that are not listed are sums of products
_WAITS = {ops.ADD: 3, ops.SUB: 3, ops.NEG: 1, ops.SCALE: 3, ops.DIVIDE_BY: 3, ops.DIV: 12, ops.SQRT: 15}
_PRODUCT = 6
_MAX_FACTOR_CONSTANTS = 2  # constants of a factor
_EARLY = -(10**6)  # cycle of a value that does not depend on a state


@dataclass(frozen=True)
class _Scaled:
    """A register that equals another register, multiplied and divided by constants, with a sign."""

    base: int
    constants: tuple[tuple[int, bool], ...] = ()
    is_negative: bool = False

    def row(self, kind: int, out: int) -> Row:
        """Return the instruction that computes this scaled value."""
        operands, flags = [0, 0], NEGATIVE if self.is_negative else 0
        for i, (register, divides) in enumerate(self.constants):
            operands[i] = register
            flags |= (HAS_B, HAS_C)[i] | ((OVER_B, OVER_C)[i] if divides else 0)
        if kind == FACTOR and not self.constants:
            return (ops.NEG if self.is_negative else ops.ADD_CONSTANT, self.base, 0, 0, out)
        return (kind + flags, self.base, *operands, out)


def high_rows(
    rows: Sequence[Row], states: Sequence[int], rates: Sequence[int], guard_registers: Iterable[int]
) -> list[Row]:
    """Return instructions that compute states and guards at high orders of the Taylor series."""
    made = _Rewriting(rows, states, rates, set(guard_registers))
    integrals = [made.scaled(rate).row(INTEGRATE, state) for state, rate in zip(states, rates, strict=True)]
    live = live_rows(made.rows, made.guard_registers | {row[1] for row in integrals})
    return [*map(tuple, live.tolist()), *integrals]


class _Rewriting:
    """Rewrites instructions so that fewer operations in a row lead to the rates."""

    def __init__(
        self, rows: Sequence[Row], states: Sequence[int], rates: Sequence[int], guard_registers: set[int]
    ) -> None:
        self.guard_registers = guard_registers
        self._of = {row[4]: row for row in rows}
        self._states = set(states)
        self._unchanged = set(map(tuple, live_rows(rows, guard_registers).tolist()))
        self._readers = Counter([*(a for row in rows for a in arguments_of(row)), *rates])
        self._forms: dict[int, _Scaled] = {}
        cycles = self._cycles_after(dict.fromkeys(states, 0))
        ends = [cycles.get(rate, _EARLY) for rate in rates]
        # some states have their coefficients before others
        self._cycles = self._cycles_after({x: end - max(ends) for x, end in zip(states, ends, strict=True)})
        self._free_registers: set[int] = set()  # registers of inner sums, available for reuse
        self._sums: dict[int, tuple[list[tuple[int, bool]], list[int]]] = {}
        for row in reversed(rows):
            if (
                row[0] in (ops.ADD, ops.SUB)
                and row not in self._unchanged
                and row[4] not in self._free_registers
            ):
                self._take_apart(row)
        self.rows: list[Row] = []
        for row in rows:
            self._rewrite(row)

    def scaled(self, register: int) -> _Scaled:
        """Return a register as a multiple of another register."""
        return self._forms.get(register, _Scaled(register))

    def _cycles_after(self, cycles: dict[int, int]) -> dict[int, int]:
        """Compute the processor cycle at which each register is available."""
        for row in self._of.values():
            op, out = row[0], row[4]
            wait = _EARLY if op == ops.SINCOS_LINEAR else 0 if op in _SAME else _WAITS.get(op, _PRODUCT)
            cycles[out] = max([cycles.get(a, _EARLY) for a in arguments_of(row)]) + wait
            if op in (*PAIRED, ops.SINCOS_LINEAR):
                cycles[out + 1] = cycles[out]
        return cycles

    def _rewrite(self, row: Row) -> None:
        op, a, b, _, out = row
        if op in (*_SAME, *_TURNED, ops.SCALE, ops.DIVIDE_BY):
            form = self.scaled(a)
            if op in _TURNED:
                form = replace(form, is_negative=not form.is_negative)
            elif op not in _SAME:
                form = form if len(form.constants) < _MAX_FACTOR_CONSTANTS else _Scaled(a)
                form = replace(form, constants=(*form.constants, (b, op == ops.DIVIDE_BY)))
            self._forms[out] = form
            self.rows.append(row if row in self._unchanged else form.row(FACTOR, out))
        elif out in self._sums:
            self._sum(out, *self._sums[out])
        elif op == ops.DIV and row not in self._unchanged and a not in self._of and a not in self._states:
            self.rows.append(self._reciprocal(b, out))
        elif out not in self._free_registers:
            self.rows.append(row)

    def _reciprocal(self, b: int, out: int) -> Row:
        """Return a row that computes a constant divided by a register."""
        form = self.scaled(b)
        if len(form.constants) > 1:
            form = _Scaled(b)
        flags, register = NEGATIVE if form.is_negative else 0, 0
        for constant, divides in form.constants:
            flags, register = flags | HAS_C | (OVER_C if divides else 0), constant
        return (RECIPROCAL + flags, form.base, b, register, out)

    def _sum(self, out: int, terms: Sequence[tuple[int, bool]], inner: Sequence[int]) -> None:
        """Append rows that add the terms of a sum in the order in which they are computed."""
        (total, is_negative), *others = sorted(terms, key=lambda term: self._cycles.get(term[0], _EARLY))
        for (register, turns), to in zip(others, (*inner, out), strict=True):
            if turns == is_negative:
                self.rows.append((ops.ADD, total, register, 0, to))
            else:
                first, second = (register, total) if is_negative else (total, register)
                self.rows.append((ops.SUB, first, second, 0, to))
                is_negative = False
            total = to

    def _take_apart(self, row: Row) -> None:
        """Find the terms of a sum with their signs; inner sums that nothing else reads are expanded.

        A sum that has only negative terms stays unchanged.
        """
        found: list[tuple[int, bool]] = []
        inner: list[int] = []
        waiting = [(row[2], row[0] == ops.SUB), (row[1], False)]
        while waiting:
            r, turns = waiting.pop()
            while self._is_inner(r, (*_SAME, *_TURNED)):
                r, turns = self._of[r][1], turns != (self._of[r][0] in _TURNED)
            if self._is_inner(r, (ops.ADD, ops.SUB)):
                op, a, b, *_ = self._of[r]
                inner.append(r)
                waiting += [(b, turns != (op == ops.SUB)), (a, turns)]
            else:
                found.append((r, turns))
        if not all(is_negative for _, is_negative in found):
            self._sums[row[4]] = found, inner
            self._free_registers.update(inner)

    def _is_inner(self, register: int, operations: tuple[int, ...]) -> bool:
        """Return whether a register is the result of given operations and is read only once."""
        row = self._of.get(register)
        return (
            row is not None
            and row[0] in operations
            and row not in self._unchanged
            and self._readers[register] == 1
        )
