"""Values of expressions, and of parameters that depend on one another."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr import evaluate, parse, resolve


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1/3", 1 / 3),
        ("2**-1", 0.5),
        ("-2**2", -4),
        ("2**3**2", 512),
        ("atan2(1, -1)", 3 * math.pi / 4),
        ("min(3, 1, 2) + max(4, 5)", 6),
        ("sign(-3) + sign(0) + sign(7)", 0),
        ("abs(-2.5)", 2.5),
        ("1 if 1 < 2 <= 2 else 0", 1),
        ("1 if not (1 > 2 or 2 > 3) and True else 0", 1),
        ("3 > 2", 1),
        ("pi", math.pi),
        ("1 if a == 2 else 5 if a != 3 else 7", 5),
    ],
)
def test_value(text: str, value: float) -> None:
    assert evaluate(parse(text), {"a": 4.0}) == value


@given(st.floats(0.1, 10), st.floats(0.1, 10))
def test_same_as_python(a: float, b: float) -> None:
    text = "a*sin(b)**2 - exp(-a/b) + sqrt(a)*log(b)/tanh(a)"
    assert evaluate(parse(text), {"a": a, "b": b}) == (
        a * math.sin(b) ** 2 - math.exp(-a / b) + math.sqrt(a) * math.log(b) / math.tanh(a)
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1/a", "division by zero"),
        ("sqrt(a - 1)", "not defined at (-1)"),
        ("log(a)", "not defined"),
        ("(a - 8)**(1/3)", "not defined"),
        ("exp(1000 + a)", "too large"),
        ("1e300*(a + 1e300)", "the result is inf"),
    ],
)
def test_no_value_names_expression_and_values(text: str, reason: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluate(parse(text, Place("m.toml", 4)), {"a": 0.0})
    assert text in str(caught.value)
    assert reason in caught.value.message
    assert "a = 0" in str(caught.value)
    assert str(caught.value).startswith("m.toml:4:")


def test_missing_name() -> None:
    with pytest.raises(ExpressionError, match="unknown name 'b'"):
        evaluate(parse("a + b"), {"a": 1.0})


def test_resolve_in_any_order() -> None:
    texts = {"omega": "0.6*sqrt(k/m)", "m": "0.2", "k": "1e5", "T": "2*pi/omega"}
    values = resolve({name: parse(text) for name, text in texts.items()})
    assert list(values) == list(texts)
    assert values["omega"] == 0.6 * math.sqrt(1e5 / 0.2)
    assert values["T"] == 2 * math.pi / values["omega"]


def test_a_circle_is_named() -> None:
    with pytest.raises(
        ExpressionError, match="cyclic dependency among parameters: b -> c -> a -> b"
    ) as caught:
        resolve({name: parse(text) for name, text in {"z": "b", "b": "c", "c": "2*a", "a": "b + 1"}.items()})
    assert caught.value.remedy
    with pytest.raises(ExpressionError, match="a -> a"):
        resolve({"a": parse("a")})


def test_a_long_chain_needs_no_stack() -> None:
    chain = {"p0": parse(1)} | {f"p{i}": parse(f"p{i - 1} + 1") for i in range(1, 3000)}
    assert resolve(dict(reversed(chain.items())))["p2999"] == 3000


def test_parameters_do_not_depend_on_time() -> None:
    with pytest.raises(ExpressionError, match="depends on time"):
        resolve({"a": parse("2*t")})


def test_unknown_parameter() -> None:
    with pytest.raises(ExpressionError, match="unknown name 'kk'"):
        resolve({"k": parse(1), "a": parse("kk")})
