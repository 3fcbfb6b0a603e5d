"""Arithmetic written down: done again with other numbers it gives what doing it directly gives, bit for bit."""

from __future__ import annotations

import random

import pytest
from engine.uncompiled import uncompiled

from hybridsim.engine.linear.recipe import Numbers, Recipe


def compute(a: float, b: float, c: float) -> list[float]:
    """Some arithmetic with both kinds of operands, and a decision."""
    total = 0.0 + a
    total = total * b - 2.5
    share = total / c if c != 0.0 else total * 3.0
    other = 1.0 - share
    return [total, share, -other, 4.0 / (other * other + 1.0), a if a == b else b]


def recipe_at(*inputs: float) -> tuple[Recipe, list[int]]:
    numbers = Numbers(inputs)
    places = [numbers.place(value) for value in compute(*numbers.inputs)]
    return Recipe(numbers), places


def test_the_same_arithmetic() -> None:
    recipe, places = recipe_at(0.3, -0.7, 2.0)
    draw = random.Random(0)
    for _ in range(200):
        inputs = [draw.uniform(-1, 1) * 10.0 ** draw.randint(-9, 9) for _ in range(3)]
        registers = recipe.values(inputs)
        assert registers is not None
        assert registers[places].tolist() == compute(*inputs)


@pytest.mark.parametrize("inputs", [(0.3, -0.7, 0.0), (0.3, 0.3, 2.0)])
def test_another_decision_is_another_recipe(inputs: tuple[float, float, float]) -> None:
    recipe, _ = recipe_at(0.3, -0.7, 2.0)
    assert recipe.values(inputs) is None
    recipe, places = recipe_at(*inputs)
    registers = recipe.values(inputs)
    assert registers is not None
    assert registers[places].tolist() == compute(*inputs)


def test_no_decision_goes_unnoticed() -> None:
    a, b = Numbers([1.0, 2.0]).inputs
    for decide in (lambda: a < b, lambda: bool(a), lambda: a >= 1.0, lambda: max(a, b)):
        with pytest.raises(TypeError):
            decide()


def test_what_is_no_number_is_no_warning_where_nothing_is_compiled() -> None:
    """As in compiled code: 0/0 is told by its value."""
    code = """
import math, warnings
warnings.simplefilter("error")
from hybridsim.engine.linear.recipe import computed
from hybridsim.engine.series.operations import DIV
print(math.isnan(computed(DIV, (0.0, 0.0), 0, 0)[0]), computed(DIV, (1.0, 0.0), 0, 0)[0])
"""
    assert uncompiled(code).split() == ["True", "inf"]
