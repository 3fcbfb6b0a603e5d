"""Putting expressions in the place of names changes the value as it should, and nothing else."""

from __future__ import annotations

import pytest
from expr.strategies import NAMES, expressions
from hypothesis import assume, given, reject
from hypothesis import strategies as st

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr import Expression, evaluate, parse, substitute
from hybridsim.expr.write import write

values = st.fixed_dictionaries({name: st.floats(-3, 3).map(lambda v: round(v, 3)) for name in NAMES})


def value_or_none(text: Expression, at: dict[str, float]) -> float | None:
    try:
        return evaluate(text, at)
    except ExpressionError:
        return None


def parsed(text: str) -> Expression:
    try:
        return parse(text)
    except ExpressionError:  # a constant part without a value, such as 1/0
        reject()


@given(expressions, expressions, values)
def test_substitution_is_evaluation_of_the_part_first(outer: str, inner: str, at: dict[str, float]) -> None:
    whole, part = parsed(outer), parsed(inner)
    at_part = value_or_none(part, at)
    assume(at_part is not None)
    try:
        joined = substitute(whole, {"x": part})
    except ExpressionError:
        assume(False)
    assert value_or_none(joined, at) == value_or_none(whole, {**at, "x": at_part})


@given(expressions, values)
def test_writing_and_parsing_again_changes_nothing(text: str, at: dict[str, float]) -> None:
    expr = parsed(text)
    again = parse(write(expr.tree))
    assert write(again.tree) == write(expr.tree)
    assert value_or_none(again, at) == value_or_none(expr, at)


@pytest.mark.parametrize(
    ("outer", "inner", "joined"),
    [
        ("2*x", "a + b", "2*(a + b)"),
        ("1/x", "a*b", "1/(a*b)"),
        ("a - x", "b - 1", "a - (b - 1)"),
        ("x**2", "-a", "(-a)**2"),
        ("-x", "a**2", "-a**2"),
        ("x**x", "a**b", "(a**b)**a**b"),
        ("x*2", "a if b > 0 else 1", "(a if b > 0 else 1)*2"),
        ("sin(x)", "a + b", "sin(a + b)"),
        ("x > 0 and not x > 2", "a + 1", "a + 1 > 0 and not a + 1 > 2"),
        ("a + b", "c", "a + b"),
    ],
)
def test_no_parenthesis_is_lost_or_idle(outer: str, inner: str, joined: str) -> None:
    assert substitute(parse(outer), {"x": parse(inner)}).text == joined


def test_all_names_at_once() -> None:
    assert substitute(parse("a - b"), {"a": "b", "b": "a"}).text == "b - a"


def test_the_place_stays() -> None:
    place = Place("scene.toml", 3)
    assert substitute(parse("x + 1", place), {"x": 2}).place == place


def test_bounds_hold_for_what_is_put_in() -> None:
    with pytest.raises(ExpressionError, match="too large; at most 64"):
        substitute(parse("a**x"), {"x": "9**9"})
    with pytest.raises(ExpressionError, match="division by zero"):
        substitute(parse("a/x"), {"x": "0", "a": 1})
    grown = parse("x + x*x")
    with pytest.raises(ExpressionError, match=r"too large|too deeply"):
        for _ in range(30):
            grown = substitute(grown, {"x": grown})


def test_a_condition_does_not_go_where_a_number_belongs() -> None:
    with pytest.raises(ExpressionError, match="must be a number, but is a condition"):
        substitute(parse("x + 1"), {"x": "a > 0"})


@pytest.mark.parametrize(
    ("text", "u", "written"),
    [
        ("exp(-u/v)", "-w", "exp(-(-w)/v)"),
        ("c*u", "-w", "c*(-w)"),
        ("c - u*d", "-w", "c - (-w*d)"),
        ("u*c", "-w", "-w*c"),
        ("c**u", "-2", "c**-2"),
    ],
)
def test_no_two_signs_meet(text: str, u: str, written: str) -> None:
    assert substitute(parse(text), {"u": parse(u)}).text == written
