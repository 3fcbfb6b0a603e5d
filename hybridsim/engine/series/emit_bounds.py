"""Straight-line code for the short series of the guards of one vector of modes, with bounds of their rounding errors.

Each operation is that of `hybridsim.engine.series.bounded`, in the same order, so that both give the same to
the last bit if values are finite. Exact values carry no bound and add nothing to other bounds.

The functions are void f(s, s_error, x, x_error, p, out): local time and state with the bounds of their
errors, the run-time vector, and the output with the coefficients of the guards (guards, ORDER + 1) followed
by their bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hybridsim.engine.native.llvm_text import DECLARATIONS, INF, NAN, ONE, ZERO, Lines, function, number
from hybridsim.engine.series.emit_series import KNOWN, WITH_COMPANION, ModeTape
from hybridsim.engine.series.optimise import (
    ADD_CONSTANT,
    CONSTANT_SUB,
    DIVIDE_BY,
    SCALE,
    SINCOS_LINEAR,
    SUB_CONSTANT,
)
from hybridsim.engine.series.tape import ADD, COPY, DIV, EXP, LESS, LESS_EQUAL, MUL, NEG, SELECT, SUB, TANGENT

_UNIT = 2.0**-53  # unit roundoff of a double
_ORDER = 3  # as in `hybridsim.engine.series.bounded`
_ASKED = frozenset((LESS, LESS_EQUAL))  # comparisons, here only between constants

Term = tuple[str, str]  # a coefficient and the bound of its error


@dataclass(frozen=True)
class ConstantSources:
    """Values of a tape's constants: numbers with errors, indices into the parameter vector, and phases."""

    numbers: Mapping[int, tuple[float, float]]
    sources: Mapping[int, int]
    phases: frozenset[int]


class _Bounded(Lines):
    """The coefficients 0..ORDER of every register with their error bounds."""

    def __init__(
        self, tape: ModeTape, constant_rows: Sequence[tuple[int, ...]], constant_sources: ConstantSources
    ) -> None:
        super().__init__()
        self.constant_sources = constant_sources
        self.series: dict[int, list[Term]] = {}
        for i, r in enumerate(tape.states):
            self.series[r] = [(self.load("%x", i), self.load("%g", i))]
        if tape.time >= 0:
            self.series[tape.time] = [("%s", "%e"), (ONE, ZERO)] + [(ZERO, ZERO)] * (_ORDER - 1)
        for row in constant_rows:
            self._run(row, 0)
        for row in constant_rows:  # their higher coefficients are zero
            for r in (row[4], row[4] + 1) if row[0] in WITH_COMPANION else (row[4],):
                self.series[r] += [(ZERO, ZERO)] * _ORDER
        for k in range(_ORDER + 1):
            for row in tape.rows:
                self._run(row, k)
            if k < _ORDER:
                rates = [self.at(r, k) for r in tape.rates]
                for r, (rate, e) in zip(tape.states, rates, strict=True):
                    value, error = (ZERO if part == ZERO else self.over(part, k + 1) for part in (rate, e))
                    self.series[r].append(
                        (value, self.plus(error, self.share(1.0, value)) if k > 0 else error)
                    )

    def _run(self, row: tuple[int, ...], k: int) -> None:
        op, a, b, c, out = row
        for r, term in zip((out, out + 1), self._advance(op, a, b, c, out, k), strict=False):
            self.series.setdefault(r, []).append(term)

    def at(self, r: int, k: int) -> Term:
        """Return coefficient k of a register."""
        if r in self.series:
            return self.series[r][k]
        if k > 0:
            return ZERO, ZERO
        if r in self.constant_sources.sources:
            value = self.load("%c", self.constant_sources.sources[r])
            return value, self.share(2.0, value) if r in self.constant_sources.phases else ZERO
        exact, off = self.constant_sources.numbers.get(r, (0.0, 0.0))
        return number(exact), number(off) if off else ZERO

    # -- arithmetic of non-negative bounds, without zero terms --------------------------------------------------

    def plus(self, *terms: str) -> str:
        """Add terms from left to right."""
        total = ZERO
        for term in terms:
            total = term if total == ZERO else total if term == ZERO else self.op("fadd", total, term)
        return total

    def times(self, a: str, b: str) -> str:
        """Multiply a coefficient or bound by another."""
        if ZERO in (a, b):
            return ZERO
        return b if a == number(1.0) else a if b == number(1.0) else self.op("fmul", a, b)

    def size(self, a: str) -> str:
        """Compute |a|."""
        return a if a in (ZERO, ONE) else self.call("llvm.fabs.f64", a)

    def share(self, units: float, a: str) -> str:
        """Compute a number of roundoff units of |a|."""
        return self.times(number(units * _UNIT), self.size(a))

    def mixed(self, u: Term, v: Term) -> str:
        """Compute |u| dv + du (|v| + dv)."""
        inner = self.times(u[1], self.plus(self.size(v[0]), v[1]))
        return self.plus(self.times(self.size(u[0]), v[1]), inner)

    # -- sums of products -------------------------------------------------------------------------------------

    def _weighted(self, weight: int, u: Term, v: Term) -> Term:
        first = u[0] if weight == 1 else self.op("fmul", u[0], number(weight))
        mixed = self.mixed(u, v)
        return self.op("fmul", first, v[0]), mixed if weight == 1 else self.times(number(weight), mixed)

    def _pair(self, a: int, b: int, i: int, j: int, u: int, v: int) -> Term:
        first, e = self._weighted(u, self.at(a, i), self.at(b, j))
        second, d = self._weighted(v, self.at(a, j), self.at(b, i))
        total = self.op("fadd", first, second)
        sizes = self.times(number(2.0 * _UNIT), self.plus(self.size(first), self.size(second)))
        return total, self.plus(self.plus(e, d), self.plus(sizes, self.share(1.0, total)))

    def _inner(self, a: int, b: int, k: int, weighted: bool) -> Term:
        total, error, m = ZERO, ZERO, k // 2
        if k > 0 and k % 2 == 0:
            total, error = self._weighted(m if weighted else 1, self.at(a, m), self.at(b, m))
            error = self.plus(error, self.share(2.0, total))
        for i in range((k - 1) // 2, 0, -1):
            u, v = (i, k - i) if weighted else (1, 1)
            pair, e = self._pair(a, b, i, k - i, u, v)
            total = self.op("fadd", total, pair)
            error = self.plus(error, self.plus(e, self.share(1.0, total)))
        return total, error

    def _product(self, a: int, b: int, k: int) -> Term:
        if k == 0:
            u, v = self.at(a, 0), self.at(b, 0)
            total = self.op("fmul", u[0], v[0])
            return total, self.plus(self.mixed(u, v), self.share(1.0, total))
        inner, e = self._inner(a, b, k, False)
        ends, d = self._pair(a, b, 0, k, 1, 1)
        total = self.op("fadd", inner, ends)
        return total, self.plus(self.plus(e, d), self.share(1.0, total))

    def _slope(self, a: int, b: int, k: int) -> Term:
        """Compute coefficient k of the integral of a' b."""
        inner, error = self._inner(a, b, k, True)
        last, e = self._weighted(k, self.at(a, k), self.at(b, 0))
        error = self.plus(error, self.plus(e, self.share(2.0, last)))
        total, part = self.op("fadd", inner, last), number(1.0 / k)
        error = self.plus(self.plus(error, self.share(1.0, total)), self.share(2.0, total))
        return self.op("fmul", total, part), self.times(error, part)

    def _quotient(self, n: str, error: str, b: int, k: int) -> Term:
        """Compute n / b_0; higher orders use the rounded reciprocal."""
        divisor, e = self.at(b, 0)
        value = self.op("fdiv", n, divisor) if k == 0 else self.op("fmul", n, self.op("fdiv", ONE, divisor))
        above = self.plus(error, self.times(self.size(value), e))
        bound = ZERO if above == ZERO else self.op("fdiv", above, self.size(divisor))
        return value, self.plus(bound, self.share(1.0 if k == 0 else 2.0, value))

    # -- operations -------------------------------------------------------------------------------------------

    def _advance(self, op: int, a: int, b: int, c: int, out: int, k: int) -> tuple[Term, ...]:
        if op in WITH_COMPANION:
            return self._start(op, a, b) if k == 0 else self._companions(op, a, b, out, k)
        u, du = self.at(a, k)
        if op == COPY:
            return ((u, du),)
        if op == NEG:
            return ((self.negative(u), du),)
        if op == SELECT:
            asked, (v, dv), (w, dw) = self.at(a, 0)[0], self.at(b, k), self.at(c, k)
            return ((self.choice("une", asked, ZERO, v, w), self.choice("une", asked, ZERO, dv, dw)),)
        if op in _ASKED:
            return ((self.choice("olt" if op == LESS else "ole", u, self.at(b, 0)[0], ONE, ZERO), ZERO),)
        if op in (ADD, SUB):
            v, dv = self.at(b, k)
            return (self._sum("fadd" if op == ADD else "fsub", u, v, self.plus(du, dv)),)
        if op in (ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB):
            if k > 0:
                return ((self.negative(u) if op == CONSTANT_SUB else u, du),)
            v, dv = self.at(b, 0)
            first, second = (v, u) if op == CONSTANT_SUB else (u, v)
            return (self._sum("fadd" if op == ADD_CONSTANT else "fsub", first, second, self.plus(du, dv)),)
        if op == SCALE:
            v, dv = self.at(b, 0)
            y = self.op("fmul", u, v)
            return ((y, self.plus(self.mixed((u, du), (v, dv)), self.share(1.0, y))),)
        if op == MUL:
            return (self._product(a, b, k),)
        if op == DIV and k > 0:
            return (self._ratio(u, du, b, out, k),)
        if op in (DIVIDE_BY, DIV):
            return (self._quotient(u, du, b, k),)
        return (self._exponential(a, out, k) if op == EXP else self._root(a, out, k),)

    def _sum(self, op: str, a: str, b: str, error: str) -> Term:
        y = self.op(op, a, b)
        return y, self.plus(error, self.share(1.0, y))

    def _ratio(self, u: str, du: str, b: int, out: int, k: int) -> Term:
        """Compute order k >= 1 of a quotient of two series."""
        y, e = self._inner(out, b, k, False)
        first, d = self._weighted(1, self.at(out, 0), self.at(b, k))
        e = self.plus(e, self.plus(d, self.share(1.0, first)))
        y = self.op("fadd", y, first)
        n = self.op("fsub", u, y)
        rounding = self.times(number(_UNIT), self.plus(self.size(y), self.size(n)))
        return self._quotient(n, self.plus(self.plus(du, e), rounding), b, k)

    def _exponential(self, a: int, out: int, k: int) -> Term:
        if k > 0:
            return self._slope(a, out, k)
        u, du = self.at(a, 0)
        y = self.choice("oge", u, number(709.0), INF, self.call("llvm.exp.f64", u))
        return y, self.times(self.size(y), self.plus(du, number(2.0 * _UNIT)))

    def _root(self, a: int, out: int, k: int) -> Term:
        u, du = self.at(a, k)
        if k == 0:
            y = self.choice("oge", u, ZERO, self.call("llvm.sqrt.f64", u), NAN)
            twice = self.op("fmul", number(2.0), y)
            e = self.choice("ogt", y, ZERO, self.op("fdiv", du, twice), self.call("llvm.sqrt.f64", du))
            return y, self.plus(e, self.share(1.0, y))
        y, e = self._inner(out, out, k, False)
        n, below = self.op("fmul", number(0.5), self.op("fsub", u, y)), self.plus(du, e)
        error = self.plus(self.times(number(0.5), below), self.share(1.0, n))
        root, d = self.at(out, 0)
        value = self.op("fdiv", n, root)
        above = self.op("fdiv", self.plus(error, self.times(self.size(value), d)), self.size(root))
        bound = self.plus(above, self.share(1.0, value))
        # sqrt(0) of an exact zero
        is_something = self.op("fadd", self.op("fadd", self.size(root), self.size(n)), below)
        return (
            self.choice("oeq", is_something, ZERO, ZERO, value),
            self.choice("oeq", is_something, ZERO, ZERO, bound),
        )

    def _start(self, op: int, a: int, b: int) -> tuple[Term, ...]:
        """Compute order 0 of an operation that needs a second series, as the sine needs the cosine."""
        u, du = self.at(a, 0)
        if op != TANGENT:
            s, c = self.call("llvm.sin.f64", u), self.call("llvm.cos.f64", u)
            square = self.times(self.times(number(0.5), du), du)
            ds, dc = self.times(self.size(c), du), self.times(self.size(s), du)
            return (s, self.plus(ds, square, self.share(2.0, s))), (
                c,
                self.plus(dc, square, self.share(2.0, c)),
            )
        y = self.call("c_tan" if b == 0 else "c_tanh", u)
        square = self.op("fmul", y, y)
        w = self.op("fadd", ONE, square if b == 0 else self.negative(square))
        dy = self.plus(self.times(self.size(w), du), self.share(2.0, y))
        dw = self.times(self.times(number(2.0), self.size(y)), dy)
        return (y, dy), (
            w,
            self.plus(dw, self.times(number(3.0 * _UNIT), self.op("fadd", ONE, square))),
        )

    def _companions(self, op: int, a: int, b: int, out: int, k: int) -> tuple[Term, ...]:
        """Compute order k >= 1 of an operation with a companion."""
        if op == SINCOS_LINEAR:
            (rate, e), part = self.at(a, 1), number(1.0 / k)
            turn = self.op("fmul", rate, part), self.times(self.plus(e, self.share(2.0, rate)), part)
            found = []
            for r in (out + 1, out):
                v = self.at(r, k - 1)
                y = self.op("fmul", turn[0], v[0])
                found.append((y, self.plus(self.mixed(turn, v), self.share(1.0, y))))
            (s, ds), (c, dc) = found
            return (s, ds), (self.negative(c), dc)
        if op != TANGENT:
            s, ds = self._slope(a, out + 1, k)
            c, dc = self._slope(a, out, k)
            return (s, ds), (self.negative(c), dc)
        self.series[out].append(self._slope(a, out + 1, k))
        w, dw = self._product(out, out, k)
        return self.series[out].pop(), (w if b == 0 else self.negative(w), dw)


def can_bound(tape: ModeTape, constant_rows: Sequence[tuple[int, ...]]) -> bool:
    """Return whether every operation can be written as straight-line code."""
    return tape.is_known and all(row[0] in KNOWN | _ASKED for row in constant_rows)


def bounds_text(
    tape: ModeTape,
    constant_rows: Sequence[tuple[int, ...]],
    constant_sources: ConstantSources,
    numbers: Sequence[int],
    guards: int,
) -> str:
    """Return a module with the function bounds_0; numbers: indices of the tape's active guards among all guards.

    Raise TooLong if it would take too long to compile.
    """
    code, size = _Bounded(tape, constant_rows, constant_sources), _ORDER + 1
    for g, r in zip(numbers, tape.guards, strict=True):
        for k in range(size):
            value, bound = code.at(r, k)
            code.store(value, "%out", g * size + k)
            code.store(bound, "%out", (guards + g) * size + k)
    return DECLARATIONS + function("bounds_0", code.lines)
