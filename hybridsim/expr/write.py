"""Convert a checked tree to text with as few parentheses as precedence allows."""

from __future__ import annotations

import ast

from hybridsim.expr.grammar import BINARY, COMPARISONS

# Levels of precedence as in Python, from low to high.
_CONDITIONAL, _OR, _AND, _NOT, _COMPARE, _SUM, _PRODUCT, _UNARY, _POWER, _ATOM = range(10)
_LEVEL: dict[type[ast.operator], int] = {
    ast.Add: _SUM,
    ast.Sub: _SUM,
    ast.Mult: _PRODUCT,
    ast.Div: _PRODUCT,
    ast.Pow: _POWER,
}


def write(node: ast.expr, least: int = _CONDITIONAL) -> str:
    """Return the text of a checked tree, in parentheses if its precedence is below ``least``."""
    text, level = _text(node)
    return f"({text})" if level < least else text


def _text(node: ast.expr) -> tuple[str, int]:
    match node:
        case ast.Constant(value=value):
            return repr(value), _ATOM
        case ast.Name(id=name):
            return name, _ATOM
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return f"not {write(operand, _NOT)}", _NOT
        case ast.UnaryOp(op=op, operand=operand):
            return ("-" if isinstance(op, ast.USub) else "+") + _unsigned(write(operand, _UNARY)), _UNARY
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return f"{write(left, _ATOM)}**{write(right, _UNARY)}", _POWER
        case ast.BinOp(left=left, op=operator, right=right):
            level, sign = _LEVEL[type(operator)], BINARY[type(operator)]
            spaced = f" {sign} " if level == _SUM else sign
            return f"{write(left, level)}{spaced}{_unsigned(write(right, level + 1))}", level
        case ast.BoolOp(op=ast.And(), values=values):
            return " and ".join(write(value, _NOT) for value in values), _AND
        case ast.BoolOp(values=values):
            return " or ".join(write(value, _AND) for value in values), _OR
        case ast.Compare(left=left, ops=ops, comparators=others):
            parts = [write(left, _SUM)]
            for relation, other in zip(ops, others, strict=True):
                parts += [COMPARISONS[type(relation)], write(other, _SUM)]
            return " ".join(parts), _COMPARE
        case ast.IfExp(test=test, body=body, orelse=orelse):
            text = f"{write(body, _OR)} if {write(test, _OR)} else {write(orelse, _CONDITIONAL)}"
            return text, _CONDITIONAL
        case ast.Call(func=ast.Name(id=name), args=args):
            return f"{name}({', '.join(write(arg) for arg in args)})", _ATOM
    raise TypeError(f"a checked expression cannot contain {ast.dump(node)}")


def _unsigned(text: str) -> str:
    """Put a text that starts with a sign in parentheses, so that it can follow an operator."""
    return f"({text})" if text.startswith(("-", "+")) else text
