"""Block diagonal flows of random matrices against matrix exponentials in multiple precision."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy.linalg
from reference.random_models import matrix

from hybridsim.engine.linear.modal import Modal, modal
from hybridsim.engine.linear.motion import moved, states_of, to_modal
from hybridsim.engine.linear.tables import LinearTables, no_tables
from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.products import filled_up, row_blocks_of, vector_of
from hybridsim.engine.native.struct_pack import packed

UNIT = 2.0**-53
ROUNDINGS = 256.0  # of the result, as ill conditioned as it is


def exponential(A: np.ndarray, y: np.ndarray, d: float) -> tuple[np.ndarray, float]:
    """exp(A d) y, and by how much it moves, relative to a relative change of the entries of A."""
    with mpmath.workdps(40):
        start, small = mpmath.matrix(y.tolist()), mpmath.mpf(10) ** -18
        exact = mpmath.expm(mpmath.matrix(A.tolist()) * d) * start
        moved, draw = 0.0, np.random.default_rng(0)
        for _ in range(2):
            other = mpmath.matrix(A.tolist())
            for (i, j), change in np.ndenumerate(draw.uniform(-1, 1, A.shape)):
                other[i, j] *= 1 + small * float(change)
            apart = mpmath.expm(other * d) * start - exact
            moved = max(moved, float(mpmath.norm(apart, mpmath.inf) / small))
        return np.array([float(v) for v in exact]), moved


@kernel
def _flow(lin: Any, y: Any, none: Any, d: float, c: Any, v: Any, out: Any) -> None:
    to_modal(lin, 0, y, none, c)
    moved(lin, 0, c, d, v)
    states_of(lin, 0, v, out)


def by_blocks(flow: Modal, y: np.ndarray, d: float) -> np.ndarray:
    """The same from the block diagonal form, as the compiled loop evaluates it."""
    empty = no_tables()
    fields = {name: getattr(empty, name) for name in LinearTables._fields}
    fields["counts"] = np.array([len(flow.values)])
    for name in ("values", "upper", "ends"):
        fields[name] = getattr(flow, name)[None]
    width = filled_up(2 * len(flow.values)) // 2
    inverse, basis = flow.inverse, flow.full_basis
    fields["inverse"] = row_blocks_of(np.stack([inverse.real, inverse.imag], axis=1).reshape(1, -1, len(y)))
    fields["states"] = row_blocks_of(np.stack([basis.real, -basis.imag], axis=-1).reshape(1, len(y), -1))
    c, v = np.zeros((2, width), dtype=complex)
    start, out = vector_of(len(y)), np.empty(len(y))
    start[:] = y
    _flow(packed(LinearTables(**fields)), start, np.zeros(0), d, c, v, out)
    return out


def in_other_coordinates(A: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """A similar matrix; the change of coordinates is well conditioned."""
    S = draw.normal(size=A.shape) + 3.0 * np.eye(len(A))
    return S @ A @ np.linalg.inv(S)


def jordan(value: float, size: int) -> np.ndarray:
    return value * np.eye(size) + np.diag(np.ones(size - 1), 1)


def matrices(draw: np.random.Generator) -> Iterator[tuple[str, np.ndarray, float]]:
    """(kind, matrix, time)."""
    n = int(draw.integers(1, 8))
    yield "generic", draw.normal(size=(n, n)), 2.0
    turning = np.zeros((6, 6))
    for i, speed in enumerate(draw.uniform(0.5, 3.0, 3)):
        turning[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, speed], [-speed, 0.0]]
    yield "oscillatory", in_other_coordinates(turning, draw), 30.0
    size, value = int(draw.integers(2, 7)), float(draw.choice([0.0, -1.0, 0.3]))
    yield "one chain", jordan(value, size), 3.0
    yield "one chain, hidden", in_other_coordinates(jordan(value, size), draw), 3.0
    apart = 10.0 ** -int(draw.integers(4, 15))
    yield "near a chain", jordan(value, size) + np.diag(draw.normal(size=size)) * apart, 3.0
    yield "near a chain, dense", jordan(-1.0, size) + draw.normal(size=(size, size)) * apart, 3.0
    other = 1.0 + float(draw.choice([0.0, apart, -apart]))
    forced = np.array([[0, 1, 0, 0], [-1, 0, 1, 0], [0, 0, 0, other], [0, 0, -other, 0.0]])
    yield "resonance", forced, 40.0
    pace = 10.0 ** float(draw.uniform(-2.0, 2.0))
    yield "critical damping", np.array([[0.0, 1.0], [-pace * pace, -2.0 * other * pace]]), 5.0 / pace
    Q = np.linalg.qr(draw.normal(size=(5, 5)))[0]
    yield "stiff", Q @ np.diag([-1.0, *-(10.0 ** draw.uniform(0.0, 6.0, 3)), -1e6]) @ Q.T, 1.0
    decay = jordan(-1.0, 5)
    decay[0, 0] = -other
    yield "t**3 exp(-t) drives exp(-t)", decay, 8.0


@pytest.mark.parametrize("seed", range(4))
def test_flows_are_as_good_as_the_matrix_allows(seed: int) -> None:
    draw = np.random.default_rng(seed)
    for kind, A, d in matrices(draw):
        y = draw.normal(size=len(A))
        expected, moved = exponential(A, y, d)
        error = np.abs(by_blocks(modal(A, d), y, d) - expected).max()
        assert error <= ROUNDINGS * UNIT * (moved + np.abs(expected).max()), (kind, A, d)


def test_a_basis_is_well_conditioned_and_its_inverse_is_one() -> None:
    """One of each pair of conjugates is kept, so the real part of basis and inverse is the identity."""
    draw = np.random.default_rng(9)
    for kind, A, _ in matrices(draw):
        flow = modal(A)
        assert np.real(flow.full_basis @ flow.inverse) == pytest.approx(np.eye(len(A)), abs=1e-12), kind
        assert len(flow.values) == len(flow.ends) == flow.full_basis.shape[1]


@pytest.mark.parametrize(
    "seed", [1, 576, 1439, 1734, 2659]
)  # all but the first were lost by complex arithmetic
def test_half_of_the_basis_is_enough_near_defective_matrices(seed: int) -> None:
    """Of nearly parallel eigenvectors too: what is kept of a pair stands for both to what the rounding of it costs."""
    draw = np.random.default_rng(seed)
    n = 2 + seed % 7
    flow = modal(matrix("nearly defective", n, draw), 16.0)
    lost = np.abs(np.real(flow.full_basis @ flow.inverse) - np.eye(n))
    assert (lost <= 64.0 * UNIT * (np.abs(flow.full_basis) @ np.abs(flow.inverse)).max()).all()


WEAK = [
    [[-1e-8, 0, 0, 1e-10], [1e-14, 0, 1e-10, 1], [0, 1e-12, 0, 1], [-1, 0, 0, -3]],
    [[2, 0, 0, -1], [0, 0, 1e-10, -1e-8], [-3, 1e-14, 1e-12, -1e-14], [1e-10, 0, 0, -3]],
    [[0, 0, 0, 1e-12], [-3, 1, 2, -1e-8], [0, -3, -1e-8, 0], [1e-12, 0, 0, 0]],
    [[0, -1e-14, 0], [0, 0, 1e-12], [1, -1, -1]],
    [[0, 0, 1], [1, 0, 0], [-3, 1e-14, 0]],
    [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1e-8, 0, 0, 0]],
]


@pytest.mark.parametrize("A", WEAK)
def test_weak_couplings_cost_no_digits(A: list[list[float]]) -> None:
    """Of LAPACK's eigenvectors for the first, which it balances on its own, one was no eigenvector at all."""
    matrix = np.array(A, dtype=float)
    y = np.ones(len(A))
    expected, _ = exponential(matrix, y, 1.0)
    assert by_blocks(modal(matrix, 4.0), y, 1.0) == pytest.approx(
        expected, abs=64.0 * UNIT * np.abs(expected).max()
    )


@pytest.mark.parametrize(("a", "time"), [(-3e-16, 1e6), (-3e-16, 28e3), (-1e-9, 1e4), (-1e-6, 1e3)])
def test_a_long_chain_under_a_constant_force(a: float, time: float) -> None:
    """Nothing drives the constant and the last integral drives nothing: they are scaled for the time at hand too."""
    A = np.diag(np.ones(4), 1)  # x0' = x1, ..., x3' = a x1 + 1
    A[3, 1] = a
    y = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    expected, _ = exponential(A, y, time)
    assert by_blocks(modal(A, 2.0 * time), y, time) == pytest.approx(expected, rel=1e-12)


def test_a_ramp_beside_a_fast_wave() -> None:
    """x'' = sin(3 t) - 1e-4 x - 1e-6 x' + 1e-9 t**3: the wave's rounding is large beside what the ramp does."""
    A = np.zeros((8, 8))  # x, x', sin, cos, 1, t, t**2, t**3
    A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[1, 7] = 1.0, -1e-4, -1e-6, 1.0, 1e-9
    A[2, 3], A[3, 2], A[5, 4], A[6, 5], A[7, 6] = 3.0, -3.0, 1.0, 2.0, 3.0
    y = np.array([1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    expected, _ = exponential(A, y, 200.0)
    assert by_blocks(modal(A, 256.0), y, 200.0) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    ("A", "start"),
    [
        ([[0, 2e-4, -1e-10, 0], [-1e-8, -3e-10, 0, -3], [0, -1e-12, 0, 0], [2e-12, -3, 0, 2e-12]], 2),
        ([[-5e-5, 0, 0, -2.9], [5e-4, 4, 0, 0], [0, -0.04, 0, -1e-5], [8.6, 0, -3e-5, 2e-4]], 2),
    ],
)
def test_what_couples_weakly_to_a_motion_that_grows(A: list[list[float]], start: int) -> None:
    """It grows by exp(36) and exp(48) from a share of 1e-12 and less, which rounding would hide."""
    matrix, y = np.array(A, dtype=float), np.eye(4)[start]
    expected, _ = exponential(matrix, y, 12.0)
    assert by_blocks(modal(matrix, 48.0), y, 12.0) == pytest.approx(expected, rel=1e-12)


def test_eigenvalues_that_two_factorisations_tell_apart_differently() -> None:
    """t exp(-t) sin(3 t) drives an oscillator: four pairs, of which two coincide; no block may be empty."""
    A = np.zeros((6, 6))
    A[0, 1], A[1, 0], A[1, 2] = 1.0, -1.0, 1.0
    pair = np.array([[-1.0, 3.0], [-3.0, -1.0]])
    A[2:4, 2:4] = A[4:6, 4:6] = pair
    A[2, 4] = A[3, 5] = 1.0
    y = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    expected, _ = exponential(A, y, 10.0)
    assert by_blocks(modal(A), y, 10.0) == pytest.approx(expected, abs=1e-14)


def test_a_coupling_that_is_nothing_beside_the_diagonal_is_not_blown_up() -> None:
    """Balanced without the diagonal, the noise in the corner would scale the states 10**8 apart."""
    A = jordan(-2.0, 4)
    A[3, 0] = 1e-13
    y = np.array([1.0, -0.5, 0.25, 2.0])
    expected, _ = exponential(A, y, 1.0)
    assert by_blocks(modal(A), y, 1.0) == pytest.approx(expected, rel=1e-14)


def test_units_far_apart_cost_no_digits() -> None:
    """A displacement in m and a velocity at 10**4 rad/s: each state is good to its own size."""
    speed = 1e4
    A = np.array([[0.0, 1.0], [-(speed**2), 0.0]])
    x, v = by_blocks(modal(A), np.array([1e-3, 0.0]), 1e-3)
    assert x == pytest.approx(1e-3 * float(mpmath.cos(10)), rel=1e-14)
    assert v == pytest.approx(-10.0 * float(mpmath.sin(10)), rel=1e-14)


@pytest.mark.parametrize("apart", [1e-4, 1e-8, 1e-14])
def test_a_coupling_that_is_nothing_over_the_time_at_hand_is_not_blown_up(apart: float) -> None:
    """Two integrators with a spring that takes 1/sqrt(apart) to act: no cancelling exponentials."""
    A = np.array([[0.0, 1.0], [-apart, 0.0]])
    expected, _ = exponential(A, np.array([0.0, 1.0]), 1.0)
    assert by_blocks(modal(A, 1.0), np.array([0.0, 1.0]), 1.0) == pytest.approx(expected, rel=2e-14)


def test_many_inputs_are_separated_by_few_factorisations(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cubic pieces of 12 inputs push a mass on a spring: 48 coefficients with the eigenvalue 0, and one pair."""
    A = np.zeros((50, 50))
    A[0, 1], A[1, 0] = 1.0, -4.0
    for first in range(2, 50, 4):
        A[1, first] = 1.0
        for place in range(first, first + 3):
            A[place, place + 1] = 1.0
    made: list[int] = []
    schur = scipy.linalg.schur

    def counted(matrix: np.ndarray, *arguments: Any, **options: Any) -> Any:
        made.append(len(matrix))
        return schur(matrix, *arguments, **options)

    monkeypatch.setattr(scipy.linalg, "schur", counted)
    form = modal(A)
    assert len(made) <= 4
    blocks = np.zeros(len(form.values), dtype=np.int64)
    for place, end in enumerate(form.ends):
        blocks[place] = end
    assert sorted(np.unique(blocks, return_counts=True)[1].tolist()) == [1, 48]
