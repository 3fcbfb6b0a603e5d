"""Products by panels and rows of four against numpy, compiled and without a compiler."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine.uncompiled import uncompiled

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.products import (
    dot,
    filled_up,
    product,
    row_blocks_of,
    rows_of,
    times,
    vector_of,
)

SHAPES = [(1, 1, 0), (2, 2, 3), (4, 4, 4), (5, 3, 1), (9, 8, 7), (3, 0, 2)]


@kernel
def products(row_blocks: Any, rows: Any, k: int, x: Any, w: Any, out: Any, row: Any) -> None:
    product(row_blocks, k, (x, w), out)
    for i in range(row.shape[0]):
        row[i] = dot(rows, (k, i), (x, w))


@kernel
def of_complex(row_blocks: Any, c: Any) -> tuple[float, float, float, float]:
    return times(row_blocks, (0, 0), (c,))


def filled(values: np.ndarray) -> np.ndarray:
    out = vector_of(len(values))
    out[:] = values
    return out


@pytest.mark.parametrize("shape", SHAPES)
def test_a_matrix_times_two_vectors(shape: tuple[int, int, int]) -> None:
    rows, n, m = shape
    draw = np.random.default_rng(sum(shape))
    matrix, x, w = draw.normal(size=(2, rows, n + m)), draw.normal(size=n), draw.normal(size=m)
    out, each = np.full(rows, np.nan), np.full(rows, np.nan)
    row_blocks, wide = row_blocks_of(matrix, (n, m)), rows_of(matrix, (n, m))
    assert row_blocks.shape == (2, filled_up(rows) // 4, filled_up(n) + filled_up(m), 4)
    products(row_blocks, wide, 1, filled(x), filled(w), out, each)
    expected = matrix[1] @ np.concatenate([x, w])
    error = 1e-15 * (np.abs(matrix[1]) @ np.abs(np.concatenate([x, w]))) + 1e-300
    assert (np.abs(out - expected) <= 4 * error).all()
    assert (np.abs(each - expected) <= 4 * error).all()


def test_a_complex_number_is_two_real_ones() -> None:
    draw = np.random.default_rng(0)
    matrix, c = draw.normal(size=(1, 4, 8)), draw.normal(size=4) + 1j * draw.normal(size=4)
    assert of_complex(row_blocks_of(matrix), c) == pytest.approx(matrix[0] @ c.view(float), rel=1e-14)


def test_without_a_compiler() -> None:
    code = "from engine.native.test_simd_products import *\nfor s in SHAPES: test_a_matrix_times_two_vectors(s)\n"
    code += "test_a_complex_number_is_two_real_ones()\nprint('as with it')"
    assert uncompiled(code).strip() == "as with it"
