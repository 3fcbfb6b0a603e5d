"""What is an expression and what is not, and what is said about the latter."""

from __future__ import annotations

import ast
import math
import pickle
import sys

import pytest
from expr.strategies import expressions, scraps
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr import Expression, evaluate, parse, require_names
from hybridsim.expr.grammar import FUNCTIONS

ALLOWED_NODES = (
    ast.Constant, ast.Name, ast.UnaryOp, ast.BinOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Call, ast.Load,
    ast.operator, ast.unaryop, ast.boolop, ast.cmpop,
)  # fmt: skip

# text -> what the message must hold
REFUSED = {
    "": "empty",
    "   ": "empty",
    "sin(x).y": "attributes",
    "x.__class__.__mro__": "'x.__class__.__mro__' is not allowed",
    "sin.x": "the reserved word 'sin'",
    "x.t": "the reserved word 't'",
    "x.y(1)": "unknown function 'x.y'",
    "().__class__": "attributes",
    "(1).real": "attributes",
    "__import__(x)": "__import__",
    "eval(x)": "'eval'",
    "open(x)": "'open'",
    "x(1)": "'x'",
    "sin(x)(1)": "only functions can",
    "(sin if x > 0 else cos)(x)": "only functions can",
    "'text'": "'",
    'f"{x}"': "character",
    "x[0]": "[",
    "[x]": "[",
    "{x}": "{",
    "(x, y)": "tuple",
    "x, y": "tuple",
    "(lambda: x)": ":",
    "lambda x: x": ":",
    "(y := x)": ":",
    "x = 1": "invalid expression",
    "x; y": ";",
    "x # y": "#",
    "[y for y in x]": "[",
    "(y for y in x)": "generator",
    "min(y for y in x)": "2 to 64",
    "min(*x)": "unpacking",
    "sin(**x)": "keyword",
    "sin(x=1)": "keyword",
    "sin()": "1 argument",
    "sin(x, y)": "1 argument, but was called with 2",
    "min(x)": "2 to 64",
    "atan2(x)": "2 arguments",
    "sin": "function",
    "sin + 1": "function",
    "x^2": "**",
    "x % 2": "remainder",
    "x // 2": "not allowed",
    "x @ y": "@",
    "x & y": "and",
    "x | y": "or",
    "~x": "not",
    "x in y": "not allowed",
    "x is y": "not allowed",
    "None": "NoneType",
    "...": "ellipsis",
    "1j": "complex",
    "1e999": "too large",
    "-1e999": "too large",
    "9" * 400: "too large",
    "9007199254740993": "too large for a double",
    "9**9**9": "too large; at most 64",
    "x**1000": "too large; at most 64",
    "x**-1000": "too large; at most 64",
    "x**(2**40)": "too large; at most 64",
    "(10.0**60)**60": "no finite real value",
    "((0.1**60)**60)": "too small",
    "1/0": "division by zero",
    "x + 1/(2 - 2)": "division by zero",
    "sqrt(-1)": "not defined at (-1)",
    "(-8)**(1/3)": "not defined",
    "log(0)": "not defined",
    "exp(1000)": "too large",
    "sin(x > 0)": "must be a number, but is a condition",
    "(x > 0) + 1": "must be a number, but is a condition",
    "x and y": "must be a condition, but is a number",
    "not x": "must be a condition, but is a number",
    "1 if x else 2": "must be a condition, but is a number",
    "x > 0 if y > 0 else 1": "one branch",
    "(x > 0) > 0": "must be a number, but is a condition",
    "__x": "two underscores",
    "ω*t": "the Greek letter",
    "x\0y": "U+0000",
    "x y": "invalid expression",
    "x +": "invalid expression",
    "(x": "invalid expression",
    "007": "invalid expression",
    "yield x": "invalid expression",
    "await x": "await",
    "x" * 2001: "2001 characters",
    "(" * 150 + "x" + ")" * 150 + "+(" * 60: "",
    "-" * 1500 + "x": "nested",
    "+".join("x" * 500): "nested",
    "sin(" * 100 + "x" + ")" * 100: "nested",
    "(" * 900 + "x" + ")" * 900: "nested",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: ascii(text[:25]))
def test_refused_with_place_and_remedy(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text, Place("scene.toml", 7))
    error = caught.value
    assert REFUSED[text] in f"{error.message} {error.remedy}"
    assert error.remedy
    assert str(error).startswith("scene.toml:7: ")
    assert error.exit_code == 3
    assert len(str(error)) < 600


@pytest.mark.parametrize(
    "value",
    [math.nan, math.inf, -math.inf, 10**400, None, [1], {"a": 1}, b"x", print, 1j],
    ids=lambda v: repr(v)[:20],
)
def test_values_that_are_no_expressions(value: object) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(value)
    assert caught.value.remedy


@given(st.one_of(scraps, st.text(max_size=60), expressions.map(lambda text: text.replace("(", "", 1))))
def test_any_text_is_an_expression_or_an_expression_error(text: str) -> None:
    try:
        expr = parse(text)
    except ExpressionError as error:
        assert error.remedy and str(error)
    else:
        assert all(isinstance(node, ALLOWED_NODES) for node in ast.walk(expr.tree))
        called = {node.func.id for node in ast.walk(expr.tree) if isinstance(node, ast.Call)}
        assert called <= FUNCTIONS.keys()


def test_deep_nesting_is_refused_whatever_the_depth_of_the_stack() -> None:
    """The parser and the walk may run out of stack; that is an error of the expression like any other."""

    def at_depth(levels: int) -> None:
        if levels:
            return at_depth(levels - 1)
        with pytest.raises(ExpressionError, match="nested"):
            parse("sin(" * 70 + "x" + ")" * 70)

    room = 120  # frames left: enough to fail in an orderly way, too few to walk 70 levels
    used = len(_stack())
    at_depth(sys.getrecursionlimit() - used - room)


def _stack() -> list[object]:
    frames = []
    frame = sys._getframe()
    while frame is not None:
        frames.append(frame)
        frame = frame.f_back
    return frames


@pytest.mark.parametrize("blank", ["\n", "\t", "\r\n", "   "])
def test_an_expression_may_run_over_lines(blank: str) -> None:
    assert parse(f"a +{blank}b").names == {"a", "b"}


@pytest.mark.parametrize(
    ("value", "text"),
    [(3, "3"), (-3, "-3"), (0.1, "0.1"), (1e5, "100000.0"), (True, "True"), (2**60, repr(float(2**60)))],
)
def test_numbers_are_expressions(value: float, text: str) -> None:
    assert parse(value).text == text
    assert parse(value).is_constant


def test_names_are_what_it_depends_on() -> None:
    expr = parse("a*sin(omega*t) + pi - min(b, 2)")
    assert expr.names == {"a", "omega", "t", "b"}


@pytest.mark.parametrize(
    ("text", "boolean"),
    [
        ("x > 0", True),
        ("not (x > 0)", True),
        ("x > 0 and a < b or b == 2", True),
        ("True", True),
        ("x > 0 if a > 0 else a < 3", True),
        ("x if a > 0 else 3", False),
        ("-x", False),
        ("max(x, 0)", False),
    ],
)
def test_conditions_are_told_from_numbers(text: str, boolean: bool) -> None:
    assert parse(text).is_boolean is boolean


def test_equal_by_text_wherever_written() -> None:
    here, there = parse("k*x", Place("a.toml", 1)), parse("  k*x ", Place("b.toml", 2))
    assert here == there and hash(here) == hash(there)
    assert here != parse("x*k")
    assert parse(here) is here
    assert pickle.loads(pickle.dumps(here)) == here


def test_unknown_name_points_at_it_and_suggests() -> None:
    expr = parse("F0*sin(omga*t)", Place("dfcs.toml", 20))
    with pytest.raises(ExpressionError) as caught:
        require_names(expr, {"F0", "omega", "t"})
    assert str(caught.value).splitlines() == [
        "dfcs.toml:20: unknown name 'omga'",
        "    F0*sin(omga*t)",
        "           ^",
        "did you mean 'omega'?",
    ]
    require_names(expr, {"F0", "omga", "t", "more"})


def test_a_name_may_have_dots_between_its_words() -> None:
    expr = parse("left.x**2 - sin(left . hub.v)/2.0")
    assert expr.names == {"left.x", "left.hub.v"}
    assert evaluate(expr, {"left.x": 3.0, "left.hub.v": 0.0}) == 9.0
    with pytest.raises(ExpressionError, match=r"unknown name 'left\.v'") as caught:
        require_names(parse("1 + left.v"), {"left.x", "t"})
    assert caught.value.place is not None and caught.value.place.column == 4


def test_a_long_line_is_cut_around_the_caret() -> None:
    with pytest.raises(ExpressionError) as caught:
        parse("a * " * 30 + "b[c]" + " * d" * 30, Place("m.toml", 1))
    _, shown, caret, _ = str(caught.value).splitlines()
    assert len(shown) < 120
    assert shown[caret.index("^")] == "["


def test_a_file_cannot_steer_the_terminal() -> None:
    with pytest.raises(ExpressionError) as caught:
        parse("x\x1b[2J\x9b31m")
    assert str(caught.value).replace("\n", "").isprintable()


def test_an_expression_is_frozen() -> None:
    expr = parse("x")
    with pytest.raises(AttributeError):
        expr.text = "y"
    assert isinstance(expr, Expression)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("ceil(x)", "-floor(-x)"),
        ("delay(x, 1)", "'delay'"),
    ],
)
def test_a_function_of_other_tools_is_answered_with_the_way_round(text: str, remedy: str) -> None:
    with pytest.raises(ExpressionError, match="unknown function") as caught:
        parse(text)
    assert remedy in (caught.value.remedy or "")
