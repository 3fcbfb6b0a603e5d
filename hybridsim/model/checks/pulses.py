"""This module finds pulses and smooth steps in time, which an integration step can miss."""

from __future__ import annotations

import ast

from hybridsim.expr.grammar import TIME
from hybridsim.model.smoothing.one_sided import Lookup

# Degree that is assigned to expressions that are not polynomials in t.
_CURVED = 9


def pulse_in(node: ast.expr, lookup: Lookup) -> ast.expr | None:
    """Return the first part of an expression that is a pulse or smooth step in t, or None.

    Pulses and steps are exp(p(t)), 1/p(t) and negative powers of p(t) for p of degree 2 or more, and tanh and atan of
    t. Polynomials in t, sines and cosines are not. Conditions on t are located, or reported as jumps.
    """
    match node:
        case ast.Name(id=name) if (tree := lookup(name)) is not None:
            return pulse_in(tree, lookup)
        case ast.Call(func=ast.Name(id="exp"), args=[argument]) if degree_in_time(argument, lookup) > 1:
            return node
        case ast.Call(func=ast.Name(id="tanh" | "atan"), args=[argument]) if degree_in_time(argument, lookup):
            return node
        case ast.BinOp(op=ast.Div(), right=divisor) if degree_in_time(divisor, lookup) > 1:
            return node
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.UnaryOp(op=ast.USub())) if (
            degree_in_time(base, lookup) > 1
        ):
            return node
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.expr) and (found := pulse_in(part, lookup)) is not None:
            return found
    return None


def degree_in_time(node: ast.expr, lookup: Lookup) -> int:
    """Return the degree of an expression in t, or 9 if the expression is not a polynomial in t."""
    match node:
        case ast.Name(id=name):
            tree = lookup(name)
            return int(name == TIME) if tree is None else degree_in_time(tree, lookup)
        case ast.Constant():
            return 0
        case ast.UnaryOp(operand=operand):
            return degree_in_time(operand, lookup)
        case ast.BinOp(left=left, op=op, right=right):
            a, b = degree_in_time(left, lookup), degree_in_time(right, lookup)
            if isinstance(op, ast.Mult):
                return a + b
            if isinstance(op, ast.Div):
                return _CURVED if b else a
            if isinstance(op, ast.Pow):
                power = right.value if isinstance(right, ast.Constant) else _CURVED
                return round(a * float(power)) if isinstance(power, int | float) else _CURVED
            return max(a, b)
        case ast.Call(func=ast.Name(id="sin" | "cos")):
            return 0
    return _CURVED if _uses_time(node, lookup) else 0


def _uses_time(node: ast.AST, lookup: Lookup) -> bool:
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            tree = lookup(part.id)
            if part.id == TIME or (tree is not None and _uses_time(tree, lookup)):
                return True
    return False
