"""What counts as equal, and as a positive multiple, by the form of an expression alone."""

from __future__ import annotations

import ast
from fractions import Fraction

import pytest
from expr.strategies import NAMES, expressions
from hypothesis import assume, given
from hypothesis import strategies as st

from hybridsim.errors import ExpressionError
from hybridsim.expr import Expression, evaluate, parse
from hybridsim.expr.polynomial import constant_of, difference, direction, polynomial

values = st.fixed_dictionaries({name: st.floats(0.1, 3).map(lambda v: round(v, 3)) for name in NAMES})


def tree(text: str) -> ast.expr:
    return parse(text).tree


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ("(a + b)*(a - b)", "a**2 - b**2"),
        ("2*a/4", "a*0.5"),
        ("-(a - b)", "b - a"),
        ("sin(a + b)", "sin(b + a)"),
        ("a/(b + c) + 1", "1 + a/(c + b)"),
        ("sin(b - b)*a + a", "a + 0"),
        ("a if 1 < 2 else b", "a"),
        ("max(1, 3)*a", "3*a"),
    ],
)
def test_equal_forms(a: str, b: str) -> None:
    assert difference(tree(a), tree(b)) == {}


@pytest.mark.parametrize(
    ("a", "b"), [("a*b", "a + b"), ("sin(a)", "sin(b)"), ("a/b", "b/a"), ("a**0.5", "a")]
)
def test_different_forms(a: str, b: str) -> None:
    assert difference(tree(a), tree(b)) != {}


@given(expressions, expressions, values)
def test_equal_polynomials_mean_equal_values(first: str, second: str, at: dict[str, float]) -> None:
    """(first + second)**2 against its expansion, for any two expressions, and whatever a difference of 0 says."""
    try:
        whole, parts = (
            parse(text)
            for text in (
                f"(({first}) + ({second}))*(({first}) + ({second}))",
                f"({first})*({first}) + 2*({first})*({second}) + ({second})*({second})",
            )
        )
        found = evaluate(whole, at), evaluate(parts, at)
    except ExpressionError:
        assume(False)
    assume(max(map(abs, found)) < 1e6)
    if difference(whole.tree, parts.tree) == {}:
        assert found[0] == pytest.approx(found[1], rel=1e-6, abs=1e-6)


def test_direction_takes_multiples_together() -> None:
    families = {text: direction(polynomial(tree(text))) for text in ("x - g", "2*x - 2*g", "g - x", "x + g")}
    assert families["x - g"] == families["2*x - 2*g"]
    assert families["g - x"] == (families["x - g"][0], -families["x - g"][1])
    assert families["x + g"][0] != families["x - g"][0]


def test_numbers_are_exact() -> None:
    assert constant_of(polynomial(tree("0.1 + 1/3"))) == Fraction(0.1) + Fraction(1, 3)
    assert constant_of(polynomial(tree("a"))) is None
    assert isinstance(parse("a"), Expression)
