"""Text to checked expression: parsing by a whitelist, evaluation, substitution, conversion to SymPy."""

from hybridsim.expr.evaluate import evaluate, resolve
from hybridsim.expr.function import FunctionExpression, function_name, of_function
from hybridsim.expr.parse import Expression, of_tree, parse, require_names, substitute

__all__ = [
    "Expression",
    "FunctionExpression",
    "evaluate",
    "function_name",
    "of_function",
    "of_tree",
    "parse",
    "require_names",
    "resolve",
    "substitute",
]
