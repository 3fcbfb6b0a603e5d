"""This module writes machine code for Taylor series in one combination of modes.

An interpreter of a tape spends more time on dispatch than on arithmetic. Here each coefficient is a value
of its own, equal values are computed once, and unused values are omitted. The kernels of
`hybridsim.engine.series.interpreter` write it (`hybridsim.engine.series.trace`), so that both give the same to the
last bit and either may replace the other.

The step functions are void f(s, known, x, guards, constants, out). s is the local time, known says whether
order 0 is known, x are the states. guards receives the coefficients of the active guards, constants holds the
tape's constants in their registers, and out receives the coefficients of the states. Order 0 of sines,
exponentials and similar operations stays in its registers among the constants: a step begins where the step
before it was evaluated last, so that these values can be reused.

The other functions have the same type. `ahead` is void f(s, d, series, guards, constants, out), see
`hybridsim.engine.roots.defect_check`. `sizes` is void f(h, ., ., guards, ., out), see `measure` in
`hybridsim.engine.series.interpreter`. Functions for Runge-Kutta methods do not use an earlier step: void
f(s, ., x, guards, constants, out), where x are the states or, along a step, their coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hybridsim.engine.native.llvm_text import DECLARATIONS, Lines, function
from hybridsim.engine.native.simd.series import Powers
from hybridsim.engine.series import interpreter
from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.optimise import live_rows
from hybridsim.engine.series.trace import Coefficients, Trace, Value, written

# operations with a companion series in the next register
WITH_COMPANION = (ops.SINCOS, ops.SINCOS_LINEAR, ops.TANGENT)
_COSTLY = (*WITH_COMPANION, ops.EXP)  # order 0 of these takes as long as all other orders
KNOWN = frozenset(
    (
        ops.COPY, ops.ADD, ops.SUB, ops.NEG, ops.MUL, ops.DIV, ops.SQRT, ops.EXP, ops.SINCOS, ops.TANGENT,
        ops.SELECT, ops.LESS, ops.ADD_CONSTANT, ops.SUB_CONSTANT, ops.CONSTANT_SUB, ops.SCALE, ops.DIVIDE_BY,
        ops.SINCOS_LINEAR,
    )
)  # fmt: skip


def _results(op: int) -> int:
    """Return how many registers an operation fills."""
    return 2 if op in WITH_COMPANION else 1


@dataclass(frozen=True)
class ModeTape:
    """The parts of an optimised instruction tape from which the code of one combination of modes is written.

    These are its rows, the rows of high orders, the registers of time, states, rates, active guards and
    arguments of fading functions, and the conditions that stay constant as time passes.
    """

    rows: tuple[tuple[int, ...], ...]
    high: tuple[tuple[int, ...], ...]
    time: int
    states: tuple[int, ...]
    rates: tuple[int, ...]
    guards: tuple[int, ...]
    fading: tuple[int, ...]
    holding: frozenset[int]

    @property
    def is_known(self) -> bool:
        """Return whether every instruction of a tape can be written as straight-line code."""
        return all(row[0] in KNOWN for row in self.rows)


class _Expansion(Trace):
    """Writes code for the Taylor coefficients of every register."""

    def __init__(self, tape: ModeTape, order: int, stride: int, is_known: bool = False) -> None:
        super().__init__("v" if is_known else "u", interpreter, advance=self.advance)
        self.tape, self.stride, self.is_known = tape, stride, is_known
        self.V = Coefficients(order, self._constant)

    def expand(self, s: Value, x: list[Value], order: int) -> _Expansion:
        """Write code for all Taylor coefficients from a local time and a state."""
        tape = self.tape
        states, rates = (np.array(registers, dtype=object) for registers in (tape.states, tape.rates))
        rows, high = (np.array(rows, dtype=object).reshape(-1, 5) for rows in (tape.rows, tape.high))
        self.run.expand(rows, high, (tape.time, states, rates), order, s, x, self.V)
        return self

    def advance(self, rows: np.ndarray, V: Coefficients, k: int) -> None:
        """Write code for Taylor coefficient k of every operation, in order."""
        for r, (op, a, b, _, out) in enumerate(rows):
            if k == 0 and op in _COSTLY and self.is_known:
                for register in (out, out + 1)[: _results(op)]:
                    V[register, 0] = self.read("%c", register * self.stride)
            elif op == ops.SELECT and a in self.tape.holding:
                V[out, k] = V[b, k]
            else:
                self.on_all_paths(self.run.advance, rows[r : r + 1], (V,), k)

    def _constant(self, r: int, k: int) -> Value | float:
        """Return coefficient k of a constant, as a symbolic value."""
        if (r, 0) in self.V.known and r != self.tape.time:
            raise LookupError(f"coefficient {k} of register {r} is not computed")
        return self.read("%c", r * self.stride) if k == 0 else 0.0

    def write(self, array: str, registers: Iterable[int], size: int) -> None:
        """Write code that stores the first coefficients of some registers, one register after another."""
        for i, r in enumerate(registers):
            for k in range(size):
                self.store(written(self.V[r, k]), array, i * size + k)


def _expanded(tape: ModeTape, order: int, stride: int, is_known: bool = False) -> _Expansion:
    """Write code for the Taylor coefficients of all registers, from the states %x at the local time %s."""
    code = _Expansion(tape, order, stride, is_known)
    return code.expand(Value(code, "%s"), [code.read("%x", i) for i in range(len(tape.states))], order)


def series_function(name: str, tape: ModeTape, order: int) -> str:
    """Return a function that writes the Taylor series of states, guards and functions that may fall below rounding."""
    size = order + 1
    code = _expanded(tape, order, size, is_known=True)
    code.write("%out", tape.states, size)
    code.write("%g", tape.guards + tape.fading, size)
    begin = ("  %is_known = fcmp une double %e, 0.0", "  br i1 %is_known, label %go, label %first", "first:")
    return function(name, [*begin, *_start(tape, size).lines, "  br label %go", "go:", *code.lines])


def short_function(name: str, tape: ModeTape, order: int, count: int, stride: int) -> str:
    """Return a function that writes coefficients of states (n, order + 1) and of guards (guards, count).

    stride: columns of the array with the constants.
    """
    code = _expanded(replace(tape, high=()), order, stride)
    code.write("%out", tape.states, order + 1)
    code.write("%g", tape.guards, count)
    return function(name, code.lines)


def values_function(name: str, tape: ModeTape, stride: int) -> str:
    """Return the function that writes the rates of the states and the values of the guards."""
    code = _start(tape, stride)
    code.write("%out", tape.rates, 1)
    code.write("%g", tape.guards, 1)
    return function(name, code.lines)


def ahead_function(name: str, tape: ModeTape, order: int) -> str:
    """Return the function `ahead`, which evaluates Taylor series at the end of a step.

    It has rates and guards at a distance %e from the origin of the series, and sums of these series there.
    """
    code, size = _Expansion(tape, 0, order + 1), order + 1
    powers = Powers(code, "%e", order)
    x, slopes, changes = [], [], []
    for i in range(len(tape.states)):
        value, slope, change = powers.terms("%x", i * size)
        x.append(code.read("%x", i * size) + Value(code, value))
        slopes.append(slope)
        changes.append(change)
    code.expand(Value(code, "%s") + Value(code, "%e"), x, 0)
    sums = [
        code.op("fadd", code.load("%g", j * size), powers.sum("%g", j * size, is_size=False))
        for j in range(len(tape.guards))
    ]
    powers.store("%out")
    rates, values = ([written(code.V[r, 0]) for r in registers] for registers in (tape.rates, tape.guards))
    for i, text in enumerate((*map(written, x), *rates, *slopes, *changes, *values, *sums)):
        code.store(text, "%out", size + i)
    return function(name, _in_fixed_order(code).lines)


def along_function(name: str, tape: ModeTape, order: int) -> str:
    """Return the function that writes guard series (guards, order + 1) for given state series."""
    size = order + 1
    code = _Expansion(tape, order, size)
    for i, r in enumerate(tape.states):
        for k in range(size):
            code.V[r, k] = code.read("%x", i * size + k)
    code.V[tape.time, 0], code.V[tape.time, 1] = Value(code, "%s"), 1.0
    rows = live_rows(tape.rows, tape.guards).astype(object)
    for k in range(size):
        code.advance(rows, code.V, k)
    code.write("%g", tape.guards, size)
    return function(name, code.lines)


def sizes_function(name: str, guards: int, order: int) -> str:
    """Return the function that writes the powers of h, and the sum of |c_k| h**k for each guard's coefficients c_k."""
    code, size = Lines(), order + 1
    powers = Powers(code, "%s", order)
    powers.store("%out")
    for j in range(guards):
        first = code.call("llvm.fabs.f64", code.load("%g", j * size))
        code.store(code.op("fadd", first, powers.sum("%g", j * size, is_size=True)), "%out", size + j)
    return function(name, code.lines)


def _start(tape: ModeTape, stride: int) -> _Expansion:
    """Write code for the values of all registers, and for the storage of expensive values."""
    return _in_fixed_order(_expanded(tape, 0, stride))


def _in_fixed_order(code: _Expansion) -> _Expansion:
    """Add instructions that store coefficient 0 of expensive operations, and return the code."""
    tape, stride = code.tape, code.stride
    for op, *_, out in tape.rows:
        if op in _COSTLY:
            for r in (out, out + 1)[: _results(op)]:
                code.store(written(code.V[r, 0]), "%c", r * stride)
    return code


def ends_text(tape: ModeTape, terms: int, first: int, order: int) -> str:
    """Return the text of a module that computes the ends of Runge-Kutta steps in one combination of modes.

    ends_0 has the given number of terms. first_0 expands the states up to the order `first`; see
    `short_function`. along_0 expands the guards up to the last order; see `along_function`.
    """
    stride = order + 1
    parts = (
        short_function("ends_0", tape, terms - 1, terms, stride),
        short_function("first_0", tape, first, terms, stride),
        along_function("along_0", tape, order),
        values_function("values_0", tape, stride),
    )
    return DECLARATIONS + "".join(parts)


def series_text(tape: ModeTape, order: int) -> str:
    """Return the text of a module that computes Taylor series of one combination of modes."""
    parts = (
        series_function("series_0", tape, order),
        values_function("values_0", tape, order + 1),
        ahead_function("ahead_0", tape, order),
        sizes_function("sizes_0", len(tape.guards) + len(tape.fading), order),
    )
    return DECLARATIONS + "".join(parts)
