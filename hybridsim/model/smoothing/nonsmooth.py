"""This module finds non-smooth functions in expressions: abs, min, max, sign, conditionals."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

from hybridsim.errors import Place
from hybridsim.expr import Expression
from hybridsim.expr.write import write
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import never_negative, number_of

# the treatments of a primitive, see Primitive.became
COMPONENT, SURFACE, MODE, UNCHANGED, POWER, TIMED = "component", "surface", "mode", "kept", "power", "signal"
JUMPS = "it jumps, judging by its form"  # start of the remark on a kept primitive whose sides differ
_WORD = re.compile(r"\b(abs|min|max|sign|if)\b")
_LIMITED = ("sqrt", "log", "asin", "acos")
_ZERO = ast.Constant(0)
_HOLDS = {  # truth of a comparison for a positive, zero and negative difference left - right
    ast.Gt: (True, False, False),
    ast.GtE: (True, True, False),
    ast.Lt: (False, False, True),
    ast.LtE: (False, True, True),
}


@dataclass(frozen=True)
class Primitive:
    """A non-smooth function with a varying argument, and its treatment.

    Parameters
    ----------
    text : source text, for a friction law with the names of its contact.
    where : the rates, guards, definitions and variables that use it.
    became : "component" (a corner, replaced by a component with two modes), "surface" (a jump, replaced by a switching
        surface or, for a jump in time, by a component), "mode" (its side follows from the modes of a component), "kept"
        (not replaced), "power" (a fractional power, which has no Taylor series at zero), "signal" (it depends on time
        alone and switches at known times).
    remark : the component, the reason, or the expression whose zeros in time switch it.
    """

    text: str
    where: tuple[str, ...]
    became: str
    remark: str
    place: Place | None


def uses_primitives(model: Model) -> bool:
    """Return whether an integrated or monitored expression contains a non-smooth function."""
    return any(_WORD.search(expr.text) for expr in _expressions(model))


def uses_sign(model: Model) -> bool:
    """Return whether an integrated or monitored expression contains a sign."""
    return any("sign" in expr.text for expr in _expressions(model))


def uses_conditions(model: Model) -> bool:
    """Return whether an integrated or monitored expression contains a condition."""
    return any(" if " in expr.text for expr in _expressions(model))


def has_word(expr: Expression) -> bool:
    """Return whether an expression contains a non-smooth function; the definitions that it uses are ignored."""
    return bool(_WORD.search(expr.text))


def _expressions(model: Model) -> Iterator[Expression]:
    yield from (state.der for state in model.states)
    yield from (expr for _, expr in model.definitions)
    for contact in model.contacts:
        yield from (contact.velocity, contact.normal, *(expr for _, expr in contact.law.expressions()))
        yield from (value for value in contact.law.parameters.values() if value is not None)
        yield from contact.arguments.values()
    for surface in model.surfaces:
        yield from (surface.expr, *surface.above.values(), *surface.below.values())
    for impact in model.impacts:
        yield from (impact.gap, impact.restitution)
    for component in model.components:
        for mode in component.modes:
            yield from (*mode.der.values(), *mode.set.values(), *(guard.expr for guard in mode.guards))
    yield from (monitor.expr for monitor in model.monitors)


def limited(node: ast.expr, meanings: Meanings) -> Iterator[ast.expr]:
    """Yield the arguments of functions with a limited domain, such as roots, logarithms and powers."""
    for part in ast.walk(node):
        match part:
            case ast.Call(func=ast.Name(id=name), args=[argument]) if name in _LIMITED:
                if meanings.moves(argument) and not (
                    name in ("sqrt", "log") and is_clear_of_zero(argument, {}, meanings)
                ):
                    yield argument
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent) if meanings.moves(base):
                if not is_whole(exponent, meanings) and not is_clear_of_zero(base, {}, meanings):
                    yield base


def roots_in(expr: Expression, meanings: Meanings) -> Iterator[tuple[ast.expr, ast.expr, str]]:
    """Yield the roots and fractional powers of varying bases, each with its base and its exponent as text."""
    for part in ast.walk(meanings.written_out(expr.tree)):
        match part:
            case ast.Call(func=ast.Name(id="sqrt"), args=[base]) if meanings.moves(base):
                yield part, base, "0.5"
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent) if meanings.moves(base):
                if not is_whole(exponent, meanings):
                    yield part, base, write(exponent)


def is_whole(exponent: ast.expr, meanings: Meanings) -> bool:
    """Return whether an exponent is an integer for all values of the parameters."""
    value = number_of(exponent, {}, meanings.lookup)
    return value is not None and value == round(value)


def is_clear_of_zero(node: ast.expr, numbers: dict[str, float], meanings: Meanings) -> bool:
    """Return whether the form of an expression shows that it is positive, such as 1 + v**2 or exp(v)."""
    match node:
        case ast.Name(id=name) if (tree := meanings.lookup(name)) is not None:
            return is_clear_of_zero(tree, numbers, meanings)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return any(
                is_clear_of_zero(a, numbers, meanings) and never_negative(b, numbers, meanings.lookup)
                for a, b in ((left, right), (right, left))
            )
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
            return all(is_clear_of_zero(part, numbers, meanings) for part in (left, right))
        case ast.Call(func=ast.Name(id="exp" | "cosh")):
            return True
    value = number_of(node, numbers, meanings.lookup)
    return value is not None and value > 0.0


Sides = tuple[ast.expr, ast.expr, ast.expr, ast.expr]
"""The argument of a primitive, and its values for positive, negative and zero argument."""


def sides_of(node: ast.expr) -> Sides | None:
    """Return the argument and the two branches of a non-smooth function, or None for other nodes."""
    match node:
        case ast.Call(func=ast.Name(id="abs"), args=[u]):
            return u, u, ast.UnaryOp(ast.USub(), u), u
        case ast.Call(func=ast.Name(id="sign"), args=[u]):
            return u, ast.Constant(1), ast.UnaryOp(ast.USub(), ast.Constant(1)), _ZERO
        case ast.Call(func=ast.Name(id="max"), args=[a, b]):
            return _minus(a, b), a, b, a
        case ast.Call(func=ast.Name(id="min"), args=[a, b]):
            return _minus(a, b), b, a, a
        case ast.IfExp(test=ast.Compare(left=a, ops=[op], comparators=[b]), body=body, orelse=orelse) if (
            type(op) in _HOLDS
        ):
            above, on_border, below = (body if holds else orelse for holds in _HOLDS[type(op)])
            return _minus(a, b), above, below, on_border
    return None


def _minus(a: ast.expr, b: ast.expr) -> ast.expr:
    if isinstance(b, ast.Constant) and b.value == 0:
        return a
    if isinstance(b, ast.UnaryOp) and isinstance(b.op, ast.USub):
        return ast.BinOp(a, ast.Add(), b.operand)
    return ast.BinOp(a, ast.Sub(), b)
