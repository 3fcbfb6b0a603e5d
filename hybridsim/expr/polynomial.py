"""This module converts expressions to polynomials with exact coefficients, to compare expressions."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from fractions import Fraction

from hybridsim.expr.grammar import FUNCTIONS, NAME
from hybridsim.expr.write import write

Monomial = tuple[tuple[str, int], ...]
"""Factors with their powers, sorted; () is the constant monomial."""
Polynomial = Mapping[Monomial, Fraction]
"""Monomials with their exact, nonzero coefficients."""

_MOST_TERMS = 200  # a product with more terms is not expanded and counts as one factor
_HIGHEST = 8  # a higher power is not expanded either
_DIVISOR = re.compile(rf"1/\(1\*({NAME.pattern})\^1\)")
_COMPARE = {
    ast.Lt: lambda d: d < 0,
    ast.LtE: lambda d: d <= 0,
    ast.Gt: lambda d: d > 0,
    ast.GtE: lambda d: d >= 0,
}


def polynomial(node: ast.expr) -> Polynomial:
    """Return the polynomial of a tree; trees with equal polynomials have equal values.

    Trees with equal values may have different polynomials. Decimal numbers have the exact value of their double.
    Functions and conditions of constants are evaluated.
    """
    match node:
        case ast.Constant(value=bool()):
            return _thing(node)
        case ast.Constant(value=int() | float() as number):
            return _constant(Fraction(number))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return polynomial(operand)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return scaled(polynomial(operand), Fraction(-1))
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _sum(polynomial(left), polynomial(right))
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return difference(left, right)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _product(polynomial(left), polynomial(right), node)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return _quotient(polynomial(left), polynomial(right), node)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _power(polynomial(left), polynomial(right), node)
        case ast.IfExp(test=ast.Compare(left=left, ops=[op], comparators=[right]), body=body, orelse=orelse):
            apart = constant_of(difference(left, right))
            if apart is not None and type(op) in _COMPARE:
                return polynomial(body if _COMPARE[type(op)](apart) else orelse)
        case ast.Call(func=ast.Name(id=name), args=args):
            return _call(name, args, node)
    return _thing(node)


def difference(left: ast.expr, right: ast.expr) -> Polynomial:
    """Return the polynomial of the difference of two trees, left - right."""
    return _sum(polynomial(left), scaled(polynomial(right), Fraction(-1)))


def constant_of(p: Polynomial) -> Fraction | None:
    """Return the value of a constant polynomial, otherwise None."""
    if not p:
        return Fraction(0)
    return p[()] if set(p) == {()} else None


def scaled(p: Polynomial, factor: Fraction) -> Polynomial:
    """Return a polynomial times a number."""
    return {m: c * factor for m, c in p.items()} if factor else {}


def is_multiple(p: Polynomial, of: Polynomial) -> bool:
    """Return whether the polynomial `p` is a multiple of `of`, after both are cleared of denominators."""
    rest, divisor = _cleared(p), _cleared(of)
    if not divisor:
        return False
    names = sorted({factor for monomial in (*rest, *divisor) for factor, _ in monomial})

    def powers(monomial: Monomial) -> tuple[int, ...]:
        return tuple(dict(monomial).get(name, 0) for name in names)

    lead = max(divisor, key=powers)
    for _ in range(_MOST_TERMS):
        if not rest:
            return True
        first = max(rest, key=powers)
        left = [a - b for a, b in zip(powers(first), powers(lead), strict=True)]
        if min(left, default=0) < 0:
            return False
        quotient = tuple((name, power) for name, power in zip(names, left, strict=True) if power)
        factor = {quotient: rest[first] / divisor[lead]}
        rest = _sum(rest, scaled(_product(factor, divisor, ast.Constant(0)), Fraction(-1)))
    return False


def _cleared(p: Polynomial) -> Polynomial:
    """Return a polynomial multiplied by the names in its denominators."""
    divisors = {factor for monomial in p for factor, _ in monomial if _DIVISOR.fullmatch(factor)}
    for divisor in divisors:
        name = _DIVISOR.fullmatch(divisor)
        assert name is not None  # divisors match this pattern
        highest = max(dict(monomial).get(divisor, 0) for monomial in p)
        made: dict[Monomial, Fraction] = {}
        for monomial, coefficient in p.items():
            powers = dict(monomial)
            left = highest - powers.pop(divisor, 0)
            powers[name[1]] = powers.get(name[1], 0) + left
            key = tuple(sorted((factor, power) for factor, power in powers.items() if power))
            made[key] = made.get(key, Fraction(0)) + coefficient
        p = {monomial: coefficient for monomial, coefficient in made.items() if coefficient}
    return p


def direction(p: Polynomial) -> tuple[frozenset[tuple[Monomial, Fraction]], int]:
    """Return `p` divided by its leading coefficient, and the sign of this coefficient."""
    first = min((m for m in p if m), default=())
    lead = p[first]
    return frozenset(scaled(p, 1 / lead).items()), 1 if lead > 0 else -1


def _constant(value: Fraction) -> Polynomial:
    return {(): value} if value else {}


def _thing(node: ast.expr) -> Polynomial:
    return {((write(node), 1),): Fraction(1)}


def _named(text: str) -> Polynomial:
    return {((text, 1),): Fraction(1)}


def _sum(a: Polynomial, b: Polynomial) -> Polynomial:
    total = {monomial: a.get(monomial, Fraction(0)) + b.get(monomial, Fraction(0)) for monomial in {**a, **b}}
    return {monomial: coefficient for monomial, coefficient in total.items() if coefficient}


def _product(a: Polynomial, b: Polynomial, node: ast.expr) -> Polynomial:
    if len(a) * len(b) > _MOST_TERMS:
        return _thing(node)
    total: dict[Monomial, Fraction] = {}
    for m, c in a.items():
        for n, d in b.items():
            powers = dict(m)
            for factor, power in n:
                powers[factor] = powers.get(factor, 0) + power
            monomial = tuple(sorted(powers.items()))
            total[monomial] = total.get(monomial, Fraction(0)) + c * d
    return {monomial: coefficient for monomial, coefficient in total.items() if coefficient}


def _quotient(a: Polynomial, b: Polynomial, node: ast.expr) -> Polynomial:
    number = constant_of(b)
    if number is not None:
        return scaled(a, 1 / number) if number else _thing(node)
    return _product(a, _named(f"1/({text_of(b)})"), node)


def _power(base: Polynomial, exponent: Polynomial, node: ast.expr) -> Polynomial:
    number = constant_of(exponent)
    if number is None or number.denominator != 1 or not 0 <= number <= _HIGHEST:
        return _named(f"({text_of(base)})**({text_of(exponent)})")
    total: Polynomial = _constant(Fraction(1))
    for _ in range(int(number)):
        total = _product(total, base, node)
    return total


def _call(name: str, args: list[ast.expr], node: ast.expr) -> Polynomial:
    parts = [polynomial(argument) for argument in args]
    numbers = [number for part in parts if (number := constant_of(part)) is not None]
    if len(numbers) == len(parts):
        try:
            value = float(FUNCTIONS[name].value(*map(float, numbers)))
        except (ArithmeticError, ValueError):
            return _thing(node)
        return _constant(Fraction(value)) if math.isfinite(value) else _thing(node)
    return _named(f"{name}({', '.join(map(text_of, parts))})")


def tree_of(p: Polynomial) -> ast.expr:
    """Return the syntax tree of a polynomial."""
    total: ast.expr | None = None
    for monomial, coefficient in sorted(p.items()):
        term = number_tree(coefficient)
        for name, power in monomial:
            factor = ast.BinOp(ast.Name(name, ast.Load()), ast.Pow(), ast.Constant(power))
            term = ast.BinOp(term, ast.Mult(), factor)
        total = term if total is None else ast.BinOp(total, ast.Add(), term)
    return ast.Constant(0) if total is None else total


def number_tree(value: Fraction) -> ast.expr:
    """Return the tree of a fraction as a quotient of integers."""
    number: ast.expr = ast.Constant(abs(value.numerator))
    number = number if value >= 0 else ast.UnaryOp(ast.USub(), number)
    return number if value.denominator == 1 else ast.BinOp(number, ast.Div(), ast.Constant(value.denominator))


def text_of(p: Polynomial) -> str:
    """Return a text that is the same for equal polynomials."""
    return " + ".join(f"{c}*" + "*".join(f"{f}^{n}" for f, n in m) for m, c in sorted(p.items())) or "0"
