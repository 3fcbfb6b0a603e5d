"""The grammar of expressions: functions, constants, reserved names and limits."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Function:
    """A function that expressions can call: its number of arguments and its value."""

    least: int
    most: int
    value: Callable[..., float]

    @property
    def arity(self) -> str:
        """The allowed number of arguments, as text."""
        if self.most > self.least:
            return f"{self.least} to {self.most} arguments"
        return f"{self.least} argument" + ("s" if self.least > 1 else "")


# Largest number of arguments of min and max, which become nested calls with two arguments.
_MAX_ARGUMENTS = 64


def _sign(x: float) -> float:
    return float((x > 0) - (x < 0))


def _floor(x: float) -> float:
    return float(math.floor(x))


def _round(x: float) -> float:
    whole = math.floor(x)
    return float(whole + (x - whole >= 0.5))  # x + 0.5 could be rounded up to a whole number


FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {
        "sin": Function(1, 1, math.sin),
        "cos": Function(1, 1, math.cos),
        "tan": Function(1, 1, math.tan),
        "asin": Function(1, 1, math.asin),
        "acos": Function(1, 1, math.acos),
        "atan": Function(1, 1, math.atan),
        "atan2": Function(2, 2, math.atan2),
        "sinh": Function(1, 1, math.sinh),
        "cosh": Function(1, 1, math.cosh),
        "tanh": Function(1, 1, math.tanh),
        "exp": Function(1, 1, math.exp),
        "log": Function(1, 1, math.log),
        "sqrt": Function(1, 1, math.sqrt),
        "abs": Function(1, 1, math.fabs),
        "sign": Function(1, 1, _sign),
        "min": Function(2, _MAX_ARGUMENTS, min),
        "max": Function(2, _MAX_ARGUMENTS, max),
        "floor": Function(1, 1, _floor),
        "mod": Function(2, 2, operator.mod),
        "round": Function(1, 1, _round),
    }
)
# Functions that jump at whole numbers. A model may use these names for its own quantities too, such as a force `floor`.
STAIRS = frozenset({"floor", "mod", "round"})
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})
TIME = "t"
RESERVED = (
    (frozenset(FUNCTIONS) - STAIRS)
    | frozenset(CONSTANTS)
    | {TIME, "True", "False", "and", "or", "not", "if", "else"}
)

# A name: an identifier, or the names of nested parts and an identifier with dots between them.
NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")


def is_name(text: str) -> bool:
    """Return whether a text is a single name, such as x or left.x."""
    return NAME.fullmatch(text) is not None


BINARY: Mapping[type[ast.operator], str] = MappingProxyType(
    {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
)
COMPARISONS: Mapping[type[ast.cmpop], str] = MappingProxyType(
    {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
)

# Largest number of characters and parts of an expression. It protects Python's parser against hostile files.
MAX_LENGTH = 2_000
# Largest depth of an expression. Tree walks are recursive; a sum of n terms has n levels.
MAX_DEPTH = 80
# Limits after substitutions (a law into a contact, a definition into another), which enlarge expressions.
MAX_DERIVED_DEPTH = 140
MAX_DERIVED_NODES = 20_000
# Largest constant exponent. x**64 covers the range of doubles for x in [1e-5, 1e5].
MAX_POWER = 64
# Integer values of an exponent parameter for which the power is computed by products, and is defined for bases <= 0.
# Up to three products cost as much as exp(p log u), which all other values use.
WHOLE_POWERS = range(-2, 5)
# Integers above this limit are not exact as doubles.
MAX_INTEGER = 2**53
