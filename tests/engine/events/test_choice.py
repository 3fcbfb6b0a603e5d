"""The event decisions against brute force: every possible sign tried, every order of the candidates tried."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.engine.events.choice.verdict import (
    FINE,
    LEAVES,
    NONE,
    NONUNIQUE,
    UNDECIDED,
    choose,
    decree_orders,
    guard_verdict,
    joint_candidates,
    side_after,
    side_before,
)

ABOVE, BELOW, HOLD = 0, 1, 2  # modes of a surface component, as a contact has them
coefficients = st.lists(st.sampled_from([-2.0, -0.5, -1e-17, 0.0, 1e-17, 0.5, 2.0]), min_size=4, max_size=4)
margins = st.lists(st.sampled_from([0.0, 1e-16, 1.0]), min_size=4, max_size=4)


# -- the sign of one guard --------------------------------------------------------------------------------------


def sign_near(series: list[Fraction], epsilon: Fraction) -> int:
    """Sign of the polynomial at epsilon, exactly."""
    value = sum(c * epsilon**k for k, c in enumerate(series))
    return (value > 0) - (value < 0)


def kept(series: list[float], bounds: list[float], decreed: int) -> list[Fraction]:
    """The coefficients that count: decreed ones and those within their bound are zero."""
    return [
        Fraction(0) if k < decreed or abs(c) <= e else Fraction(c)
        for k, (c, e) in enumerate(zip(series, bounds, strict=True))
    ]


@given(coefficients, margins, st.integers(0, 4))
def test_sides_are_the_signs_of_the_polynomial_close_by(
    series: list[float], bounds: list[float], decreed: int
) -> None:
    """Exact values at +-2**-90 times the smallest ratio of the coefficients."""
    known = kept(series, bounds, decreed)
    arrays = np.array(series), np.array(bounds), decreed
    after, order = side_after(*arrays)
    before, same = side_before(*arrays)
    assert after == sign_near(known, Fraction(1, 2**90))
    assert before == sign_near(known, Fraction(-1, 2**90))
    assert order == same == next((k for k, c in enumerate(known) if c != 0), 4)


@given(coefficients, margins, st.integers(0, 3), st.data())
def test_a_certain_side_is_right_for_every_guard_within_the_bounds(
    series: list[float], bounds: list[float], decreed: int, data: st.DataObject
) -> None:
    """If the deciding coefficient is the first that is not decreed, no rounding within the bounds can turn it."""
    side, order = side_after(np.array(series), np.array(bounds), decreed)
    shaken = [
        Fraction(0) if k < decreed else Fraction(c) + Fraction(e) * data.draw(st.sampled_from([-1, 0, 1]))
        for k, (c, e) in enumerate(zip(series, bounds, strict=True))
    ]
    if side != 0 and order == decreed:
        assert sign_near(shaken, Fraction(1, 2**90)) == side


# -- the verdict on a candidate ---------------------------------------------------------------------------------


@given(
    st.lists(st.tuples(coefficients, margins, st.integers(0, 4), st.booleans()), min_size=1, max_size=4),
    st.booleans(),
    st.randoms(use_true_random=False),
)
def test_a_candidate_is_judged_by_its_worst_guard_in_any_order(
    guards: list[tuple[list[float], list[float], int, bool]], backward: bool, random: object
) -> None:
    def verdict(rows: list[tuple[list[float], list[float], int, bool]]) -> int:
        count = len(rows)
        sides, orders = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        return guard_verdict(
            np.array([r[0] for r in rows]),
            np.array([r[1] for r in rows]),
            np.array([r[2] for r in rows]),
            np.array([r[3] for r in rows]),
            backward,
            sides,
            orders,
        )

    one_by_one = [verdict([guard]) for guard in guards]
    shuffled = list(guards)
    random.shuffle(shuffled)
    assert verdict(shuffled) == min(one_by_one)
    for (series, bounds, decreed, active), alone in zip(guards, one_by_one, strict=True):
        epsilon = Fraction(-1 if backward else 1, 2**90)
        sign = sign_near(kept(series, bounds, decreed), epsilon)
        open_ = any(c != 0 or e != 0 for c, e in zip(series[decreed:], bounds[decreed:], strict=True))
        expected = FINE if not active or sign > 0 or not open_ else LEAVES if sign < 0 else UNDECIDED
        assert alone == expected


@pytest.mark.parametrize(
    ("decreed", "expected"),
    [(0, LEAVES), (1, LEAVES), (2, FINE), (3, LEAVES), (4, FINE)],
)
def test_a_release_is_decided_by_the_first_derivative_that_is_not_decreed(
    decreed: int, expected: int
) -> None:
    """v = 0, a = 0 by decree, both -1e-12 as computed; the jerk is 3 and what follows it -1."""
    series = np.array([[-1e-12, -1e-12, 3.0, -1.0]])
    bounds = np.full((1, 4), 1e-15)
    one = np.zeros(1, dtype=np.int64)
    verdict = guard_verdict(
        series, bounds, np.array([decreed]), np.ones(1, dtype=bool), False, one.copy(), one.copy()
    )
    assert verdict == expected


def test_a_guard_that_is_zero_throughout_admits_its_mode() -> None:
    one = np.zeros(1, dtype=np.int64)
    zero = np.zeros((1, 4))
    assert guard_verdict(zero, zero, one, np.ones(1, dtype=bool), False, one.copy(), one.copy()) == FINE


def test_what_is_not_a_number_is_undecided() -> None:
    one = np.zeros(1, dtype=np.int64)
    nan = np.full((1, 4), np.nan)
    assert guard_verdict(nan, nan, one, np.ones(1, dtype=bool), False, one.copy(), one.copy()) == UNDECIDED


# -- the choice among candidates --------------------------------------------------------------------------------


def pick(modes: np.ndarray, verdicts: np.ndarray, current: np.ndarray) -> tuple[int, ...] | int:
    holds = np.full(modes.shape[1], HOLD)
    number = int(choose(modes, verdicts, current, holds))
    return tuple(int(m) for m in modes[number]) if number >= 0 else number


def expected_choice(verdicts: dict[tuple[int, ...], int], current: tuple[int, ...]) -> tuple[int, ...] | int:
    """The rules as sets: stay; else the certain ones; of those the most that stay; of those the most that hold."""
    left = [c for c, v in verdicts.items() if v != LEAVES]
    if not left:
        return NONE
    if current in left:
        return current
    left = [c for c in left if verdicts[c] == FINE] or left
    for score in (
        lambda c: sum(m == k for m, k in zip(c, current, strict=True)),
        lambda c: sum(m == HOLD for m in c),
    ):
        best = max(score(c) for c in left)
        left = [c for c in left if score(c) == best]
    return left[0] if len(left) == 1 else NONUNIQUE


@given(st.integers(1, 3), st.data())
def test_the_choice_follows_the_rules_whatever_the_order_of_the_candidates(
    n: int, data: st.DataObject
) -> None:
    modes = joint_candidates([3] * n)
    verdicts = np.array(data.draw(st.lists(st.sampled_from([LEAVES, LEAVES, UNDECIDED, FINE]),
                                           min_size=len(modes), max_size=len(modes))))  # fmt: skip
    current = np.array(data.draw(st.lists(st.integers(-1, 2), min_size=n, max_size=n)))
    table = {tuple(int(m) for m in row): int(v) for row, v in zip(modes, verdicts, strict=True)}
    expected = expected_choice(table, tuple(int(m) for m in current))
    assert pick(modes, verdicts, current) == expected
    rows = np.array(data.draw(st.permutations(range(len(modes)))))
    assert pick(np.ascontiguousarray(modes[rows]), verdicts[rows], current) == expected
    columns = np.array(data.draw(st.permutations(range(n))))
    found = pick(np.ascontiguousarray(modes[:, columns]), verdicts, current[columns])
    if isinstance(expected, int):
        assert found == expected
    else:
        assert found == tuple(expected[c] for c in columns)


ONE = joint_candidates([3])


def verdicts_where(fine: set[int] = frozenset(), undecided: set[int] = frozenset()) -> np.ndarray:
    return np.array([FINE if m in fine else UNDECIDED if m in undecided else LEAVES for m in range(3)])


@pytest.mark.parametrize("current", [ABOVE, BELOW, HOLD])
@pytest.mark.parametrize("others", list(itertools.chain.from_iterable(
    itertools.combinations(range(3), k) for k in range(3))))  # fmt: skip
def test_the_current_mode_stays_if_it_is_admissible(current: int, others: tuple[int, ...]) -> None:
    for own in (FINE, UNDECIDED):
        verdicts = verdicts_where(set(others))
        verdicts[current] = own
        assert pick(ONE, verdicts, np.array([current])) == (current,)


def test_stick_comes_before_slip() -> None:
    """Static friction holds, wherever the motion came from."""
    for came_from in (-1, ABOVE, BELOW):
        for slip in ({ABOVE}, {BELOW}, {ABOVE, BELOW}):
            fine = {HOLD, *slip} - {came_from}
            assert pick(ONE, verdicts_where(fine), np.array([came_from])) == (HOLD,)


def test_two_slips_without_stick_are_not_unique() -> None:
    for came_from in (-1, HOLD):
        assert pick(ONE, verdicts_where({ABOVE, BELOW}), np.array([came_from])) == NONUNIQUE
        assert pick(ONE, verdicts_where(undecided={ABOVE, BELOW}), np.array([came_from])) == NONUNIQUE


def test_nothing_admissible_is_none() -> None:
    for came_from in (-1, ABOVE, BELOW, HOLD):
        assert pick(ONE, verdicts_where(), np.array([came_from])) == NONE


def test_what_is_certain_comes_before_what_is_open() -> None:
    assert pick(ONE, verdicts_where({BELOW}, {HOLD}), np.array([ABOVE])) == (BELOW,)
    assert pick(ONE, verdicts_where(set(), {HOLD, BELOW}), np.array([ABOVE])) == (HOLD,)


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4))
def test_the_candidates_are_all_combinations_once(sizes: list[int]) -> None:
    rows = [tuple(int(m) for m in row) for row in joint_candidates(sizes)]
    assert sorted(rows) == list(itertools.product(*map(range, sizes)))
    assert len(set(rows)) == len(rows)


# -- the zeros that an event decrees ----------------------------------------------------------------------------


@pytest.mark.parametrize("holding", [False, True])
@pytest.mark.parametrize("on_surface", [False, True])
@pytest.mark.parametrize("released", [False, True])
@pytest.mark.parametrize("continuous", [False, True])
@pytest.mark.parametrize("fired", [False, True])
@pytest.mark.parametrize("gap", [False, True])
def test_decreed_zeros(
    holding: bool, on_surface: bool, released: bool, continuous: bool, fired: bool, gap: bool
) -> None:
    """Two components; guards 0, 1 belong to the first, 2, 3 to the second, which is at rest in all respects."""
    decreed = np.full(5, 7, dtype=np.int64)
    decree_orders(
        np.array([[0, 1], [3, -1]]),
        np.array([holding, False]),
        np.array([on_surface, False]),
        np.array([released, False]),
        continuous,
        np.array([fired, fired, True, False, True]),
        np.array([gap, gap]),
        decreed,
    )
    beside = on_surface and not holding
    # a limit that another unknown's jump may have undone is none
    at_zero = fired and (continuous or not holding)
    # a gap is held together with its rate
    surface = (2 if released and continuous else 1) + gap if beside else int(at_zero)
    assert decreed.tolist() == [surface, int(at_zero), 7, 0, 7]
