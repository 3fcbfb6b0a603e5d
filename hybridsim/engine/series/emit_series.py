"""Straight-line code for the series of one vector of modes: every operation of its optimised tape, order by order.

An interpreter of a tape spends more time on dispatch than on arithmetic. Here each coefficient is a value
of its own, equal values are computed once, and unused values are omitted. Each operation is that of
`hybridsim.engine.series.interpreter`, so that both give the same to the last bit and either may replace the
other.

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

from hybridsim.engine.native.constants import EXACTLY
from hybridsim.engine.native.llvm_text import DECLARATIONS, INF, NAN, ONE, ZERO, Lines, function, number
from hybridsim.engine.native.simd_series import Powers
from hybridsim.engine.series.high_orders import (
    FACTOR,
    HAS_B,
    HAS_C,
    INTEGRATE,
    NEGATIVE,
    OVER_B,
    OVER_C,
    RECIPROCAL,
)
from hybridsim.engine.series.optimise import (
    ADD_CONSTANT,
    CONSTANT_SUB,
    DIVIDE_BY,
    SCALE,
    SINCOS_LINEAR,
    SUB_CONSTANT,
    live_rows,
)
from hybridsim.engine.series.tape import (
    ADD,
    COPY,
    DIV,
    EXP,
    LESS,
    MUL,
    NEG,
    SELECT,
    SINCOS,
    SQRT,
    SUB,
    TANGENT,
)

WITH_COMPANION = (SINCOS, SINCOS_LINEAR, TANGENT)  # operations with a companion series in the next register
_COSTLY = (*WITH_COMPANION, EXP)  # order 0 of these takes as long as all other orders
KNOWN = frozenset(
    (
        COPY, ADD, SUB, NEG, MUL, DIV, SQRT, EXP, SINCOS, TANGENT, SELECT, LESS,
        ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB, SCALE, DIVIDE_BY, SINCOS_LINEAR,
    )
)  # fmt: skip


def _results(op: int) -> int:
    """Return the number of registers that an operation fills."""
    return 2 if op in WITH_COMPANION else 1


@dataclass(frozen=True)
class ModeTape:
    """The parts of a mode vector's optimised tape that the code needs.

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
        """Return whether every operation can be written as straight-line code."""
        return all(row[0] in KNOWN for row in self.rows)


class _Expansion(Lines):
    """The coefficients 0..order of every register; `is_known`: order 0 of sines, roots etc. is loaded."""

    def __init__(self, tape: ModeTape, order: int, stride: int, is_known: bool = False) -> None:
        super().__init__("v" if is_known else "u")
        self.tape, self.order, self.stride, self.is_known = tape, order, stride, is_known
        self.expand("%s", [self.load("%x", i) for i in range(len(tape.states))])

    def expand(self, s: str, x: list[str]) -> None:
        """Compute all coefficients, starting from a local time and a state."""
        tape, order = self.tape, self.order
        self.series: dict[int, list[str]] = {r: [value] for r, value in zip(tape.states, x, strict=True)}
        self._set_time(s)
        for k in range(order + 1):
            if k > EXACTLY and tape.high:
                self._run(tape.high if k < order else tape.high[: -len(tape.states)], k)
                continue
            self._run(tape.rows, k)
            if k < order:
                rates = [self.at(r, k) for r in tape.rates]
                for r, rate in zip(tape.states, rates, strict=True):
                    self.series[r].append(self.over(rate, k + 1))

    def _run(self, rows: Iterable[tuple[int, ...]], k: int) -> None:
        """Compute coefficient k of every operation, in order."""
        for op, a, b, c, out in rows:
            if k == 0 and op in _COSTLY and self.is_known:
                values = tuple(self.load("%c", r * self.stride) for r in (out, out + 1)[: _results(op)])
            else:
                values = self._advance(op, a, b, c, out, k)
            for r, value in zip((out, out + 1), values, strict=False):
                self.series.setdefault(r, []).append(value)

    def _set_time(self, s: str) -> None:
        if self.tape.time >= 0:
            self.series[self.tape.time] = [s, ONE] + [ZERO] * self.order

    def at(self, r: int, k: int) -> str:
        """Return coefficient k of a register."""
        if r in self.series:
            return self.series[r][k]
        return self.load("%c", r * self.stride) if k == 0 else ZERO

    def _weight(self, a: int, i: int, weighted: bool) -> str:
        return self.op("fmul", self.at(a, i), number(i)) if weighted else self.at(a, i)

    def _pair(self, a: int, b: int, i: int, j: int, weighted: bool) -> str:
        first, second = self._weight(a, i, weighted), self._weight(a, j, weighted)
        return self.op("fadd", self.op("fmul", first, self.at(b, j)), self.op("fmul", second, self.at(b, i)))

    def _twice(self, a: int, i: int) -> str:
        return self.op("fmul", self.at(a, i), number(2.0))

    def _inner(self, a: int, b: int, k: int, weighted: bool = False) -> str:
        total, other, m = ZERO, ZERO, k // 2
        if k > 0 and k % 2 == 0:
            total = self.op("fmul", self._weight(a, m, weighted), self.at(b, m))
        for i in range((k - 1) // 2, 0, -1):
            if k <= EXACTLY:
                total = self.op("fadd", total, self._pair(a, b, i, k - i, weighted))
            elif a == b and not weighted:
                total = self.fused(self._twice(a, i), self.at(a, k - i), total)
            else:
                total = self.fused(self._weight(a, i, weighted), self.at(b, k - i), total)
                other = self.fused(self._weight(a, k - i, weighted), self.at(b, i), other)
        return total if other == ZERO else self.op("fadd", total, other)

    def _product(self, a: int, b: int, k: int) -> str:
        if k == 0:
            return self.op("fmul", self.at(a, 0), self.at(b, 0))
        inner = self._inner(a, b, k)
        if k <= EXACTLY:
            return self.op("fadd", inner, self._pair(a, b, 0, k, False))
        if a == b:
            return self.fused(self._twice(a, 0), self.at(a, k), inner)
        return self.fused(self.at(a, 0), self.at(b, k), self.fused(self.at(a, k), self.at(b, 0), inner))

    def _rise(self, a: int, b: int, k: int) -> str:
        inner, part = self._inner(a, b, k, True), number(1.0 / k)
        if k <= EXACTLY:
            last = self.op("fmul", self._weight(a, k, True), self.at(b, 0))
            return self.op("fmul", self.op("fadd", inner, last), part)
        return self.fused(self.at(a, k), self.at(b, 0), self.op("fmul", inner, part))

    def _factor(self, flags: int, b: int, c: int) -> str:
        """Combine two constants into a factor, as encoded in flags of `engine.series.high_orders`."""
        f = ONE
        for has, over, r in ((HAS_B, OVER_B, b), (HAS_C, OVER_C, c)):
            if flags & has:
                g = self.op("fdiv", ONE, self.at(r, 0)) if flags & over else self.at(r, 0)
                f = g if f == ONE else self.op("fmul", f, g)
        return self.negative(f) if flags & NEGATIVE else f

    def _scaled(self, a: str, flags: int, b: int, c: int, part: str) -> str:
        """Multiply a coefficient by a factor."""
        f = self._factor(flags, b, c)
        return self.op("fmul", a, part if f == ONE else f if part == ONE else self.op("fmul", f, part))

    def _reciprocal(self, a: str, flags: int, b: int, c: int, out: int, k: int) -> str:
        """Compute coefficient k of a constant over b."""
        part = self.op("fdiv", ONE, self.at(b, 0))
        factor = self.op("fmul", self.op("fmul", self.at(out, 0), part), self._factor(flags ^ NEGATIVE, 0, c))
        return self.fused(a, factor, self.negative(self.op("fmul", self._inner(out, b, k), part)))

    def _advance(self, op: int, a: int, b: int, c: int, out: int, k: int) -> tuple[str, ...]:
        """Compute coefficient k of an operation, and of its companion."""
        if op in WITH_COMPANION:
            return self._start(op, a, b) if k == 0 else self._companions(op, a, b, out, k)
        u = self.at(a, k)
        if op == COPY:
            return (u,)
        if op == NEG:
            return (self.negative(u),)
        if op == LESS:
            return (self.choice("olt", u, self.at(b, 0), ONE, ZERO) if k == 0 else ZERO,)
        if op == SELECT and a in self.tape.holding:
            return (self.at(b, k),)
        if op == SELECT:
            return (self.choice("une", self.at(a, 0), ZERO, self.at(b, k), self.at(c, k)),)
        if op in (ADD, SUB):
            return (self.op("fadd" if op == ADD else "fsub", u, self.at(b, k)),)
        if op in (ADD_CONSTANT, SUB_CONSTANT):
            return (self.op("fadd" if op == ADD_CONSTANT else "fsub", u, self.at(b, 0)) if k == 0 else u,)
        if op == CONSTANT_SUB:
            return (self.op("fsub", self.at(b, 0), u) if k == 0 else self.negative(u),)
        if op == SCALE:
            return (self.op("fmul", u, self.at(b, 0)),)
        if op >= RECIPROCAL:
            return (self._reciprocal(u, op - RECIPROCAL, b, c, out, k),)
        if op >= FACTOR:
            part, kind = (number(1.0 / (k + 1)), INTEGRATE) if op >= INTEGRATE else (ONE, FACTOR)
            return (self._scaled(u, op - kind, b, c, part),)
        if op == MUL:
            return (self._product(a, b, k),)
        if op in (DIVIDE_BY, DIV):
            if k == 0:
                return (self.op("fdiv", u, self.at(b, 0)),)
            if op == DIV and k <= EXACTLY:
                first = self.op("fmul", self.at(out, 0), self.at(b, k))
                u = self.op("fsub", u, self.op("fadd", self._inner(out, b, k), first))
            elif op == DIV:
                rest = self.op("fsub", u, self._inner(out, b, k))
                u = self.fused(self.negative(self.at(out, 0)), self.at(b, k), rest)
            return (self.op("fmul", u, self.op("fdiv", ONE, self.at(b, 0))),)
        return (self._exponential(a, out, k) if op == EXP else self._root(a, out, k),)

    def _exponential(self, a: int, out: int, k: int) -> str:
        if k > 0:
            return self._rise(a, out, k)
        u = self.at(a, 0)
        return self.choice("oge", u, number(709.0), INF, self.call("llvm.exp.f64", u))

    def _root(self, a: int, out: int, k: int) -> str:
        u = self.at(a, k)
        if k == 0:
            return self.choice("oge", u, ZERO, self.call("llvm.sqrt.f64", u), NAN)
        root = self.at(out, 0)
        rest = self.op("fmul", self.op("fsub", u, self._inner(out, out, k)), number(0.5))
        quotient = self.op("fdiv", rest, root)
        return self.choice("oeq", root, ZERO, self.choice("oeq", rest, ZERO, ZERO, quotient), quotient)

    def _start(self, op: int, a: int, b: int) -> tuple[str, ...]:
        """Compute order 0 of an operation that needs a second series, as the sine needs the cosine."""
        u = self.at(a, 0)
        if op != TANGENT:
            return self.call("llvm.sin.f64", u), self.call("llvm.cos.f64", u)
        y = self.call("c_tan" if b == 0 else "c_tanh", u)
        square = self.op("fmul", y, y)
        return y, self.op("fadd", ONE, square if b == 0 else self.negative(square))

    def _companions(self, op: int, a: int, b: int, out: int, k: int) -> tuple[str, ...]:
        """Compute order k >= 1 of an operation with a companion."""
        if op == SINCOS_LINEAR:
            rate = self.op("fmul", self.at(a, 1), number(1.0 / k))
            sine, cosine = self.at(out, k - 1), self.at(out + 1, k - 1)
            return self.op("fmul", rate, cosine), self.negative(self.op("fmul", rate, sine))
        if op == SINCOS:
            return self._rise(a, out + 1, k), self.negative(self._rise(a, out, k))
        self.series[out].append(self._rise(a, out + 1, k))
        w = self._product(out, out, k)
        return self.series[out].pop(), w if b == 0 else self.negative(w)


def series_function(name: str, tape: ModeTape, order: int) -> str:
    """Return a function that writes series (order + 1 columns) of states, guards and fading functions."""
    code, size = _Expansion(tape, order, order + 1, is_known=True), order + 1
    for array, registers in (("%out", tape.states), ("%g", tape.guards + tape.fading)):
        for i, r in enumerate(registers):
            for k in range(size):
                code.store(code.at(r, k), array, i * size + k)
    begin = ("  %is_known = fcmp une double %e, 0.0", "  br i1 %is_known, label %go, label %first", "first:")
    return function(name, [*begin, *_start(tape, size).lines, "  br label %go", "go:", *code.lines])


def short_function(name: str, tape: ModeTape, order: int, count: int, stride: int) -> str:
    """Return a function that writes coefficients of states (n, order + 1) and of guards (guards, count).

    stride: columns of the array with the constants.
    """
    code = _Expansion(replace(tape, high=()), order, stride)
    for array, registers, size in (("%out", tape.states, order + 1), ("%g", tape.guards, count)):
        for i, r in enumerate(registers):
            for k in range(size):
                code.store(code.at(r, k), array, i * size + k)
    return function(name, code.lines)


def values_function(name: str, tape: ModeTape, stride: int) -> str:
    """Return the function that writes the rates of the states and the values of the guards."""
    code = _start(tape, stride)
    for array, registers in (("%out", tape.rates), ("%g", tape.guards)):
        for i, r in enumerate(registers):
            code.store(code.at(r, 0), array, i)
    return function(name, code.lines)


class _Ahead(_Expansion):
    """Rates and guards at a distance %e from the origin of given series, and sums of these series there."""

    def __init__(self, tape: ModeTape, order: int) -> None:
        Lines.__init__(self, "u")
        self.tape, self.order, self.stride, self.is_known = tape, 0, order + 1, False
        n, count, size = len(tape.states), len(tape.guards), order + 1
        powers = Powers(self, "%e", order)
        x, slopes, changes = [], [], []
        for i in range(n):
            value, slope, change = powers.terms("%x", i * size)
            x.append(self.op("fadd", self.load("%x", i * size), value))
            slopes.append(slope)
            changes.append(change)
        self.expand(self.op("fadd", "%s", "%e"), x)
        sums = [
            self.op("fadd", self.load("%g", j * size), powers.sum("%g", j * size, is_size=False))
            for j in range(count)
        ]
        values = [self.at(r, 0) for r in tape.guards]
        rates = [self.at(r, 0) for r in tape.rates]
        powers.store("%out")
        for i, value in enumerate((*x, *rates, *slopes, *changes, *values, *sums)):
            self.store(value, "%out", size + i)


def ahead_function(name: str, tape: ModeTape, order: int) -> str:
    """Return the function `ahead` for series of an order; see `hybridsim.engine.roots.defect_check`."""
    return function(name, _in_fixed_order(_Ahead(tape, order)).lines)


class _Along(_Expansion):
    """The coefficients of the guards along states with given coefficients."""

    def __init__(self, tape: ModeTape, order: int) -> None:
        Lines.__init__(self, "u")
        self.tape, self.order, self.stride, self.is_known = tape, order, order + 1, False
        size = order + 1
        self.series = {
            r: [self.load("%x", i * size + k) for k in range(size)] for i, r in enumerate(tape.states)
        }
        self._set_time("%s")
        rows = live_rows(list(tape.rows), set(tape.guards))
        for k in range(size):
            self._run(rows, k)


def along_function(name: str, tape: ModeTape, order: int) -> str:
    """Return the function that writes guard series (guards, order + 1) from given state series (n, order + 1)."""
    code, size = _Along(tape, order), order + 1
    for i, r in enumerate(tape.guards):
        for k in range(size):
            code.store(code.at(r, k), "%g", i * size + k)
    return function(name, code.lines)


def sizes_function(name: str, guards: int, order: int) -> str:
    """Return the function of h that writes its powers, and for each guard sum_k |c_k| h**k."""
    code, size = Lines(), order + 1
    powers = Powers(code, "%s", order)
    powers.store("%out")
    for j in range(guards):
        first = code.call("llvm.fabs.f64", code.load("%g", j * size))
        code.store(code.op("fadd", first, powers.sum("%g", j * size, is_size=True)), "%out", size + j)
    return function(name, code.lines)


def _start(tape: ModeTape, stride: int) -> _Expansion:
    """Return code that computes order 0 in the order of the tape, and keeps costly values for later use."""
    return _in_fixed_order(_Expansion(tape, 0, stride))


def _in_fixed_order(code: _Expansion) -> _Expansion:
    """Return the code with stores of the costly values of order 0."""
    tape, stride = code.tape, code.stride
    for op, *_, out in tape.rows:
        if op in _COSTLY:
            for r in (out, out + 1)[: _results(op)]:
                code.store(code.at(r, 0), "%c", r * stride)
    return code


def ends_text(tape: ModeTape, terms: int, first: int, order: int) -> str:
    """Return a module with the functions ends_0, first_0, along_0 and values_0.

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
    """Return a module with series_0, values_0, ahead_0 and sizes_0; raise TooLong if it is too long to compile."""
    parts = (
        series_function("series_0", tape, order),
        values_function("values_0", tape, order + 1),
        ahead_function("ahead_0", tape, order),
        sizes_function("sizes_0", len(tape.guards) + len(tape.fading), order),
    )
    return DECLARATIONS + "".join(parts)
