"""This module converts expressions to an instruction tape: rows (operation, a, b, c, out) over registers.

The tape is data. It is built once from SymPy expressions when a model is first lowered, stored beside the
generated source, and run by `hybridsim.engine.series.bounded` to compute Taylor coefficients with error
bounds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from typing import Any

from hybridsim.engine.native.constants import UNIT
from hybridsim.engine.series import operations as ops
from hybridsim.expr.grammar import WHOLE_POWERS

# Twelve squarings; beyond it exp(n log u), which is undefined for u < 0
_MAX_INTEGER_POWER = 4096


class TapeBuilder:
    """Converts SymPy expressions to rows of an instruction tape; equal subexpressions share a register.

    Parameters
    ----------
    fixed : names of the values that are constant in a segment: parameters and functions of parameters alone.
    """

    def __init__(self, fixed: Set[str] = frozenset()) -> None:
        self.fixed = fixed
        self.registers: dict[str, int] = {}  # name -> register
        self.constants: dict[tuple[float, float], int] = {}  # value and bound of its error -> register
        self.count = 0

    def register(self, name: str) -> int:
        """Return the register of a name, which is allocated on first use."""
        if name not in self.registers:
            self.registers[name] = self._new()
        return self.registers[name]

    def rows(self, assignments: list[tuple[str, Any]], known: dict[Any, int]) -> list[tuple[int, ...]]:
        """Return instruction rows that compute each expression and copy it to the register of its name."""
        rows: list[tuple[int, ...]] = []
        for name, expression in assignments:
            source = self._emit(expression, known, rows)
            rows.append((ops.COPY, source, 0, 0, self.register(name)))
        return rows

    def _new(self) -> int:
        self.count += 1
        return self.count - 1

    def _constant(self, value: float, error: float = 0.0) -> int:
        if (value, error) not in self.constants:
            self.constants[value, error] = self._new()
        return self.constants[value, error]

    def _op(self, rows: list[tuple[int, ...]], op: int, a: int, b: int = 0, c: int = 0) -> int:
        out = self._new()
        if op in (ops.SINCOS, ops.SINHCOSH, ops.TANGENT):
            self._new()  # these operations keep a companion series in the next register
        rows.append((op, a, b, c, out))
        return out

    def _emit(self, e: Any, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        if e in known:
            return known[e]
        known[e] = out = self._emit_new(e, known, rows)
        return out

    def _emit_new(self, e: Any, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        import sympy as sp

        if e.is_Symbol:
            return self.register(e.name)
        if e is sp.true or e is sp.false:
            return self._constant(1.0 if e is sp.true else 0.0)
        if e.is_number and not e.has(sp.Function):
            value = float(e)
            is_exact = e.is_Float or (e.is_Rational and math.isfinite(value) and sp.Rational(value) == e)
            return self._constant(value, 0.0 if is_exact else UNIT * abs(value))
        if e.is_Add or e.is_Mul:
            return self._emit_sequence(e, known, rows)
        if e.is_Pow:
            return self._emit_power(e.base, e.exp, known, rows)
        if isinstance(e, sp.Piecewise):
            return self._emit_piecewise(e, known, rows)
        arguments = [self._emit(a, known, rows) for a in e.args]
        return self._emit_function(e, arguments, known, rows)

    def _emit_sequence(self, e: Any, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        import sympy as sp

        if e.is_Mul:
            # negative powers only, since exp(-u) over one would be infinite instead of 0
            below = [a for a in e.args if a.is_Pow and a.exp.is_number and a.exp.is_negative]
            saturating = [a for a in below if _grows_without_bound(a.base, a.exp)]
            numerator = sp.Mul(*(a for a in e.args if a not in below))
            denominator = sp.Mul(*(1 / a for a in below if a not in saturating))
            if saturating or (denominator != 1 and not denominator.is_number):
                out = self._emit(numerator, known, rows)
                for a in saturating:
                    out = self._op(rows, ops.MUL, out, self._emit(a, known, rows))
                if denominator == 1:
                    return out
                return self._op(rows, ops.DIV, out, self._emit(denominator, known, rows))
            if e.could_extract_minus_sign() and e.args[0] is sp.S.NegativeOne:
                return self._op(rows, ops.NEG, self._emit(-e, known, rows))
        out = -1
        for argument in e.args:
            subtract = e.is_Add and out >= 0 and argument.could_extract_minus_sign()
            value = self._emit(-argument if subtract else argument, known, rows)
            if out < 0:
                out = value
            else:
                out = self._op(rows, ops.SUB if subtract else (ops.ADD if e.is_Add else ops.MUL), out, value)
        return out

    def _emit_power(
        self, base: Any, exponent: Any, known: dict[Any, int], rows: list[tuple[int, ...]]
    ) -> int:
        """Emit integer and half-integer powers as products, which are defined at 0 and below."""
        import sympy as sp

        if _grows_without_bound(base, exponent):
            return self._products(self._over(base, known, rows), -int(exponent), known, rows)
        source = self._emit(base, known, rows)
        twice = 2.0 * float(exponent) if exponent.is_number else 0.5
        if twice.is_integer() and abs(twice) <= 2 * _MAX_INTEGER_POWER:
            n, odd = divmod(int(twice), 2)
            if odd:
                n, root = int(twice), self._op(rows, ops.SQRT, source)
                source = (
                    self._unless_zero(rows, root, source, self._constant(1.0)) if base.has(sp.Abs) else root
                )
            power = self._products(source, abs(n), known, rows)
            return power if n > 0 else self._op(rows, ops.DIV, self._constant(1.0), power)
        logarithm = self._op(rows, ops.INTEGRAL, source, source, ops.LOG)
        number = self._emit(exponent, known, rows)
        power = self._op(rows, ops.EXP, self._op(rows, ops.MUL, number, logarithm))
        if base.has(sp.Abs):
            power = self._unless_zero(rows, power, source, number)
        if (
            exponent.is_number
            or not {s.name for s in exponent.free_symbols} <= self.fixed
            or base.is_positive
        ):
            return power
        return self._whole(source, self._emit(exponent, known, rows), power, known, rows)

    def _unless_zero(self, rows: list[tuple[int, ...]], power: int, base: int, exponent: int) -> int:
        """Emit a power that is 0 at a zero base if the exponent is positive."""
        nothing = self._constant(0.0)
        value_at_0 = self._op(rows, ops.SELECT, self._op(rows, ops.LESS, nothing, exponent), nothing, power)
        return self._op(rows, ops.SELECT, self._op(rows, ops.LESS, nothing, base), power, value_at_0)

    def _over(self, base: Any, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        """Emit 1/(c + d e^u) and 1/cosh(u) without overflow of the exponential."""
        found = _with_exponential(base)
        rest, factor, u = found or (None, None, base.args[0])
        exponent, one = self._emit(u, known, rows), self._constant(1.0)
        is_large = self._op(rows, ops.LESS, self._constant(0.0), exponent, ops.AGREEING)
        q = self._op(
            rows, ops.EXP, self._op(rows, ops.SELECT, is_large, self._op(rows, ops.NEG, exponent), exponent)
        )
        if found is None:
            below = self._op(rows, ops.ADD, one, self._op(rows, ops.MUL, q, q))
            return self._op(rows, ops.DIV, self._op(rows, ops.ADD, q, q), below)
        c, d = self._emit(rest, known, rows), self._emit(factor, known, rows)
        large = self._op(rows, ops.ADD, self._op(rows, ops.MUL, c, q), d)
        small = self._op(rows, ops.ADD, c, self._op(rows, ops.MUL, d, q))
        above, below = (
            self._op(rows, ops.SELECT, is_large, q, one),
            self._op(rows, ops.SELECT, is_large, large, small),
        )
        return self._op(rows, ops.DIV, above, below)

    def _whole(
        self, source: int, exponent: int, power: int, known: dict[Any, int], rows: list[tuple[int, ...]]
    ) -> int:
        """Emit a power whose exponent may be an integer at run time."""
        one = self._constant(1.0)
        for n in WHOLE_POWERS:
            product = self._products(source, abs(n), known, rows) if n else one
            whole = self._op(rows, ops.DIV, one, product) if n < 0 else product
            is_so = self._op(rows, ops.EQUAL, exponent, self._constant(float(n)))
            power = self._op(rows, ops.SELECT, is_so, whole, power)
        return power

    def _products(self, source: int, n: int, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        """Emit the power n >= 1 of a register by repeated squaring."""
        if n == 1:
            return source
        key = ("power", source, n)
        if key not in known:
            half = self._products(source, n // 2, known, rows)
            out = self._op(rows, ops.MUL, half, half)
            known[key] = self._op(rows, ops.MUL, out, source) if n % 2 else out
        return known[key]

    def _emit_piecewise(self, e: Any, known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        out = self._emit(e.args[-1].expr, known, rows)
        for pair in reversed(e.args[:-1]):
            condition = self._emit(pair.cond, known, rows)
            value = self._emit(pair.expr, known, rows)
            out = self._op(rows, ops.SELECT, condition, value, out)
        return out

    def _emit_function(self, e: Any, a: list[int], known: dict[Any, int], rows: list[tuple[int, ...]]) -> int:
        import sympy as sp

        one = self._constant(1.0)
        simple: Mapping[Any, int] = {sp.Abs: ops.ABS, sp.sign: ops.SIGN, sp.Not: ops.NOT, sp.tan: ops.TANGENT}
        chained: Mapping[Any, int] = {sp.Min: ops.MIN, sp.Max: ops.MAX, sp.And: ops.AND, sp.Or: ops.OR}
        ordered: Mapping[Any, tuple[int, bool]] = {
            sp.StrictLessThan: (ops.LESS, False),
            sp.StrictGreaterThan: (ops.LESS, True),
            sp.LessThan: (ops.LESS_EQUAL, False),
            sp.GreaterThan: (ops.LESS_EQUAL, True),
        }
        kind = e.func
        if isinstance(e, sp.exp):
            return self._op(rows, ops.EXP, a[0])
        if kind in simple:
            return self._op(rows, simple[kind], a[0])
        if kind in chained:
            out = a[0]
            for other in a[1:]:
                out = self._op(rows, chained[kind], out, other)
            return out
        if kind in ordered:
            op, swap = ordered[kind]
            return self._op(rows, op, a[1] if swap else a[0], a[0] if swap else a[1])
        if kind is sp.Eq:
            return self._op(rows, ops.EQUAL, a[0], a[1])
        if kind is sp.ITE:
            return self._op(rows, ops.SELECT, a[0], a[1], a[2])
        if kind is sp.cot:  # SymPy rewrites tan(u + pi/2) as cot(u)
            return self._op(rows, ops.DIV, one, self._op(rows, ops.TANGENT, a[0]))
        if kind is sp.Ne:
            return self._op(rows, ops.NOT, self._op(rows, ops.EQUAL, a[0], a[1]))
        if kind in (sp.sin, sp.cos):
            pair = ("sincos", e.args[0])
            if pair not in known:
                known[pair] = self._op(rows, ops.SINCOS, a[0])
            return known[pair] + (0 if kind is sp.sin else 1)
        if isinstance(e, (sp.sinh, sp.cosh)):
            pair = ("sinhcosh", e.args[0])
            if pair not in known:
                known[pair] = self._op(rows, ops.SINHCOSH, a[0])
            return known[pair] + (0 if isinstance(e, sp.sinh) else 1)
        if isinstance(e, sp.tanh):
            # (e^u - e^-u)/(e^u + e^-u) overflows; 1 - 2/(e^{2u} + 1) loses digits at 0: use y' = (1 - y^2) u'
            return self._op(rows, ops.TANGENT, a[0], 1)
        if kind is sp.log:
            return self._op(rows, ops.INTEGRAL, a[0], a[0], ops.LOG)
        if kind in (sp.asin, sp.acos):
            root = self._op(rows, ops.SQRT, self._op(rows, ops.SUB, one, self._op(rows, ops.MUL, a[0], a[0])))
            if kind is sp.asin:
                return self._op(rows, ops.INTEGRAL, root, a[0], ops.ASIN)
            return self._op(rows, ops.INTEGRAL, self._op(rows, ops.NEG, root), a[0], ops.ACOS)
        if kind is sp.atan:
            return self._op(
                rows,
                ops.INTEGRAL,
                self._op(rows, ops.ADD, one, self._op(rows, ops.MUL, a[0], a[0])),
                a[0],
                ops.ATAN,
            )
        if kind is sp.atan2:
            # after a rotation by the leading angle the rest is an ordinary arc tangent
            return self._op(rows, ops.INTEGRAL, a[1], a[0], ops.ANGLE)
        raise NotImplementedError(f"there is no Taylor recurrence for {kind}")


def _with_exponential(base: Any) -> tuple[Any, Any, Any] | None:
    """Split a sum into c + d e^u, where c contains no exponential; return None if this is impossible."""
    import sympy as sp

    if not base.is_Add:
        return None
    growing = [term for term in base.args if term.has(sp.exp, sp.sinh, sp.cosh)]
    if len(growing) != 1 or len(base.args) == 1:
        return None
    factors = sp.Mul.make_args(growing[0])
    exponentials = [factor for factor in factors if isinstance(factor, sp.exp)]
    others = [factor for factor in factors if not isinstance(factor, sp.exp)]
    if len(exponentials) != 1 or any(factor.has(sp.exp, sp.sinh, sp.cosh) for factor in others):
        return None
    rest = sp.Add(*(term for term in base.args if term is not growing[0]))
    return rest, sp.Mul(*others), exponentials[0].args[0]


def _grows_without_bound(base: Any, exponent: Any) -> bool:
    """Return whether a power has a negative exponent and a base that grows exponentially."""
    import sympy as sp

    is_below = exponent.is_Integer and exponent.is_negative
    return bool(is_below and (isinstance(base, sp.cosh) or _with_exponential(base) is not None))
