"""What an expression may contain: functions with their arity, constants, reserved names and bounds."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Function:
    """A function that expressions may call: its number of arguments and its value."""

    least: int
    most: int
    value: Callable[..., float]

    @property
    def arity(self) -> str:
        """How many arguments, for a message."""
        if self.most > self.least:
            return f"{self.least} to {self.most} arguments"
        return f"{self.least} argument" + ("s" if self.least > 1 else "")


_MOST = 64  # arguments of min and max: each is a level of what they are taken apart into


def _sign(x: float) -> float:
    return float((x > 0) - (x < 0))


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
        "min": Function(2, _MOST, min),
        "max": Function(2, _MOST, max),
    }
)
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})
TIME = "t"
RESERVED = (
    frozenset(FUNCTIONS) | frozenset(CONSTANTS) | {TIME, "True", "False", "and", "or", "not", "if", "else"}
)

BINARY: Mapping[type[ast.operator], str] = MappingProxyType(
    {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
)
COMPARISONS: Mapping[type[ast.cmpop], str] = MappingProxyType(
    {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
)

# What a person writes is far shorter; what a hostile file holds is cut off before Python's parser sees it.
MAX_LENGTH = 2_000
# The tree walks are recursive, up to five frames a level; a sum of n terms is n levels deep.
MAX_DEPTH = 80
# Substitution (a law into a contact, a definition into another) may multiply what was written.
MAX_DERIVED_DEPTH = 140
MAX_DERIVED_NODES = 20_000
# x**64 spans the doubles already for x in [1e-5, 1e5]; larger constant powers are slips or bombs.
MAX_POWER = 64
# Whole values of a parameter for which a power with it as exponent is a product, and has a value at 0 and below. Three
# products, as the dearest needs, cost as much as exp(p log u) does, which is there for all other values.
WHOLE_POWERS = range(-2, 5)
# Whole numbers above this are not exact as doubles.
MAX_INTEGER = 2**53
