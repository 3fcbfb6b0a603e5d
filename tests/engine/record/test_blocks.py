"""Blocks of segments and events: one sequence whatever they are made of, and the same states by every way in."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.events.zeno.accumulation import NOBODY, Accumulation, Limit, accumulated
from hybridsim.engine.record.block_list import BlockList
from hybridsim.engine.record.blocks import OccurrenceList, SegmentList
from hybridsim.engine.record.event_block import EventBlock
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.series_block import SeriesBlock
from hybridsim.engine.system.automaton import Automaton
from hybridsim.engine.system.instant import Instant


def occurrence(t: float, component: str = "c", kind: str = "transition") -> Occurrence:
    x = np.array([t])
    return Occurrence(Instant(t), kind, component, "", "a", "b", -1, x, x)


# -- chains -----------------------------------------------------------------------------------------------------


def mixed() -> tuple[BlockList[Occurrence], list[Occurrence]]:
    """Items one by one, then a block, then one by one again."""
    items = [occurrence(float(k), f"c{k % 2}") for k in range(9)]
    block_list: BlockList[Occurrence] = BlockList(OccurrenceList)
    block_list.extend(items[:3])
    block_list.add(OccurrenceList(items[3:7]))
    block_list.add(OccurrenceList())
    block_list.append(items[7])
    block_list.append(items[8])
    return block_list, items


def test_a_chain_is_a_sequence() -> None:
    block_list, items = mixed()
    assert len(block_list) == len(items)
    assert [a is b for a, b in zip(block_list, items, strict=True)] == [True] * 9
    assert [block_list[k] for k in range(-9, 9)] == items + items
    for chosen in (slice(2, 5), slice(None, None, -2), slice(-3, None)):
        assert block_list[chosen] == items[chosen]
    assert list(reversed(block_list)) == items[::-1]
    for beyond in (9, -10):
        with pytest.raises(IndexError):
            block_list[beyond]


def test_the_first_items_can_be_dropped() -> None:
    for count in range(10):
        block_list, items = mixed()
        block_list.drop(count)
        assert list(block_list) == items[count:]


def test_a_window_keeps_what_lies_in_it_and_little_more() -> None:
    block_list: BlockList[Occurrence] = BlockList(OccurrenceList, 5.0)
    for k in range(4000):
        if k % 100 < 50:
            block_list.append(occurrence(0.1 * k))
        else:
            block_list.add(OccurrenceList([occurrence(0.1 * k)]))
        assert [o.instant.high for o in block_list][-1] == 0.1 * k
        assert float(block_list[0].instant) <= max(0.1 * k - 5.0, 0.0) + 0.1
        assert len(block_list) <= 51 + 16


def test_a_window_of_none_keeps_nothing() -> None:
    block_list: BlockList[Occurrence] = BlockList(OccurrenceList, None)
    block_list.append(occurrence(0.0))
    block_list.add(OccurrenceList([occurrence(1.0)]))
    assert len(block_list) == 0


# -- what a compiled loop leaves behind -----------------------------------------------------------------------------


def stirred() -> hs.Model:
    """The reference model with a clock: compiled calls, and events that are settled the general way, in turn."""
    model = hs.load("dfcs")
    return hs.Model(
        "stirred",
        model.states,
        parameters=model.parameters,
        contacts=model.contacts,
        schedules=[hs.Schedule("kick", start=0.01, period=0.0137, reset={"v": "v + 0.01"})],
        discrete=[],
    )


RUNS = {
    "dfcs": (hs.load("dfcs"), (0, 0.3)),
    "belt": (hs.load("belt"), (0, 60)),
    "stirred": (stirred(), (0, 0.2)),
}


@pytest.fixture(scope="module", params=[(name, method) for name in RUNS for method in ("taylor", "dop853")])
def run(request: pytest.FixtureRequest) -> hs.Solution:
    name, method = request.param
    model, span = RUNS[name]
    return hs.simulate(model, span, integrator=method, rtol=1e-11)


def test_compiled_calls_leave_blocks(run: hs.Solution) -> None:
    kinds = {type(block) for block in run._of_model.record.segments.blocks}
    assert any(issubclass(kind, SeriesBlock) for kind in kinds)
    assert (SegmentList in kinds) == (run.model.name == "stirred") or len(run._of_model.record.segments) > 1


def test_segments_follow_each_other(run: hs.Solution) -> None:
    """Each begins where the one before it ended, in time and, but for resets, in state."""
    segments = run._of_model.record.segments
    for a, b in pairwise(segments):
        assert abs(b.start.minus(a.end)) <= 4 * math.ulp(float(b.start))
    times = [float(e.instant) for e in run._of_model.record.occurrences]
    assert times == sorted(times)
    assert len(times) == len(run.events) > 10


def test_a_segment_and_its_block_agree(run: hs.Solution) -> None:
    """States at random places: by the object, by the block, by the solution."""
    draw = np.random.default_rng(1)
    segments = run._of_model.record.segments
    index = np.sort(draw.integers(0, len(segments), 400))
    spans = segments.spans()[index]
    s = spans[:, 0] + draw.uniform(size=400) * (spans[:, 1] - spans[:, 0])
    together = segments.states(index, s)
    size = np.max(np.abs(together), axis=0)
    for i in np.unique(index):
        chosen, segment = index == i, segments[int(i)]
        alone = SegmentList(run._system, [segment]).states(np.zeros(chosen.sum(), dtype=np.int64), s[chosen])
        assert (np.abs(alone - together[chosen]) <= 1e-14 * size).all()
    high, low = segments.origins()[index].T
    t = high + (s + low)
    inside = (t > run._of_model.frame.starts[index]) & (t < run._of_model.frame.ends[index])
    slopes = (
        1e-15
        * np.abs(t)
        * np.max(
            [np.abs(run._system.flow(0.0, x, segments[0].p, segments[0].z)) for x in together[:50]], axis=0
        )[:, None]
    )
    assert (np.abs(run(t) - together.T)[:, inside] <= (100 * slopes + 1e-13 * size[:, None])[:, inside]).all()


def test_knots_are_those_of_the_segments(run: hs.Solution) -> None:
    segments = run._of_model.record.segments
    index, s, x = segments.knots()
    assert index.tolist() == [i for i, g in enumerate(segments) for _ in g.s]
    assert s.tolist() == [value for g in segments for value in g.s]
    assert (x == np.concatenate([g.x for g in segments])).all()
    assert run.y.shape == (2, len(run.t)) == (2, len(s))


def test_states_at_events_are_those_of_the_events(run: hs.Solution) -> None:
    """To the last bit on both sides, as the event contract says."""
    times = np.array([e.t for e in run.events if e.t < run.t_end])
    before, after = run(times, side="-").T, run(times).T
    for event, x_minus, x_plus in zip(run.events, before, after, strict=False):
        assert (x_minus == event.x_minus).all()
        assert (x_plus == event.x_plus).all()


def test_held_states_are_exact(run: hs.Solution) -> None:
    held = {"dfcs": 0.0, "belt": 0.2, "stirred": 0.0}[run.model.name]
    stops = [i for i in run.modes["f"] if i.mode == "stick"]
    assert len(stops) > 3
    for stop in stops:
        assert (run(np.linspace(stop.t0, np.nextafter(stop.t1, 0), 20))[1] == held).all()


def test_the_rest_of_a_block(run: hs.Solution) -> None:
    for block in run._of_model.record.segments.blocks:
        for first in {0, len(block) // 2, len(block) - 1}:
            rest = block.since(first)
            assert len(rest) == len(block) - first
            assert rest.until == block.until
            for a, b in ((rest[0], block[first]), (rest[len(rest) - 1], block[len(block) - 1])):
                assert a.origin == b.origin and (a.s == b.s).all() and (a.x == b.x).all()
            assert (rest.spans == block.spans[first:]).all() and (rest.modes == block.modes[first:]).all()


def test_events_out_of_arrays(run: hs.Solution) -> None:
    """Counted, one by one, in a row, by component: always the same."""
    for block in run._of_model.record.occurrences.blocks:
        if not isinstance(block, EventBlock):
            continue
        every = list(block)
        assert len(every) == len(block)
        assert [repr(block[k]) for k in range(len(block))] == [repr(o) for o in every]
        assert repr(block[-1]) == repr(every[-1])
        assert block.times.tolist() == [float(o.instant) for o in every]
        assert block.until == every[-1].instant
        for component, kind in (("f", None), ("f", "transition"), ("f", "monitor"), ("kick", None)):
            wanted = [float(o.instant) for o in every if o.component == component and kind in (None, o.kind)]
            assert block.times_of(component, kind).tolist() == wanted
        rest = block.since(len(block) // 2)
        assert [repr(o) for o in rest] == [repr(o) for o in every[len(block) // 2 :]]
    times = [e.t for e in run.events if e.component == "f"]
    assert run.event_times("f").tolist() == times


# -- many instants at once ------------------------------------------------------------------------------------------


def limits(instants: np.ndarray, cuts: list[int], resolution: float) -> tuple[Limit | None, bool]:
    """What an accumulation says of instants of one component that come in pieces."""
    watch = Accumulation(resolution)
    for piece in np.split(instants, cuts):
        limit = watch.limit_of_all(piece, np.zeros(len(piece), dtype=np.int64))
        if limit is not None:
            return limit, watch.is_under_way(float(piece[-1, 0]))
    return None, watch.is_under_way(float(instants[-1, 0]))


@pytest.mark.parametrize("kind", ["even", "random", "series", "series late", "close"])
def test_instants_at_once_or_one_by_one(kind: str) -> None:
    """In pieces of any size an accumulation is found where it is found event by event, or not at all."""
    draw = random.Random(3)
    for _ in range(40):
        gaps = [draw.uniform(0.5, 1.5) for _ in range(draw.randint(5, 120))]
        if kind == "even":
            gaps = [1.0] * len(gaps)
        if kind.startswith("series"):
            ratio = draw.uniform(0.3, 0.7)
            gaps = (gaps if kind == "series late" else []) + [ratio**k for k in range(60)]
        if kind == "close":
            gaps += [2.0**-50] * 40
        high = np.cumsum(gaps)
        instants = np.stack([high, np.zeros(len(high))], axis=1)
        one_by_one = limits(instants, list(range(1, len(gaps))), 1e-6)
        assert (one_by_one[0] is not None) == (kind in ("series", "series late", "close"))
        for size in (7, 13, 30, 200):
            assert limits(instants, list(range(size, len(gaps), size)), 1e-6) == one_by_one


@pytest.mark.parametrize("at_once", [1, 9, 30, 400])
def test_series_of_several_components_are_told_apart(at_once: int) -> None:
    """Two series with one limit, and a clock that ticks on; sums of the series as in closed form."""
    series = {0: 2.0 - 0.5 ** np.arange(60), 1: 2.0 - 0.7 ** np.arange(90), 2: np.arange(0.0, 2.0, 0.03)}
    times = np.concatenate(list(series.values()))
    owners = np.repeat(list(series), [len(part) for part in series.values()])
    order = np.argsort(times, kind="stable")
    instants, watch = np.stack([times[order], np.zeros(len(times))], axis=1), Accumulation(1e-6)
    found = []
    for k in range(0, len(times), at_once):
        limit = watch.limit_of_all(instants[k : k + at_once], owners[order][k : k + at_once])
        if limit is not None:
            found.append(limit)
            break
    assert [limit.components for limit in found] == [(0, 1)]
    assert found[0].time == pytest.approx(2.0, abs=1e-12)


def test_a_mode_is_to_be_declared_only_where_there_is_none() -> None:
    def automaton(name: str, hold: int) -> Automaton:
        return Automaton(name, ("open", "closed"), ((), ()), ((), ()), ((), ()), ((), ()), 0, -1, hold)

    automata = [automaton("p", -1), automaton("q", 1), automaton("r", 1)]
    assert accumulated(Limit(2.5, (0,), 0.1), automata, has_rtol=True).endswith(
        'events of p accumulate at t = 2.5: declare the mode after this time, limit = "MODE" of the component'
    )
    held = accumulated(Limit(2.5, (1, 2), 0.1), automata, has_rtol=True)
    assert "of q, r" in held
    assert "q.closed and r.closed cannot be entered there" in held and "declare" not in held
    assert "of monitors with resets accumulate at t = 2.5: let a monitor" in accumulated(
        Limit(2.5, (NOBODY,), 0.1), automata, has_rtol=True
    )
