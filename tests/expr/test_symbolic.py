"""The symbolic form has the value of the expression: SymPy in many digits against our walk in doubles."""

from __future__ import annotations

import math

import pytest
import sympy
from expr.strategies import NAMES, tame
from hypothesis import given

from hybridsim.errors import ExpressionError
from hybridsim.expr import evaluate, parse
from hybridsim.expr.symbolic import to_sympy

SYMBOLS = {name: sympy.Symbol(name, real=True) for name in NAMES}
# Away from 0, from each other and from what they are compared with, so that no choice hangs on a rounding.
POINT = {"a": 0.7310586, "b": -0.4142135, "x": 0.9360679, "omega": 0.5772156, "t": -0.3010299}


@given(tame)
def test_same_value_as_the_walk(text: str) -> None:
    expr = parse(text)
    form = to_sympy(expr, SYMBOLS)
    exact = form.subs({SYMBOLS[name]: sympy.Float(value, precision=53) for name, value in POINT.items()})
    # Some tens of roundings, each of 1e-16, amplified by factors of order one.
    assert math.isclose(float(exact.evalf(30)), evaluate(expr, POINT), rel_tol=1e-11, abs_tol=1e-11)


def test_whole_numbers_are_exact_and_decimals_are_the_double() -> None:
    third = to_sympy(parse("1/3"), {})
    assert third == sympy.Rational(1, 3)
    tenth = to_sympy(parse("0.1"), {})
    assert sympy.Rational(tenth) == sympy.Rational(*(0.1).as_integer_ratio())
    assert to_sympy(parse("x**2.0"), SYMBOLS) == SYMBOLS["x"] ** 2


def test_forms() -> None:
    x, a = SYMBOLS["x"], SYMBOLS["a"]
    assert to_sympy(parse("abs(x)"), SYMBOLS) == sympy.Abs(x)
    assert to_sympy(parse("max(x, a, 0)"), SYMBOLS) == sympy.Max(x, a, 0)
    assert to_sympy(parse("sign(x)"), SYMBOLS) == sympy.sign(x)
    assert to_sympy(parse("a if x > 0 else -a"), SYMBOLS) == sympy.Piecewise((a, x > 0), (-a, True))
    assert to_sympy(parse("0 < x <= a"), SYMBOLS) == sympy.And(sympy.Lt(0, x), sympy.Le(x, a))
    assert to_sympy(parse("not x > 0 or True"), SYMBOLS) == sympy.true
    assert to_sympy(parse("x == a"), SYMBOLS) == sympy.Eq(x, a)
    assert to_sympy(parse("atan2(x, 1)*pi"), SYMBOLS) == sympy.atan2(x, 1) * sympy.pi


def test_a_linear_equation_can_be_solved_in_the_form() -> None:
    """What the engine does with a stick force."""
    names = {
        name: sympy.Symbol(name, real=True) for name in ("F0", "omega", "t", "c", "v", "k", "x", "f", "m")
    }
    rate = to_sympy(parse("(F0*sin(omega*t) - c*v - k*x - f)/m"), names)
    (force,) = sympy.solve(rate, names["f"])
    assert force == to_sympy(parse("F0*sin(omega*t) - c*v - k*x"), names)


def test_a_name_without_symbol() -> None:
    with pytest.raises(ExpressionError, match="unknown name 'q'"):
        to_sympy(parse("q + x"), SYMBOLS)


def test_powers_of_constants_do_not_grow() -> None:
    """(10/9)**60 and the like would be exact fractions of ever more digits; they are doubles."""
    expr = parse("(((10/9)**60/557)**60)**60*x")
    form = to_sympy(expr, SYMBOLS)
    assert len(str(form)) < 60


def test_an_exponent_with_a_number_stays_whole() -> None:
    """exp(2000) is no double, and exp(2000 - 1000*x) is 1 at x = 2."""
    form = to_sympy(parse("0.3*exp(-(x - 2.0)/0.001) + 1/exp(x + 900)"), SYMBOLS)
    slope = sympy.diff(form, SYMBOLS["x"], 2)
    for e in (form, slope):
        assert max(abs(float(number)) for number in e.atoms(sympy.Number)) <= 1e6
    assert float(form.subs(SYMBOLS["x"], 2)) == pytest.approx(0.3)
