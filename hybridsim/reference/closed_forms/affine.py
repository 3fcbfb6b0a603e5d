"""This module converts an expression to a linear form plus sine waves of time."""

from __future__ import annotations

import ast
import cmath
from collections.abc import Mapping, Set
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.expr.walk import NoValue, value_of

TIME = "t"


@dataclass(frozen=True)
class Affine:
    """A linear form plus waves: constant + sum of linear[n] n + sum of Im(waves[w] exp(i w t)) for w > 0."""

    constant: float = 0.0
    linear: Mapping[str, float] = field(default_factory=dict)
    waves: Mapping[float, complex] = field(default_factory=dict)

    @property
    def is_constant(self) -> bool:
        return not self.linear and not self.waves

    def plus(self, other: Affine, factor: float = 1.0) -> Affine:
        """Return the sum of this form and a factor times another form."""
        linear, waves = dict(self.linear), dict(self.waves)
        for name, value in other.linear.items():
            linear[name] = linear.get(name, 0.0) + factor * value
        for frequency, phasor in other.waves.items():
            waves[frequency] = waves.get(frequency, 0j) + factor * phasor
        return Affine(self.constant + factor * other.constant, linear, waves)


class NotAffine(Exception):
    """Raised for an expression that is not a linear form plus sine waves."""


def affine(
    expression: Expression,
    unknowns: Set[str],
    values: Mapping[str, float],
    definitions: Mapping[str, Expression],
) -> Affine:
    """Return the linear form of an expression in the `unknowns`, or raise `NotAffine`."""
    try:
        return _read(expression.tree, unknowns | {TIME}, values, definitions)
    except (NoValue, KeyError) as fault:
        raise NotAffine(str(fault)) from fault


def _read(
    node: ast.expr, unknowns: Set[str], values: Mapping[str, float], definitions: Mapping[str, Expression]
) -> Affine:
    def read(part: ast.expr) -> Affine:
        return _read(part, unknowns, values, definitions)

    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    if not names & (unknowns | definitions.keys()):
        return Affine(float(value_of(node, values)))
    match node:
        case ast.Name(id=name):
            return read(definitions[name].tree) if name in definitions else Affine(0.0, {name: 1.0})
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return Affine().plus(read(operand), -1.0)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return read(operand)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return read(left).plus(read(right))
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return read(left).plus(read(right), -1.0)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            first, second = read(left), read(right)
            if first.is_constant:
                return Affine().plus(second, first.constant)
            if second.is_constant:
                return Affine().plus(first, second.constant)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            above, below = read(left), read(right)
            if below.is_constant and below.constant:
                divided = {name: value / below.constant for name, value in above.linear.items()}
                waves = {w: phasor / below.constant for w, phasor in above.waves.items()}
                return Affine(above.constant / below.constant, divided, waves)
        case ast.Call(func=ast.Name(id=("sin" | "cos") as name), args=[argument]):
            angle = read(argument)
            if angle.linear.keys() <= {TIME} and not angle.waves:
                return _wave(angle.linear.get(TIME, 0.0), angle.constant, name)
    raise NotAffine(ast.dump(node))


def _wave(frequency: float, phase: float, function: str) -> Affine:
    phasor = cmath.exp(1j * phase) * (1j if function == "cos" else 1)
    if frequency == 0:
        return Affine(phasor.imag)
    if frequency < 0:  # Im(A exp(-i w t)) = Im(-conj(A) exp(i w t))
        return Affine(waves={-frequency: -phasor.conjugate()})
    return Affine(waves={frequency: phasor})
