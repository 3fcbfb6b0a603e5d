"""The root search over one step, against functions whose roots are known by construction.

Every function is a product, so its values have the right sign and almost full relative accuracy: what the search
finds can be held against the factors themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsim.engine.roots import roots
from hybridsim.engine.roots.roots import _ACCEPT, POINTS, Crossing, Grazing, find_roots, quiet
from hybridsim.engine.run.locate import polish
from hybridsim.engine.system.failures import StepFailure

Function = Callable[[np.ndarray], np.ndarray]
UNIT = 2.0**-53
# A product of some ten factors, each right to a rounding or two, times a value of order one.
ROUNDING = 64.0 * UNIT


class Search:
    """One search, with its cost."""

    def __init__(
        self,
        f: Function,
        order: int = 0,
        side: int = 0,
        stop: int = 0,
        rounding: float = ROUNDING,
        floor: float = 0.0,
        before: Callable[[float], float] = lambda _: 0.0,
    ) -> None:
        self.f, self.samples = f, 0
        first = self.sample(POINTS)
        self.crossings: list[Crossing]
        self.grazings: list[Grazing]
        self.crossings, self.grazings, self.end, self.undefined = find_roots(
            self.sample, first, order, side, stop, lambda: rounding, before, floor
        )

    def sample(self, theta: np.ndarray) -> np.ndarray:
        self.samples += len(theta)
        return np.asarray(self.f(theta), dtype=float)

    @property
    def roots(self) -> list[float]:
        return [polish(self.sample, c) for c in self.crossings]

    def mentions(self, root: float, slack: float) -> bool:
        """Whether a root lies in the bracket of a crossing or beside a grazing."""
        inside = any(c.left - slack <= root <= c.right + slack for c in self.crossings)
        return inside or any(abs(g.theta - root) <= slack for g in self.grazings)


def product(roots: list[float], factor: Function = np.ones_like) -> Function:
    """factor(theta) * prod (theta - root)."""

    def f(theta: np.ndarray) -> np.ndarray:
        values = np.asarray(factor(theta), dtype=float)
        for root in roots:
            values = values * (theta - root)
        return values

    return f


def assert_alternating(crossings: list[Crossing]) -> None:
    assert all(a.direction == -b.direction for a, b in pairwise(crossings))
    assert all(a.right <= b.left for a, b in pairwise(crossings))
    assert all(0.0 <= c.left <= c.right <= 1.0 for c in crossings)


@st.composite
def separated(draw: st.DrawFn, most: int = 9) -> list[float]:
    """Roots in (0, 1), no two nearer than 1/500, none nearer to an end."""
    places = draw(st.lists(st.integers(1, 249), min_size=1, max_size=most, unique=True))
    shift = draw(st.floats(-0.4, 0.4))
    return sorted((2 * place + shift) / 500 for place in places)


# -- simple roots -----------------------------------------------------------------------------------------------


@given(separated(), st.sampled_from([-3.0, 1e-7, 2e9]))
def test_simple_roots_are_all_found_to_rounding(roots: list[float], scale: float) -> None:
    """Where nine lie so near together that rounding hides what is between them, they are flagged instead."""
    f = product(roots, lambda theta: scale * np.exp(theta))
    up = int(np.sign(scale))
    search = Search(f, side=up * (-1) ** len(roots), rounding=ROUNDING * abs(scale))
    assert_alternating(search.crossings)
    assert (len(roots) - len(search.crossings)) % 2 == 0
    assert search.end == up
    if len(search.crossings) < len(roots):
        between = [0.5 * (a + b) for a, b in pairwise(roots)]
        smallest = np.min(np.abs(f(np.array([0.0, *between]))))
        assert smallest <= 2 * _ACCEPT * np.max(np.abs(f(POINTS))), "all could be told apart"
        assert search.grazings or any(c.right - c.left > 1e-6 for c in search.crossings)
        return
    for found, root in zip(search.roots, roots, strict=True):
        assert abs(found - root) <= 2 * math.ulp(root)
    assert [c.direction for c in search.crossings] == [
        up * (-1) ** (len(roots) - 1 - i) for i in range(len(roots))
    ]


@given(separated(most=5))
def test_the_search_may_end_at_the_first_way_out(roots: list[float]) -> None:
    """A guard leaves at its first downward crossing; with an even number of roots that is the first one."""
    f = product(roots)
    side = int(np.sign(f(np.zeros(1))[0]))
    search = Search(f, side=side, stop=-1)
    falls = [r for i, r in enumerate(roots) if side * (-1) ** (i + 1) < 0]
    if not falls:
        assert [c.direction for c in search.crossings] == [1]
        return
    assert search.crossings[-1].direction == -1
    assert search.roots[-1] == pytest.approx(falls[0], abs=1e-15)


def is_quiet(f: Function, side: int, order: int = 0, floor: float = 0.0) -> bool:
    values, one = f(POINTS)[:, None], np.array([0])
    return bool(quiet(values, one, np.array([side]), np.array([order]), np.array([floor]))[0])


@given(separated(most=4), st.integers(1, 3))
def test_polynomials_on_pieces_far_from_their_roots_are_quiet(roots: list[float], order: int) -> None:
    f = product([*(1.0 + 4 * r for r in roots), *[0.0] * order])
    side = int(np.sign(f(np.array([1e-3]))[0]))
    assert is_quiet(f, side, order)
    assert not is_quiet(f, -side, order)
    assert not is_quiet(f, 0, order)


@given(separated(most=6))
def test_no_function_with_a_root_is_quiet(roots: list[float]) -> None:
    assert not any(is_quiet(product(roots), side) for side in (1, -1))


@given(st.floats(1e-12, 1e-3), st.floats(0.05, 0.95))
def test_within_the_floor_of_the_last_event_nothing_is_a_crossing(floor: float, root: float) -> None:
    """A function that starts from a zero known to `floor` only: what stays within it is open, what leaves it counts."""
    within = product([root], lambda theta: 0.5 * floor + 0 * theta)
    assert not is_quiet(within, -1, floor=floor)
    search = Search(within, side=-1, floor=floor)
    assert (search.crossings, search.end) == ([], 0)
    beyond = Search(product([root]), side=-1, floor=min(floor, 0.01 * root, 0.01 * (1 - root)))
    assert [c.direction for c in beyond.crossings] == [1]
    assert beyond.roots[0] == pytest.approx(root, rel=1e-14)


# -- double and clustered roots ---------------------------------------------------------------------------------


@given(st.floats(0.01, 0.99), separated(most=3))
def test_a_double_root_is_no_crossing_and_not_silent(double: float, roots: list[float]) -> None:
    roots = [r for r in roots if abs(r - double) > 0.02]
    search = Search(product([double, double, *roots]))
    assert_alternating(search.crossings)
    assert len(search.crossings) == len(roots)
    assert any(abs(g.theta - double) < 1e-4 for g in search.grazings)
    for g in search.grazings:
        assert g.distance <= 1e-12


@given(st.floats(0.01, 0.99))
def test_a_triple_root_is_one_crossing(triple: float) -> None:
    search = Search(product([triple] * 3))
    assert [c.direction for c in search.crossings] == [1]
    assert search.crossings[0].left <= triple <= search.crossings[0].right
    assert search.roots[0] == pytest.approx(triple, abs=1e-15)


@given(
    st.floats(0.05, 0.95),
    st.lists(st.integers(-500, 500), min_size=2, max_size=5, unique=True),
    st.sampled_from([1e-5, 1e-6, 1e-7, 1e-8]),
)
def test_a_cluster_keeps_its_parity_and_is_not_silent(centre: float, places: list[int], grid: float) -> None:
    roots = sorted(centre + grid * place for place in places)
    search = Search(product(roots, lambda theta: 1.5 + np.sin(3 * theta)))
    assert_alternating(search.crossings)
    assert (len(roots) - len(search.crossings)) % 2 == 0
    assert search.end == 1
    for root in roots:  # a cluster of five is lost in rounding over (4*184*2**-53)**(1/5) = 1e-3 around it
        assert search.mentions(root, 2e-3)


@pytest.mark.parametrize("apart", [1e-3, 1e-4, 1e-5, 1e-6, 3e-7, 1e-7, 1e-8])
@given(place=st.floats(0.001, 0.998), bend=st.floats(-3, 3), sign=st.sampled_from([-1.0, 1.0]))
def test_twin_roots_are_found_or_flagged(apart: float, place: float, bend: float, sign: float) -> None:
    """The dip between twins is apart**2/4 deep: one that the search does not resolve is a near-grazing."""
    twins = [place, place + apart]
    search = Search(product(twins, lambda theta: sign * np.exp(bend * theta)), side=int(sign))
    found = search.roots
    if len(found) == 2:
        assert [c.direction for c in search.crossings] == [-sign, sign]
        assert found[0] == pytest.approx(twins[0], abs=1e-15)
        assert found[1] == pytest.approx(twins[1], abs=1e-15)
        return
    assert not search.crossings
    largest = float(np.max(np.abs(search.f(POINTS))))
    dip = 0.25 * apart**2 * math.exp(bend * place)
    assert dip <= 2 * _ACCEPT * largest, "a dip well beyond the error bound that the search allows itself"
    assert any(abs(g.theta - place) < 1e-4 for g in search.grazings)


# -- the ends of the step ---------------------------------------------------------------------------------------


@given(separated(most=4), st.sampled_from([1.0, -2.0]))
def test_a_root_at_the_very_end_is_left_to_the_series_there(roots: list[float], scale: float) -> None:
    """The end is open (0): the caller asks for the derivatives there, and no root is found twice or lost."""
    roots = [r for r in roots if r < 0.99]
    search = Search(product([*roots, 1.0], lambda theta: scale + 0 * theta))
    assert len(search.crossings) == len(roots)
    assert search.end == 0


@pytest.mark.parametrize("order", [1, 2, 3])
@given(roots=separated(most=4), sign=st.sampled_from([1.0, -1.0]))
def test_a_decreed_zero_at_the_start_is_divided_out(order: int, roots: list[float], sign: float) -> None:
    """theta**order q(theta): the roots of q are found, the decreed one is not."""
    f = product([0.0] * order + roots, lambda theta: sign * (2.0 - theta))
    side = int(sign) * (-1) ** len(roots)
    search = Search(f, order=order, side=side)
    if search.grazings:
        assert all(search.mentions(root, 0.01) for root in roots)
        return
    assert len(search.crossings) == len(roots)
    for found, root in zip(search.roots, roots, strict=True):
        assert found == pytest.approx(root, rel=1e-13)
    assert search.end == int(sign)


@pytest.mark.parametrize("order", [1, 2, 3])
@given(
    noise=st.lists(st.floats(-1, 1), min_size=17, max_size=17),
    root=st.one_of(st.none(), st.floats(0.02, 0.98)),
)
def test_what_has_just_fired_does_not_fire_again_from_rounding(
    order: int, noise: list[float], root: float | None
) -> None:
    """Values near the decreed zero have the sign of rounding; the search must see through them."""
    clean = product([0.0] * order + ([root] if root else []))
    side = -1 if root else 1
    table = dict(zip(POINTS.tolist(), noise, strict=True))

    def f(theta: np.ndarray) -> np.ndarray:
        shaken = np.array([table.get(x, math.sin(1e6 * x)) for x in theta.tolist()])
        return clean(theta) + UNIT * shaken

    search = Search(f, order=order, side=side)
    assert [c.direction for c in search.crossings] == ([1] if root else [])
    assert not search.grazings
    if root:
        assert search.roots[0] == pytest.approx(root, abs=1e-14 / root**order)


@pytest.mark.parametrize("floor", [0.0, 1e-12])
@pytest.mark.parametrize("root", [1e-6, 1e-9, 1e-11])
def test_a_zero_next_to_a_decreed_one_is_where_the_values_change_sign(root: float, floor: float) -> None:
    """The rate at the start is within the bound of the representation; the values tell, down to rounding."""

    def f(theta: np.ndarray) -> np.ndarray:
        return theta * (root - theta) / (1.2 + np.cos(1000 * theta))

    search = Search(f, order=1, side=1, stop=-1, floor=floor, rounding=1e-30)
    assert [c.direction for c in search.crossings] == [-1]
    assert search.roots[0] == pytest.approx(root, rel=1e-12)


def test_a_decreed_side_holds_even_where_the_first_value_is_of_the_other_sign() -> None:
    """v = 0 by decree and rising, computed as -1e-17 at the start."""
    search = Search(lambda theta: theta * (1.0 + theta) - 1e-17, order=1, side=1, stop=-1)
    assert not search.crossings
    assert search.end == 1


def test_without_a_decree_a_step_that_begins_on_the_wrong_side_leaves_at_once() -> None:
    search = Search(lambda theta: -1.0 - theta, side=1, stop=-1)
    assert [(c.left, c.right, c.direction) for c in search.crossings] == [(0.0, 0.0, -1)]


# -- fast functions over a long step ----------------------------------------------------------------------------


@pytest.mark.parametrize("waves", [3, 40, 333])
def test_a_fast_guard_over_a_long_step_costs_samples_and_no_root(waves: int) -> None:
    """sin(2 pi waves theta + 1): 2 waves roots at (j pi - 1)/(2 pi waves)."""
    search = Search(lambda theta: np.sin(2 * np.pi * waves * theta + 1.0), side=1)
    expected = [(j * math.pi - 1.0) / (2 * math.pi * waves) for j in range(1, 2 * waves + 1)]
    assert len(search.crossings) == 2 * waves
    # the argument reaches 2 pi waves, and its rounding moves the roots
    assert search.roots == pytest.approx(expected, abs=4 * UNIT * (1 + 1 / waves))
    assert search.samples < 400 * waves


@given(st.floats(0.1, 0.9), st.floats(1.0, 300.0))
def test_dips_of_a_modulated_wave_that_reach_zero_are_seen(place: float, rate: float) -> None:
    """1 - cos(rate (theta - place)) (1 - (theta - place)**2) - 1e-4 is below zero only around `place`."""

    def f(theta: np.ndarray) -> np.ndarray:
        d = theta - place
        return 1.0 - np.cos(rate * d) * (1.0 - d**2) - 1e-4

    search = Search(f, side=int(np.sign(f(np.zeros(1))[0])), stop=-1)
    grid = np.linspace(0.0, 1.0, 200_001)
    values = f(grid)
    leaves = np.flatnonzero((values[1:] < 0) & (values[:-1] > 0))
    assert [c.direction for c in search.crossings if c.direction < 0] == [-1] * min(len(leaves), 1)
    if len(leaves):
        assert grid[leaves[0]] <= search.roots[-1] <= grid[leaves[0] + 1]


# -- what is no smooth function ---------------------------------------------------------------------------------


def test_a_function_that_is_zero_throughout_has_no_crossing_and_an_open_end() -> None:
    search = Search(np.zeros_like, rounding=0.0)
    assert (search.crossings, search.grazings, search.end) == ([], [], 0)
    assert search.samples < 100


@pytest.mark.parametrize("offset", [0.0, 1e-10, -1e-10])
def test_pure_rounding_is_accepted_as_such(offset: float) -> None:
    """A constant with rounding of 1e-16: halving does not help, and the search must not try for ever."""
    rng = np.random.default_rng(1)
    search = Search(lambda theta: offset + UNIT * rng.uniform(-1, 1, len(theta)), rounding=UNIT)
    assert search.samples < 10_000
    assert not search.crossings
    assert search.end == int(np.sign(offset))


def test_an_endless_search_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """A function that is noise, without a bound that would say so."""
    monkeypatch.setattr(roots, "_MAX_SUBDIVISIONS", 1000)
    rng = np.random.default_rng(1)
    with pytest.raises(StepFailure, match="max_step"):
        Search(lambda theta: rng.uniform(-1, 1, len(theta)), rounding=0.0)


@pytest.mark.parametrize("root", [0.25, 0.3, 1 / 3, 0.9])
@pytest.mark.parametrize(
    "shape",
    [
        pytest.param(np.sign, id="jump"),
        pytest.param(lambda d: np.sign(d) * np.sqrt(np.abs(d)), id="root"),
        pytest.param(lambda d: np.where(d < 0, d, 7 * d), id="corner"),
        pytest.param(np.cbrt, id="cube-root"),
    ],
)
def test_corners_and_jumps_are_located_too(root: float, shape: Function) -> None:
    search = Search(lambda theta: shape(theta - root))
    assert [c.direction for c in search.crossings] == [1]
    assert search.roots[0] == pytest.approx(root, abs=1e-12)
    assert search.samples < 100_000


def test_a_crossing_before_the_end_of_the_domain_is_found() -> None:
    search = Search(lambda theta: np.where(theta < 0.5, 0.3 - theta, np.nan), side=1, stop=-1)
    assert search.roots == pytest.approx([0.3], abs=1e-15)


def test_what_is_not_a_number_is_reported_with_its_place() -> None:
    """Not a number from 0.4 to 0.5, and a change of sign beyond: no event is made up across the gap."""
    search = Search(lambda theta: np.where((theta > 0.4) & (theta < 0.5), np.nan, 0.7 - theta), side=1)
    assert search.undefined == pytest.approx(0.4, abs=1e-7)
    assert search.roots == pytest.approx([0.7], abs=1e-15)
    search = Search(lambda theta: np.where((theta > 0.4) & (theta < 0.5), np.nan, 0.45 - theta), side=1)
    assert (search.crossings, search.end) == ([], -1)
    assert search.undefined == pytest.approx(0.4, abs=1e-7)


def test_a_square_root_is_undefined_from_its_zero_on() -> None:
    with np.errstate(invalid="ignore"):
        search = Search(lambda theta: np.sqrt(0.6 - theta), side=1, stop=-1)
    assert not search.crossings
    assert search.undefined == pytest.approx(0.6, abs=1e-7)
    assert search.undefined >= 0.6
    assert search.samples < 20_000


def test_a_function_that_never_is_a_number_costs_one_look() -> None:
    search = Search(lambda theta: np.nan * theta, side=1)
    assert (search.crossings, search.end, search.undefined) == ([], 0, 0.0)
    assert search.samples == 17


def test_a_dip_at_the_very_start_of_a_step_is_flagged() -> None:
    """The side is known and the value tiny, as after a step that ended near zero."""
    search = Search(product([1e-8, 3e-8]), side=1)
    assert not search.crossings
    assert len(search.grazings) == 1
    assert search.grazings[0].theta < 1e-4


@pytest.mark.parametrize("width", [1e-3, 1.0])
def test_a_dip_that_rounding_has_shifted_is_flagged(width: float) -> None:
    """What rounding adds to all samples alike is no misfit: the dip is above zero, and may be below it in truth."""
    theta = 0.4321
    shift = 4.0 * UNIT
    dips = Search(lambda x: ((x - theta) / width) ** 2 + shift, side=1, rounding=UNIT)
    assert dips.crossings == []
    assert [g.theta for g in dips.grazings] == [pytest.approx(theta, abs=1e-7)]
    clear = Search(lambda x: ((x - theta) ** 2 + 1e-12) / width**2, side=1, rounding=UNIT)
    assert (clear.crossings, clear.grazings) == ([], [])


def test_a_dip_within_rounding_on_the_piece_that_starts_from_zero() -> None:
    """The zero at the start is divided out; the dip behind it is told all the same."""
    search = Search(lambda s: s * ((s - 0.6) ** 2 + 4.0 * UNIT), order=1, side=1, stop=-1, rounding=UNIT)
    assert search.crossings == []
    assert [g.theta for g in search.grazings] == [pytest.approx(0.6, abs=1e-7)]
    clear = Search(lambda s: s * ((s - 0.6) ** 2 + 1e-12), order=1, side=1, stop=-1, rounding=UNIT)
    assert (clear.crossings, clear.grazings) == ([], [])


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize(("before", "flagged"), [(1e-12, 1), (1e-14, 0)])
def test_a_dip_within_what_errors_before_the_step_make_of_it(order: int, before: float, flagged: int) -> None:
    """They grow along the step, and are far beyond its own rounding."""
    search = Search(
        lambda s: s**order * ((s - 0.7) ** 2 + 2e-13),
        order=order,
        side=1,
        stop=-1,
        rounding=UNIT,
        before=lambda s: before * s**2,
    )
    assert search.crossings == []
    assert [g.theta for g in search.grazings] == [pytest.approx(0.7, abs=1e-5)] * flagged


def test_a_dip_within_rounding_before_a_zero_on_the_same_piece() -> None:
    """A rounding that is common to all values lifts it above zero; it is told all the same."""
    search = Search(lambda s: ((s - 0.3) ** 2 + 4.0 * UNIT) * (0.7 - s), side=1, stop=-1)
    assert search.samples < 100  # the step is one piece
    assert search.roots == pytest.approx([0.7], abs=1e-15)
    assert [g.theta for g in search.grazings] == pytest.approx([0.3], abs=1e-5)
    far = Search(lambda s: ((s - 0.3) ** 2 + 1e-9) * (0.7 - s), side=1, stop=-1)
    assert far.grazings == [] and far.roots == pytest.approx([0.7], abs=1e-15)
