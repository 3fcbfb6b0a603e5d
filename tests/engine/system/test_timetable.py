"""Scheduled times against exact fractions: none skipped, none doubled, what coincides comes together."""

from __future__ import annotations

import math
import sys
from fractions import Fraction
from types import SimpleNamespace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import hybridsim as hs
from hybridsim.engine.system.instant import Instant, multiple
from hybridsim.engine.system.signals import Signal
from hybridsim.engine.system.timetable import Timetable
from hybridsim.model import Discrete, Input, Model, Parameter, Schedule, State

FAR = Instant(1e15)


def timetable(
    *schedules: Schedule, inputs: tuple[Input, ...] = (), end: Instant = FAR, **values: float
) -> Timetable:
    parameters = tuple(Parameter(n, v) for n, v in values.items())
    model = Model("m", states=(), schedules=schedules, parameters=parameters)
    signals = tuple(Signal(i, values) for i in inputs)
    system = SimpleNamespace(model=model, values=model.parameter_values(), signals=signals)
    return Timetable(system, end)


def exact(instant: Instant) -> Fraction:
    return Fraction(instant.high) + Fraction(instant.low)


def walk(
    table: Timetable, start: Instant, forward: bool = True, most: int = 100
) -> list[tuple[Instant, tuple[int, ...]]]:
    """Appointments one after the other."""
    found: list[tuple[Instant, tuple[int, ...]]] = []
    instant = start
    while len(found) < most and (appointment := table.next(instant, forward)) is not None:
        instant = appointment.instant
        found.append((instant, appointment.schedules))
    return found


def test_single_times_in_any_order() -> None:
    table = timetable(Schedule("a", times=(3, 1, 2.5)))
    assert walk(table, Instant(0.0)) == [(Instant(t), (0,)) for t in (1.0, 2.5, 3.0)]
    assert walk(table, Instant(1.0)) == [(Instant(t), (0,)) for t in (2.5, 3.0)]
    table = timetable(Schedule("a", times=(3, 1, 2.5)), end=Instant(-1e15))
    assert walk(table, Instant(9.0), forward=False) == [(Instant(t), (0,)) for t in (3.0, 2.5, 1.0)]


def test_times_may_be_expressions_of_parameters() -> None:
    table = timetable(Schedule("a", start="T/2", period="2*T", count=2), T=0.25)
    assert walk(table, Instant(0.0)) == [(Instant(0.125), (0,)), (Instant(0.625), (0,))]


def test_a_long_list_of_times_costs_no_more_for_each() -> None:
    """The work for one appointment, counted in function calls, does not grow with the list."""

    def calls(count: int) -> int:
        table = timetable(Schedule("a", times=tuple(0.25 * k for k in range(count))))
        table.mark_done(Instant(1.0))
        counted: list[str] = []
        sys.setprofile(lambda _frame, event, _argument: counted.append(event))
        try:
            assert table.next(Instant(1.0), True).instant == Instant(1.25)
        finally:
            sys.setprofile(None)
        return len(counted)

    assert calls(1000) == calls(10)


@given(
    start=st.floats(-100, 100),
    period=st.floats(1e-3, 1e3),
    k=st.sampled_from([0, 1, 17, 10**6, 10**9]),
    at=st.floats(-0.99, 0.99),
    forward=st.booleans(),
)
def test_the_next_tick_of_a_clock_is_the_exact_one(
    start: float, period: float, k: int, at: float, forward: bool
) -> None:
    table = timetable(Schedule("a", start=start, period=period), end=FAR if forward else Instant(-1e15))
    after = multiple(start, k, period).plus(at * period)
    turns = (exact(after) - Fraction(start)) / Fraction(period)
    tick = math.floor(turns) + 1 if forward else math.ceil(turns) - 1
    if multiple(start, tick, period) == after:  # the tick itself is rounded to the pair
        tick += 1 if forward else -1
    if forward:
        tick = max(tick, 0)
    appointment = table.next(after, forward)
    if tick < 0:
        assert appointment is None
    else:
        assert appointment.instant == multiple(start, tick, period)
        assert appointment.schedules == (0,)


@given(st.floats(1e-3, 1e3), st.floats(-10, 10), st.integers(1, 6), st.booleans())
def test_a_counted_clock_ticks_that_often_both_ways(
    period: float, start: float, count: int, forward: bool
) -> None:
    """Also when it is met from far beyond its last tick."""
    end = Instant(start + 1e6 * period if forward else start - 1e6 * period)
    begin = Instant(start - 3 * period if forward else start + 1e5 * period)
    ticks = walk(timetable(Schedule("a", start=start, period=period, count=count), end=end), begin, forward)
    expected = [multiple(start, k, period) for k in range(count)]
    assert [t for t, _ in ticks] == (expected if forward else expected[::-1])


def test_a_start_alone_is_one_time() -> None:
    assert walk(timetable(Schedule("a", start=2)), Instant(0.0)) == [(Instant(2.0), (0,))]


def test_a_thousand_ticks_a_million_periods_out_have_no_gap() -> None:
    begin = multiple(0.3, 10**6, 0.1)
    ticks = walk(timetable(Schedule("a", start=0.3, period=0.1)), begin, most=1000)
    true = [Fraction(0.3) + (10**6 + 1 + k) * Fraction(0.1) for k in range(1000)]
    assert all(abs(exact(t) - e) < Fraction(1, 10**25) for (t, _), e in zip(ticks, true, strict=True))


# -- coincidence ------------------------------------------------------------------------------------------------


@given(
    hundredths=st.integers(1, 60), ratio=st.integers(2, 7), k=st.sampled_from([1, 3, 10, 77, 12_345, 10**6])
)
def test_two_clocks_meet_where_their_decimal_periods_do(hundredths: int, ratio: int, k: int) -> None:
    """0.01*n and its multiple, as somebody writes them: as doubles they miss each other by up to two ulps."""
    slow, fast = hundredths * ratio / 100, hundredths / 100
    clocks = Schedule("slow", period=slow), Schedule("fast", period=fast)
    table = timetable(*clocks)
    before = multiple(0.0, k, slow).plus(-0.5 * fast)
    meeting = table.next(before, True)
    assert meeting.schedules == (0, 1)
    assert abs(exact(meeting.instant) - k * Fraction(slow)) <= 2 * Fraction(math.ulp(k * slow))
    following = table.next(meeting.instant, True)
    assert following.schedules == (1,), "neither comes twice"
    assert following.instant.minus(meeting.instant) == pytest.approx(fast, rel=1e-6)
    backward = timetable(*clocks, end=Instant(-1e15))
    assert backward.next(following.instant.plus(-0.1 * fast), False).schedules == (0, 1)


def test_neighbours_that_are_not_rounding_stay_apart() -> None:
    table = timetable(Schedule("a", times=(1.0,)), Schedule("b", times=(1.0 + 8 * 2.0**-52,)))
    assert [k for _, k in walk(table, Instant(0.0))] == [(0,), (1,)]


@given(
    st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=6), min_size=1, max_size=3),
    st.lists(st.integers(0, 12), max_size=4, unique=True),
    st.sampled_from([1.0, 1e6]),
)
def test_each_time_of_a_close_row_occurs_once(
    schedules: list[list[int]], knots: list[int], start: float
) -> None:
    """Times that lie a few units in the last place apart are merged in some way, but none is lost or doubled."""
    ulp = math.ulp(start)
    listed = [Schedule(f"s{k}", times=[start + n * ulp for n in row]) for k, row in enumerate(schedules)]
    times = [start - 1.0, *(start + n * ulp for n in sorted(knots)), start + 1.0]
    knotted = Input("u", "table", times=times, values=list(range(len(times))))
    table = timetable(*listed, inputs=(knotted,))
    instant, counts = Instant(start - 0.5), [0] * len(schedules)
    while (appointment := table.next(instant, True)) is not None:
        instant = appointment.instant
        table.mark_done(appointment)
        for k in appointment.schedules:
            counts[k] += 1
    assert counts == [len(row) for row in schedules]


@pytest.mark.parametrize("integrator", ["exact", "dop853", "rodas5p", "rk4-dichotomy"])
@pytest.mark.parametrize("start", [0.0, 1e6])
@pytest.mark.parametrize("others", [(), (1, 3)])
def test_a_run_counts_times_that_are_two_roundings_apart(
    others: tuple[int, ...], start: float, integrator: str
) -> None:
    ulp = math.ulp(start + 1.0)
    first = Schedule("s", times=[start + 1.0 + n * ulp for n in (0, 2, 4)], reset={"n": "+= 1"})
    second = [Schedule("o", times=[start + 1.0 + n * ulp for n in others], reset={"m": "+= 1"})]
    model = Model(
        "row",
        states=(State("x", 0, "1"),),
        discrete=(Discrete("n", 0), Discrete("m", 0)),
        schedules=(first, *(second if others else ())),
    )
    options = {"step": 0.25} if integrator == "rk4-dichotomy" else {}
    sol = hs.simulate(model, (start, start + 2.0), integrator=integrator, **options)
    assert sol.output("n", start + 2.0) == 3 and sol.output("m", start + 2.0) == len(others)


@settings(max_examples=60)
@given(
    st.sampled_from([(0.0, 1.0), (-3.0, -2.0), (1e6, 1e6 + 1.0), (0.5, 1.0)]),
    st.lists(st.integers(0, 10), min_size=1, max_size=5),
    st.lists(st.integers(-3, 12), max_size=4, unique=True),
)
@example((-3.0, -2.0), [2], [0])
@example((0.0, 1.0), [2, 4], [0, 1])
def test_a_run_in_steps_counts_each_time_once(
    span: tuple[float, float], row: list[int], stops: list[int]
) -> None:
    """The steps end beside the times, in front of a power of two, and behind it."""
    start, middle = span
    ulp = math.ulp(middle)
    model = Model(
        "row",
        states=(State("x", 0, "1"),),
        discrete=(Discrete("n", 0),),
        schedules=(Schedule("s", times=[middle + k * ulp for k in row], reset={"n": "+= 1"}),),
    )
    sim = hs.Simulator(model, integrator="exact")
    sim.start(start)
    for stop in [*(middle + k * ulp for k in sorted(stops)), middle + 1.0]:
        sim.advance(stop)
    assert sim.output("n") == len(row)


def test_the_knot_of_an_input_joins_a_tick() -> None:
    square = Input("u", "wave", shape="square", period=0.3)
    table = timetable(Schedule("a", period=0.1), inputs=(square,))
    found = walk(table, Instant(0.0), most=6)
    assert [float(t) for t, _ in found] == pytest.approx([0.1, 0.15, 0.2, 0.3, 0.4, 0.45])
    assert [k for _, k in found] == [(0,), (), (0,), (0,), (0,), ()]


# -- the ends of a run ------------------------------------------------------------------------------------------


def test_only_the_very_first_tick_is_due_at_the_start() -> None:
    table = timetable(
        Schedule("offset", start=0.5, period=1), Schedule("zero", period=1), Schedule("list", times=(2, 0.5))
    )
    assert table.due_at_start(Instant(0.0)) == (1,)
    assert table.due_at_start(Instant(0.5)) == (0, 2)
    assert table.due_at_start(Instant(1.0)) == ()
    assert table.next(Instant(0.0), True).instant == Instant(0.5), "what is due at the start is not due again"


@pytest.mark.parametrize(
    ("period", "end", "ticks"),
    [(0.1, 0.3, 3), (0.1, 0.7, 7), (0.01, 0.57, 57), (0.7, 2.1, 3), (0.1, 1e5, 10**6)],
)
def test_the_last_tick_meets_the_end_of_the_run(period: float, end: float, ticks: int) -> None:
    """3*0.1 is not 0.3 in doubles; the third tick of a run to 0.3 is still one of its events."""
    table = timetable(Schedule("a", period=period), end=Instant(end))
    before = multiple(0.0, ticks, period).plus(-0.5 * period)
    last = table.next(before, True)
    assert last.instant == Instant(end)
    assert last.schedules == (0,)
    short = timetable(Schedule("a", period=period), end=Instant(end * (1 - 1e-12)))
    assert short.next(before, True) is None


@pytest.mark.parametrize("integrator", ["scipy-dop853", "rk4-dichotomy"])
def test_a_run_counts_its_ticks(integrator: str) -> None:
    options = {"step": 0.01} if integrator == "rk4-dichotomy" else {}
    model = Model(
        "clock",
        states=(State("x", 0, "1"),),
        discrete=(Discrete("n", 0),),
        schedules=(Schedule("tick", period=0.1, reset={"n": "n + 1"}),),
    )
    sol = hs.simulate(model, (0.0, 0.7), integrator=integrator, **options)
    assert [e.t for e in sol.events] == pytest.approx([0.1 * k for k in range(8)], abs=1e-15)
    assert sol.events[-1].t == 0.7
