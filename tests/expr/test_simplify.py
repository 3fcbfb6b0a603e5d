"""Long formulas are soon ready, and mean what they meant: against differences and closed forms."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import sympy

from hybridsim.expr import evaluate, parse
from hybridsim.expr.simplify import factor_between, simplified, terms_of
from hybridsim.expr.symbolic import derivative, to_sympy

SYMBOLS = {name: sympy.Symbol(name, real=True) for name in "abuvwx"}
POINT = {"a": 0.31, "b": -0.42, "u": 0.23, "v": 0.57, "w": -0.14, "x": 0.71}
PRODUCT = (
    "(x + v + 1.5*w + 0.25)*(v + w + 0.5 + x*v)*(x + v + w + 3)*(v + 0.75 + w*w + x)*(x + 2*w + v + 1.25)"
)
# an arc sine in a root in a hyperbolic tangent: SymPy's own take minutes to differentiate it
LONG = f"tanh(sqrt(2 + asin(0.001*tanh(sqrt(1 + asin(0.01*{PRODUCT}))*(x + v + 1))*(x + 2)*(v + 3))))*(v + w)"


@contextmanager
def few_calls() -> Iterator[None]:
    """Fail beyond twenty million calls: these take up to 1.6 million, and SymPy's own functions minutes for some."""
    calls = itertools.count()

    def count(frame: object, event: str, argument: object) -> None:
        if event == "call" and next(calls) > 20_000_000:
            raise AssertionError("more than twenty million calls")

    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(None)


def form(text: str) -> sympy.Expr:
    return to_sympy(parse(text), SYMBOLS)


def value(e: sympy.Expr) -> float:
    return float(e.subs({SYMBOLS[n]: sympy.Float(v, 30) for n, v in POINT.items()}).evalf(25))


def test_the_derivative_of_a_long_formula_is_soon_there() -> None:
    e = form(LONG)
    with few_calls():
        slope = derivative(e, SYMBOLS["v"])
    h = 2.0**-10  # six points: an error of h^6, 1e-18, against rounding of 1e-16/h
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    at = {k: evaluate(parse(LONG), POINT | {"v": POINT["v"] + k * h}) for k in range(-3, 4)}
    assert math.isclose(
        value(slope), sum(c * (at[k] - at[-k]) for k, c in weights.items()) / h, rel_tol=1e-11
    )


@pytest.mark.parametrize(
    ("text", "slope"),
    [
        ("sinh(sqrt(v))", "cosh(sqrt(v))/(2*sqrt(v))"),
        ("cosh(sqrt(v))", "sinh(sqrt(v))/(2*sqrt(v))"),
        ("tanh(sqrt(v))", "(1 - tanh(sqrt(v))**2)/(2*sqrt(v))"),
    ],
)
def test_hyperbolic_functions_of_what_may_have_no_value(text: str, slope: str) -> None:
    e = form(text)
    assert e.is_real
    assert math.isclose(value(derivative(e, SYMBOLS["v"])), evaluate(parse(slope), POINT), rel_tol=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "a*(b + v) - a*b - v*a",
        "sin(a*b + v)**2 + cos(v + b*a)**2 - 1",
        "exp(a*(b + v)) - exp(a*b + a*v)",
        # beyond what is simplified by identities
        "(a + b)*(u + v)*(w + x + 1)*(a + 2) - (a*u + a*v + b*u + b*v)*(a*w + a*x + a + 2*w + 2*x + 2)",
        f"a*tanh({LONG}) - tanh({LONG})*a",
    ],
)
def test_zero_is_seen(text: str) -> None:
    assert simplified(form(text)) == 0


@pytest.mark.parametrize("text", [LONG, PRODUCT, f"({PRODUCT})*asin({PRODUCT}/1000)", "a*v/(a*u + a*v*v)"])
def test_the_value_stays_and_the_form_grows_no_longer(text: str) -> None:
    e = form(text)
    with few_calls():
        found = simplified(e)
    assert math.isclose(value(found), value(e), rel_tol=1e-15)
    assert found.count_ops() <= e.count_ops()


def test_terms_are_counted_as_if_products_were_written_out() -> None:
    e = form("(a + b + 1)*(u + v)**2*(w + x)")
    assert terms_of(e) == 3 * 2**2 * 2
    assert terms_of(e) >= len(sympy.expand(e).args)
    assert terms_of(form("a/(b + u)")) == 2


@pytest.mark.parametrize(
    ("one", "factor"),
    [
        ("v - a*w", 1.0),
        ("a*w - v", -1.0),
        ("-2.5*(v - a*w)", -2.5),
        ("a*(v/a - w)", 1.0),
        ("v + a*w", None),
        ("v", None),
        ("u*(v - a*w)", None),
        ("(v - a*w)**2", None),
        ("0*v", None),
        ("3", None),
    ],
)
def test_the_factor_between_two_expressions_is_a_number(one: str, factor: float | None) -> None:
    assert factor_between(to_sympy(parse(one), SYMBOLS), to_sympy(parse("v - a*w"), SYMBOLS)) == factor


def test_the_factor_between_nonlinear_expressions() -> None:
    one, other = (to_sympy(parse(text), SYMBOLS) for text in ("3*sin(v)*x - 3*a", "x*sin(v) - a"))
    assert factor_between(one, other) == 3.0
