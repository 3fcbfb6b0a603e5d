"""The work of checking many equal parts grows in proportion to their number."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.expr import walk
from hybridsim.model.checks.doubtful import warnings_of
from hybridsim.model.checks.starting_facts import starting_facts
from hybridsim.model.smoothing import one_sided

BLOCK = """schema = 1
name = "block"
[inputs]
left.kind = "connected"
right.kind = "connected"
[states]
x = { start = 0.25, der = "v + h" }
v = { start = 0.5, der = "left + right - 3*x - f" }
[contacts.f]
velocity = "v - 1"
normal = 1
law = { name = "coulomb", mu = 1 }
[components.c.modes.low]
initial = true
set.h = 0
guards.up = { expr = "1 - x", then = { to = "high" } }
[components.c.modes.high]
set.h = "x"
guards.down = { expr = "x", then = { to = "low" } }
"""


def chain(n: int) -> hs.Model:
    """Return a ring of equal parts with a contact and two modes."""
    block = hs.Model.from_toml(BLOCK, "block.toml")
    connect = {"left": f"block[i-1 if i > 1 else {n}].x", "right": f"block[i+1 if i < {n} else 1].x"}
    return hs.Model("chain", use=[hs.Use("block", block, repeat=n, connect=connect)])


def evaluations(n: int, monkeypatch: pytest.MonkeyPatch) -> int:
    """Return how many nodes of expressions are evaluated in a check of n parts."""
    model, count = chain(n), 0

    def counted(node: Any, values: Any) -> Any:
        nonlocal count
        count += 1
        return plain(node, values)

    plain = walk.value_of
    with monkeypatch.context() as patch:
        for module in (walk, one_sided, import_module("hybridsim.expr.evaluate")):
            patch.setattr(module, "value_of", counted)
        assert warnings_of(model) == ()
        starting_facts(model)
    return count


def test_the_work_is_in_proportion_to_the_number_of_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    few, many = evaluations(10, monkeypatch), evaluations(40, monkeypatch)
    assert few > 10
    assert many < 5 * few  # work in proportion to the square would be 16 times as much


def test_a_variable_of_a_mode_decides_whether_a_state_moves_in_it() -> None:
    """In the mode low the rate h of x is zero, so that a guard of x is constant there, and not in the mode high."""
    text = BLOCK.replace('der = "v + h"', 'der = "h"').replace("left + right", "0")
    text = text.replace('left.kind = "connected"\nright.kind = "connected"\n', "").replace("[inputs]\n", "")
    found = [caution.message for caution in warnings_of(hs.Model.from_toml(text, "one.toml"))]
    assert len(found) == 1
    assert found[0].startswith("guard up of mode low, component c: '1 - x' is constant in this mode")
