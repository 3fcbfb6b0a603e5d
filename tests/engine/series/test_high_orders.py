"""Rows for high orders: the same coefficients as by the optimised tape, along shorter chains."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.series.high_orders import (
    FACTOR,
    HAS_B,
    HAS_C,
    INTEGRATE,
    NEGATIVE,
    OVER_B,
    OVER_C,
    RECIPROCAL,
    high_rows,
)
from hybridsim.engine.series.interpreter import expand
from hybridsim.engine.series.operations import ADD, ADD_CONSTANT, DIV, DIVIDE_BY, EXP, MUL, NEG, SCALE, SUB
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.series_at import SeriesRun
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

SCENES = ("dfcs", "dfcs-stribeck", "belt", "square-wave", "bouncing-ball", "clutches", "static-kinetic")
X, V, B, C = 0, 1, 2, 3  # states and constants


@pytest.mark.parametrize("name", SCENES)
def test_coefficients_are_those_of_the_optimised_tape(name: str) -> None:
    system = System(hs.load(name))
    p = system.vector(Instant(0.3), system.discrete_start)
    x = 0.5 + 0.3 * np.sin(np.arange(1.0, 1.0 + system.n))
    for mode in range(max(len(a.modes) for a in system.automata)):
        z = np.array([min(mode, len(a.modes) - 1) for a in system.automata], dtype=np.int64)
        run = SeriesRun(system, p, z, Tolerances(1e-9, np.zeros(system.n)))
        short, plain = run.V.copy(), run.V.copy()
        expand(run.optimised.rows, run.high, run.flow_registers, run.order, 0.1, x, short)
        expand(run.optimised.rows, run.high[:0], run.flow_registers, run.order, 0.1, x, plain)
        for registers in (run.states, run.monitored_registers):
            np.testing.assert_array_equal(short[registers, :5], plain[registers, :5])
            np.testing.assert_allclose(short[registers], plain[registers], rtol=1e-12, atol=0.0)


def test_constants_and_signs_are_one_factor() -> None:
    rows = [
        (MUL, V, V, 0, 10),
        (NEG, 10, 0, 0, 11),
        (DIVIDE_BY, 11, B, 0, 12),
        (EXP, 12, 0, 0, 13),
        (ADD_CONSTANT, 13, C, 0, 14),
        (SCALE, 14, B, 0, 15),
        (SCALE, 15, C, 0, 16),
    ]
    assert high_rows(rows, [X, V], [V, 16], []) == [
        (MUL, V, V, 0, 10),
        (FACTOR + NEGATIVE + HAS_B + OVER_B, 10, B, 0, 12),
        (EXP, 12, 0, 0, 13),
        (INTEGRATE, V, 0, 0, X),
        (INTEGRATE + HAS_B + HAS_C, 13, B, C, V),
    ]


def test_a_constant_over_what_changes_is_worked_out_from_what_that_is_a_multiple_of() -> None:
    rows = [
        (NEG, V, 0, 0, 10),
        (DIVIDE_BY, 10, B, 0, 11),
        (ADD_CONSTANT, 11, C, 0, 12),
        (DIV, C, 12, 0, 13),
        (DIV, X, 12, 0, 14),
        (ADD, 13, 14, 0, 15),
    ]
    assert high_rows(rows, [X, V], [V, 15], []) == [
        (FACTOR + NEGATIVE + HAS_B + OVER_B, V, B, 0, 12),
        (RECIPROCAL + NEGATIVE + HAS_C + OVER_C, V, 12, B, 13),
        (DIV, X, 12, 0, 14),
        (ADD, 13, 14, 0, 15),
        (INTEGRATE, V, 0, 0, X),
        (INTEGRATE, 15, 0, 0, V),
    ]


def test_what_comes_last_is_added_last() -> None:
    """exp(v) + b x - c v: the exponential is late, the product of the state that comes first is early."""
    rows = [
        (EXP, V, 0, 0, 10),
        (SCALE, X, B, 0, 11),
        (ADD, 10, 11, 0, 12),
        (SCALE, V, C, 0, 13),
        (SUB, 12, 13, 0, 14),
    ]
    assert high_rows(rows, [X, V], [V, 14], [])[3:] == [
        (SUB, 11, 13, 0, 12),
        (ADD, 12, 10, 0, 14),
        (INTEGRATE, V, 0, 0, X),
        (INTEGRATE, 14, 0, 0, V),
    ]


def test_guards_keep_their_rows() -> None:
    rows = [(NEG, V, 0, 0, 10), (SCALE, 10, B, 0, 11), (SCALE, 11, C, 0, 12), (ADD, 12, X, 0, 13)]
    assert high_rows(rows, [X, V], [V, 13], [13]) == [
        *rows,
        (INTEGRATE, V, 0, 0, X),
        (INTEGRATE, 13, 0, 0, V),
    ]


def test_a_sum_that_something_else_reads_stays() -> None:
    """(x - v) + v and exp(x - v)."""
    rows = [(SUB, X, V, 0, 10), (ADD, 10, V, 0, 11), (EXP, 10, 0, 0, 12)]
    first, second, third, *_ = high_rows(rows, [X, V], [11, 12], [])
    assert (first, third) == (rows[0], rows[2])
    assert second in (rows[1], (ADD, V, 10, 0, 11))


def test_a_sum_of_a_thousand_terms() -> None:
    """Taken apart once, and not by recursion."""
    count = 3000
    rows = [(SCALE, X if i % 2 else V, B, 0, 10 + i) for i in range(count)]
    rows.append((SUB, 10, 11, 0, 10 + count))
    rows += [(ADD, 8 + count + i, 10 + i, 0, 9 + count + i) for i in range(2, count)]
    found = high_rows(rows, [X, V], [V, rows[-1][4]], [])
    assert len(found) == len(rows) + 2
    assert len({row[4] for row in found[:-2]}) == len(rows)


def test_a_sum_of_what_is_subtracted() -> None:
    """-(x + v) - v."""
    rows = [(ADD, X, V, 0, 10), (NEG, 10, 0, 0, 11), (SUB, 11, V, 0, 12)]
    assert high_rows(rows, [X, V], [V, 12], [])[:-2] == rows
