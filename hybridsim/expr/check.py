"""The whitelist of expressions: check a syntax tree and collect its names."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable

from hybridsim.errors import ExpressionError, Place, nearest
from hybridsim.expr.grammar import (
    BINARY,
    COMPARISONS,
    CONSTANTS,
    FUNCTIONS,
    MAX_INTEGER,
    MAX_POWER,
    RESERVED,
    STAIRS,
)
from hybridsim.expr.walk import NoValue, value_of

_KINDS = {
    ast.Attribute: "access to attributes (a dot after something that is not a name)",
    ast.Lambda: "a lambda",
    ast.Tuple: "a tuple (a comma outside a call)",
    ast.Starred: "an unpacking with *",
    ast.NamedExpr: "an assignment",
    ast.GeneratorExp: "a generator",
    ast.Await: "await",
    ast.Yield: "yield",
    ast.YieldFrom: "yield",
    ast.Subscript: "a subscript",
}

_DOTS = "a dot stands between the name of a part and the name of its quantity, such as left.x"


# What to write instead of calls that are no functions of expressions.
_INSTEAD = {
    "v_rel": "v_rel exists only in results; write the velocity of the contact, or a definition of it",
    "ceil": "write -floor(-x) for ceil(x)",
    "delay": "declare an element of kind 'delay'",
}


class _Checker:
    """Checks one syntax tree: `number` and `truth` check that a node has the right kind of value."""

    def __init__(self, text: str, place: Place, columns: bool) -> None:
        self.text = text
        self.place = place
        self.columns = columns
        self.names: set[str] = set()

    def fail(self, node: ast.AST, message: str, remedy: str) -> ExpressionError:
        column = getattr(node, "col_offset", None) if self.columns else None
        return ExpressionError(message, place=self.place.at(self.text, column), remedy=remedy)

    def number(self, node: ast.expr) -> bool:
        """Check a node whose value must be a number, and return whether it is constant."""
        constant, boolean = self.any(node)
        if boolean:
            raise self.fail(node, "this part must be a number, but is a condition", "write '1 if ... else 0'")
        return constant

    def truth(self, node: ast.expr) -> bool:
        """Check a node whose value must be true or false, and return whether it is constant."""
        constant, boolean = self.any(node)
        if not boolean:
            raise self.fail(
                node,
                "this part must be a condition, but is a number",
                "write a comparison, such as 'x > 0'",
            )
        return constant

    def every(self, check: Callable[[ast.expr], bool], nodes: Iterable[ast.expr]) -> bool:
        """Check all nodes, and return whether they are all constant."""
        constant = True
        for node in nodes:
            constant = check(node) and constant
        return constant

    def any(self, node: ast.expr) -> tuple[bool, bool]:
        """Check a node, and return whether it is constant and whether it is a condition."""
        constant, boolean = self.kind(node)
        if constant and not isinstance(node, ast.Constant):
            try:
                value_of(node, {})
            except NoValue as fault:
                raise self.fail(
                    fault.node,
                    f"the constant has no finite real value: {fault.reason}",
                    "correct the numbers",
                ) from None
        return constant, boolean

    def kind(self, node: ast.expr) -> tuple[bool, bool]:
        match node:
            case ast.Constant():
                return True, self.literal(node)
            case ast.Name(id=name):
                return self.name(node, name), False
            case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
                return self.number(operand), False
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self.truth(operand), True
            case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
                base, other = self.number(left), self.number(right)
                if isinstance(op, ast.Pow) and other:
                    self.power(node, left, right, base)
                return base and other, False
            case ast.BoolOp(values=values):
                return self.every(self.truth, values), True
            case ast.Compare(left=left, ops=ops, comparators=others) if all(
                type(op) in COMPARISONS for op in ops
            ):
                return self.every(self.number, (left, *others)), True
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.conditional(test, body, orelse)
            case ast.Call():
                return self.call(node), False
        operation = _KINDS.get(type(node), "this operation")
        raise self.fail(
            node,
            f"{operation} is not allowed in an expression",
            "use numbers, names, + - * / **, comparisons, and/or/not, 'a if c else b' and functions",
        )

    def literal(self, node: ast.Constant) -> bool:
        value = node.value
        if isinstance(value, bool):
            return True
        if isinstance(value, int):
            if value > MAX_INTEGER:
                raise self.fail(
                    node, "the integer is too large for a double", "write a decimal, such as 1e20"
                )
        elif not isinstance(value, float):
            raise self.fail(node, f"{type(value).__name__} values are not allowed", "write a real number")
        elif not math.isfinite(value):
            raise self.fail(node, "the number is too large for a double", "use a number below 1.8e308")
        return False

    def name(self, node: ast.expr, name: str) -> bool:
        if name in CONSTANTS:
            return True
        if name in FUNCTIONS and name not in STAIRS:
            raise self.fail(
                node, f"the function '{name}' has no arguments here", f"write {name}(...) with arguments"
            )
        if "." in name and not RESERVED.isdisjoint(name.split(".")):
            word = next(word for word in name.split(".") if word in RESERVED)
            raise self.fail(node, f"the name '{name}' contains the reserved word '{word}'", _DOTS)
        if name.startswith("__") or ".__" in name:
            raise self.fail(
                node,
                f"the name '{name}' is not allowed",
                "use a name that does not start with two underscores",
            )
        self.names.add(name)
        return False

    def power(self, node: ast.expr, base: ast.expr, exponent: ast.expr, constant_base: bool) -> None:
        try:
            value = float(value_of(exponent, {}))
        except NoValue as fault:
            raise self.fail(
                node, f"the exponent has no finite value: {fault.reason}", "correct the exponent"
            ) from None
        if abs(value) > MAX_POWER:
            raise self.fail(
                exponent,
                f"the exponent {value:g} is too large; at most {MAX_POWER} is allowed",
                "write large constants as decimals (1e-12), and fast decay as exp(...)",
            )
        if constant_base:
            self.underflow(node, base)

    def underflow(self, node: ast.expr, base: ast.expr) -> None:
        try:
            vanished = value_of(node, {}) == 0 and value_of(base, {}) != 0
        except NoValue as fault:
            raise self.fail(
                fault.node, f"the constant has no finite real value: {fault.reason}", "correct the numbers"
            ) from None
        if vanished:
            raise self.fail(node, "the power is too small for a double", "write 0, or use other units")

    def conditional(self, test: ast.expr, body: ast.expr, orelse: ast.expr) -> tuple[bool, bool]:
        constant = self.truth(test)
        (first, boolean), (second, other) = self.any(body), self.any(orelse)
        if boolean != other:
            raise self.fail(
                orelse,
                "one branch of 'a if c else b' is a number, and the other branch is a condition",
                "write numbers in both branches",
            )
        return constant and first and second, boolean

    def call(self, node: ast.Call) -> bool:
        if not isinstance(node.func, ast.Name):
            raise self.fail(node, "only functions can be called", _functions())
        name = node.func.id
        function = FUNCTIONS.get(name)
        if function is None:
            hint = _INSTEAD.get(name) or nearest(name, FUNCTIONS, kind="functions")
            raise self.fail(node, f"unknown function '{name}'", hint)
        if node.keywords:
            raise self.fail(
                node, f"{name}() has no keyword arguments", f"pass {function.arity}, without names"
            )
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                raise self.fail(
                    argument, "an unpacking with * is not allowed", "write the arguments one by one"
                )
        count = len(node.args)
        if not function.least <= count <= function.most:
            raise self.fail(
                node,
                f"{name}() needs {function.arity}, but was called with {count}",
                "correct the number of arguments",
            )
        return self.every(self.number, node.args)


def check_size(tree: ast.expr, expr: str, place: Place, max_depth: int, max_nodes: int) -> None:
    """Reject a tree that is too deep or too large; ``expr`` is the text that the message shows."""
    level: list[ast.AST] = [tree]
    depth = nodes = 0
    while level:
        depth, nodes = depth + 1, nodes + len(level)
        if depth > max_depth or nodes > max_nodes:
            fault = "nested too deeply" if depth > max_depth else "too large"
            raise ExpressionError(
                f"the expression is {fault} (at most {max_depth} levels and {max_nodes} parts are allowed)",
                place=place.at(expr),
                remedy="move parts of the expression to [definitions], or group a long sum: (a + b + "
                "...) + (c + ...)",
            )
        level = [
            child
            for node in level
            for child in ast.iter_child_nodes(node)
            if isinstance(child, (ast.expr, ast.keyword, ast.comprehension))
        ]


def check_tree(tree: ast.expr, text: str, place: Place, *, columns: bool = True) -> frozenset[str]:
    """Return the names on which a tree depends; reject a tree that is not whitelisted.

    ``columns`` is False if the columns of the nodes are not offsets into ``text``, as after a substitution.
    """
    checker = _Checker(text, place, columns)
    checker.any(tree)
    return frozenset(checker.names)


def _functions() -> str:
    return "functions: " + ", ".join(FUNCTIONS)
