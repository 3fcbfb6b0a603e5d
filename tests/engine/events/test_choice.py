"""The event decisions against brute force: every possible sign tried, every order of the candidates tried."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.judged_guards import Parts, verdict_on

from hybridsim.engine.events.choice.joint_choice import (
    NO_SCORE,
    NONE,
    NONUNIQUE,
    is_settled,
    joint_candidates,
    joint_choice,
    rank_candidates,
)
from hybridsim.engine.events.choice.verdict import (
    FINE,
    LEAVES,
    UNDECIDED,
    JudgedEvent,
    decreed_zeros,
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
    st.lists(st.tuples(coefficients, margins, st.integers(0, 3), st.booleans()), min_size=1, max_size=4),
    st.randoms(use_true_random=False),
)
def test_a_candidate_is_judged_by_its_worst_guard_in_any_order(
    guards: list[tuple[list[float], list[float], int, bool]], random: object
) -> None:
    def verdict(rows: list[tuple[list[float], list[float], int, bool]]) -> int:
        series, bounds, decreed, _ = zip(*rows, strict=True)
        return verdict_on(series, bounds, decreed, [k for k, row in enumerate(rows) if row[3]])[0]

    one_by_one = [verdict([guard]) for guard in guards]
    shuffled = list(guards)
    random.shuffle(shuffled)
    assert verdict(shuffled) == min(one_by_one)
    for (series, bounds, decreed, active), alone in zip(guards, one_by_one, strict=True):
        sign = sign_near(kept(series, bounds, decreed), Fraction(1, 2**90))
        open_ = any(c != 0 or e != 0 for c, e in zip(series[decreed:], bounds[decreed:], strict=True))
        expected = FINE if not active or sign > 0 or not open_ else LEAVES if sign < 0 else UNDECIDED
        assert alone == expected


@pytest.mark.parametrize(
    ("decreed", "expected"),
    [(0, LEAVES), (1, LEAVES), (2, FINE), (3, LEAVES)],
)
def test_a_release_is_decided_by_the_first_derivative_that_is_not_decreed(
    decreed: int, expected: int
) -> None:
    """v = 0, a = 0 by decree, both -1e-12 as computed; the jerk is 3 and what follows it -1."""
    assert verdict_on([[-1e-12, -1e-12, 3.0, -1.0]], np.full((1, 4), 1e-15), [decreed])[0] == expected


def test_a_guard_that_is_zero_throughout_admits_its_mode() -> None:
    assert verdict_on(np.zeros((1, 4)), np.zeros((1, 4)), [0])[0] == FINE


def test_what_is_not_a_number_is_undecided() -> None:
    assert verdict_on(np.full((1, 4), np.nan), np.full((1, 4), np.nan), [0])[0] == UNDECIDED


# -- the choice among candidates --------------------------------------------------------------------------------


def ranks_of(modes: np.ndarray, current: np.ndarray, keeps: np.ndarray | None = None) -> np.ndarray:
    total, n = modes.shape
    ranks = np.zeros(total, dtype=np.int64)
    none = np.zeros(n, dtype=np.bool_)
    rank_candidates(modes, total, n, current, np.full(n, HOLD), none if keeps is None else keeps, ranks)
    return ranks


def pick(modes: np.ndarray, verdicts: np.ndarray, current: np.ndarray) -> tuple[int, ...] | int:
    chosen, score = NONE, NO_SCORE
    for number, (rank, verdict) in enumerate(zip(ranks_of(modes, current), verdicts, strict=True)):
        chosen, score = joint_choice(chosen, score, number, int(rank), int(verdict), modes.shape[1])
    return tuple(int(m) for m in modes[chosen]) if chosen >= 0 else chosen


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


@given(st.integers(1, 3), st.data())
def test_no_candidate_after_a_settled_choice_changes_it(n: int, data: st.DataObject) -> None:
    modes = joint_candidates([3] * n)
    current = np.array(data.draw(st.lists(st.integers(-1, 2), min_size=n, max_size=n)))
    verdicts = data.draw(st.lists(st.sampled_from([LEAVES, LEAVES, UNDECIDED, FINE]),
                                  min_size=len(modes), max_size=len(modes)))  # fmt: skip
    ranks = ranks_of(modes, current)
    chosen, score, settled = NONE, NO_SCORE, None
    for number in np.argsort(-ranks, kind="stable").tolist():
        if settled is None and is_settled(score, int(ranks[number]), n):
            settled = chosen
        chosen, score = joint_choice(chosen, score, number, int(ranks[number]), verdicts[number], n)
    assert settled in (None, chosen)


def test_what_is_below_its_limits_keeps_holding() -> None:
    modes = joint_candidates([3, 3])
    ranks = ranks_of(modes, np.array([HOLD, HOLD]), np.array([False, True]))
    assert {tuple(row) for row in modes[ranks >= 0].tolist()} == {(m, HOLD) for m in range(3)}


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
    """Guards 0 and 1 of the only component, which begins to slip upward or goes on holding."""
    z, count = np.array([HOLD if holding else ABOVE]), 2
    parts = Parts(
        np.arange(count).reshape(1, 1, 2).repeat(3, axis=1).copy(),
        np.array([HOLD]),
        np.array([ABOVE]),
        np.array([gap]),
    )
    event = JudgedEvent(
        before=z, now=z, is_zero=np.full(count, fired), on_surface=np.array([on_surface]),
        released_to=np.array([0 if released else 1]), judged=np.zeros((2, count, 4)),
        decreed=np.zeros(count, dtype=np.int64), all_sides=np.zeros((1, count), dtype=np.int64),
        all_orders=np.zeros((1, count), dtype=np.int64), all_floors=np.zeros((1, count)),
    )  # fmt: skip
    found = [decreed_zeros(parts, event, z, 0, j, j, continuous) for j in range(count)]
    beside = on_surface and not holding
    # a limit that another unknown's jump may have undone is none
    at_zero = fired and (continuous or not holding)
    # a gap is held together with its rate
    surface = (2 if released and continuous else 1) + gap if beside else int(at_zero)
    assert found == [surface, int(at_zero)]
    elsewhere = event._replace(now=1 - np.minimum(z, 1))  # a mode that did not go on
    assert decreed_zeros(parts, elsewhere, z, 0, 1, 1, continuous) == 0
