"""This module infers the unit of an expression from the units of its names.

A number does not tell its unit: it may be a constant such as 9.81 m/s^2. A number that is added or compared is taken to
have the unit of the other side. A small number in a product with a parameter that has a unit, as in 2*zeta*m*v, is a
pure number. Beside any other number a product has an unknown unit, and unknown units never disagree.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hybridsim.expr.walk import NoValue, value_of
from hybridsim.expr.write import write
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.units.unit import ONE, Unit, most_frequent

Units = Mapping[str, Unit]

# Multiples of 1/4 up to this one are pure numbers in formulas such as k*x**2/2.
_COUNT = 4
# Exponents such as 0.7 are fractions with at most this denominator.
_DENOMINATOR = 100
_OF_NUMBERS = frozenset(
    {"sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "floor", "round"}
)
_OF_ALIKE = frozenset({"min", "max", "mod"})


@dataclass(frozen=True)
class Disagreement:
    """Two units that differ: the unit of a term, and the unit of another term or the required unit."""

    term: ast.expr
    unit: Unit
    required: Unit
    because: ast.expr | str  # the other term, or the place that needs a unit


class Inference:
    """Infers units of expressions, and collects disagreements and the reasons for unknown units.

    Parameters
    ----------
    units : the known units by name.
    parameters : names of the parameters, which numbers multiply as pure numbers.
    counts : whether numbers in products are pure numbers, as in a duration of 20 periods.
    """

    def __init__(self, units: Units, parameters: Collection[str], counts: bool = False) -> None:
        self.units = units
        self.parameters = parameters
        self.counts = counts
        self.disagreements: list[Disagreement] = []
        self.unknown: list[str] = []

    def unit(self, node: ast.expr) -> Unit | None:
        """Return the unit of an expression, or None if it is unknown or the expression is only a number.

        The unit of a condition is that of its sides, or of those of its first part.
        """
        if is_number(node):
            return None
        match node:
            case ast.Name(id=name):
                return self._named(name)
            case ast.UnaryOp(operand=operand):
                return self.unit(operand)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self._alike([*terms_of(node)])
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self._product(node)
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
                return self._power(base, exponent)
            case ast.Compare(left=left, comparators=others):
                return self._alike([left, *others])
            case ast.BoolOp(values=values):
                units = [self.unit(value) for value in values]
                return units[0]
            case ast.IfExp(test=test, body=body, orelse=orelse):
                self.unit(test)
                return self._alike([body, orelse])
            case ast.Call(func=ast.Name(id=function), args=args):
                return self._call(function, args)
        return None

    def _named(self, name: str) -> Unit | None:
        if name not in self.units:
            self.unknown.append(f"{name} has no known unit")
        return self.units.get(name)

    def _alike(self, nodes: Sequence[ast.expr]) -> Unit | None:
        """Return the common unit of terms that are added or compared: the unit that most of the terms have."""
        known = [(node, unit) for node in nodes if (unit := self.unit(node)) is not None]
        if not known:
            return None
        common = most_frequent([unit for _, unit in known])
        usual = next(node for node, unit in known if unit == common)
        for node, unit in known:
            if unit.differs(common):
                self.disagreements.append(Disagreement(node, unit, common, usual))
        return common

    def _product(self, node: ast.expr) -> Unit | None:
        factors = [*factors_of(node)]
        units = [(self.unit(factor), sign) for factor, sign in factors if not is_number(factor)]
        product = ONE
        for unit, sign in units:
            if unit is None:
                return None
            product = product * unit if sign > 0 else product / unit
        numbers = [factor for factor, _ in factors if is_number(factor)]
        if all(_is_one(number) for number in numbers):
            return product
        if not (self.counts or (self.has_parameter(node) and all(map(_is_pure, numbers)))):
            self.unknown.append(f"a number in '{write(node)}' may have a unit")
            return None
        turns = any(isinstance(part, ast.Name) for number in numbers for part in ast.walk(number))
        return product.without_angles() if turns else product  # 2*pi*f is in rad/s

    def has_parameter(self, node: ast.expr) -> bool:
        """Return whether a product contains a parameter, or a power of a parameter, with a known unit other than 1."""
        match node:
            case ast.Name(id=name):
                return name in self.parameters and self.units.get(name, ONE) != ONE
            case ast.UnaryOp(operand=operand):
                return self.has_parameter(operand)
            case ast.BinOp(left=base, op=ast.Pow()) | ast.Call(func=ast.Name(id="sqrt" | "abs"), args=[base]):
                return self.has_parameter(base)
            case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
                return self.has_parameter(left) or self.has_parameter(right)
        return False

    def _power(self, base: ast.expr, exponent: ast.expr) -> Unit | None:
        unit = self.unit(base)
        if is_number(exponent):
            value = _value(exponent)
            return None if unit is None or value is None else unit.power(value)
        self._require_number(exponent)
        if unit is None or not unit.is_number:
            self.unknown.append(f"the exponent '{write(exponent)}' is not a number")
            return None
        return ONE

    def _call(self, function: str, args: Sequence[ast.expr]) -> Unit | None:
        if function in _OF_NUMBERS:
            self._require_number(args[0], function)
            return ONE
        if function in _OF_ALIKE:
            return self._alike(args)
        if function == "atan2":
            self._alike(args)
            return ONE
        unit = self.unit(args[0])
        if function == "sign":
            return ONE
        if function == "sqrt":
            return None if unit is None else unit.power(Fraction(1, 2))
        return unit  # abs

    def _require_number(self, node: ast.expr, function: str = "") -> None:
        """Report an argument or exponent that is known not to be a pure number."""
        unit = self.unit(node)
        if unit is not None and not unit.is_number:
            because = f"the argument of {function}" if function else "an exponent"
            self.disagreements.append(Disagreement(node, unit, ONE, because))


def is_number(node: ast.expr) -> bool:
    """Return whether an expression contains no names except pi."""
    return not names_of(node) - {"pi"}


def terms_of(node: ast.expr) -> Iterator[ast.expr]:
    """Yield the terms of a sum, without their signs."""
    match node:
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            yield from terms_of(left)
            yield from terms_of(right)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            yield from terms_of(operand)
        case _:
            yield node


def factors_of(node: ast.expr, sign: int = 1) -> Iterator[tuple[ast.expr, int]]:
    """Yield the factors of a product with the exponent 1, and its divisors with the exponent -1."""
    match node:
        case _ if is_number(node):
            yield node, sign
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            yield from factors_of(left, sign)
            yield from factors_of(right, sign)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            yield from factors_of(left, sign)
            yield from factors_of(right, -sign)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            yield from factors_of(operand, sign)
        case _:
            yield node, sign


def _is_pure(number: ast.expr) -> bool:
    """Return whether a factor contains only pi and small multiples of 1/4."""
    return all(
        value <= _COUNT and (4 * value) % 1 == 0
        for node in ast.walk(number)
        if isinstance(node, ast.Constant) and isinstance(value := node.value, int | float)
    )


def _is_one(number: ast.expr) -> bool:
    value = _value(number)
    return value is not None and abs(value) == 1


def _value(number: ast.expr) -> Fraction | None:
    """Return the value of a number, or None if the value is undefined."""
    try:
        return Fraction(value_of(number, {})).limit_denominator(_DENOMINATOR)
    except (NoValue, OverflowError):
        return None
