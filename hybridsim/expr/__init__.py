"""This package turns text into checked expressions, and evaluates, changes and converts them."""

from hybridsim.expr.evaluate import evaluate, resolve
from hybridsim.expr.function import FunctionExpression, function_name, of_function
from hybridsim.expr.increment import Increment, assignment, parse_reset, substitute_in_reset
from hybridsim.expr.parse import Expression, is_zero_dimensional, of_tree, parse, require_names, substitute
from hybridsim.expr.rounding import has_rounded_number, own_roundoff, rounding_of

__all__ = [
    "Expression",
    "FunctionExpression",
    "Increment",
    "assignment",
    "evaluate",
    "function_name",
    "has_rounded_number",
    "is_zero_dimensional",
    "of_function",
    "of_tree",
    "own_roundoff",
    "parse",
    "parse_reset",
    "require_names",
    "resolve",
    "rounding_of",
    "substitute",
    "substitute_in_reset",
]
