"""What a run leaves behind that its compiled loop did in one call is made on demand, and is what it is otherwise."""

from __future__ import annotations

import gc
import pickle
import tracemalloc
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.run.compiled_loop import CompiledLoop
from hybridsim.engine.run.method_kernels import STEPS_PER_LOOK
from hybridsim.engine.run.mode_loop import ModeLoop
from hybridsim.engine.run.segment_run import SegmentRun
from hybridsim.engine.run.single_call import LazyTrajectory
from hybridsim.engine.system.failures import StepFailure
from hybridsim.errors import RunInterrupted

ENGINES = ["exact", "taylor", "dop853", "tsit5"]
ENOUGH = {"seconds": 1e6}  # a run with limits goes through the mode loop from the first call on


def pair() -> hs.Model:
    """Two bodies on a moving belt, whose events are of two components."""
    states = [
        hs.State("x1", 0.0, "v1"),
        hs.State("v1", 0.0, "0.8*sin(1.3*t) - 0.7*(x1 - x2) - x1 - f1"),
        hs.State("x2", 0.0, "v2"),
        hs.State("v2", 0.0, "0.7*(x1 - x2) - x2 - f2"),
    ]
    contacts = [
        hs.Contact(name, velocity=f"{v} - 0.1", normal=1, law="coulomb", arguments={"mu": 0.3})
        for name, v in (("f1", "v1"), ("f2", "v2"))
    ]
    return hs.Model("pair", states, contacts=contacts)


def struck() -> hs.Model:
    """A driven mass on a spring that strikes a stop and leaves it at speed."""
    stop = hs.Guard("stop", "0.3 - x", hs.Choice("free", reset={"x": "0.3", "v": "-0.7*v"}))
    states = [hs.State("x", 0.0, "v"), hs.State("v", 0.0, "sin(1.6*t) - 0.1*v - x")]
    return hs.Model("struck", states, components=[hs.Component("mode", hs.Mode("free", stop))])


def bouncing() -> hs.Model:
    """A ball whose bounces accumulate."""
    return hs.load("bouncing-ball")


def content(sol: hs.Solution, save: str) -> list[Any]:
    """All that a run found, to the last bit."""
    cost = {name: value for name, value in sol.stats.items() if "time" not in name}
    found: list[Any] = [sol.status, sol.warnings, cost]
    if save != "nothing":
        found += [
            [(e.t, e.component, e.guard, e.source, e.target, *e.x_minus, *e.x_plus) for e in sol.events]
        ]
        found += [sol.modes]
    return [*found, sol.t.tolist(), sol.y.tolist()]


def is_at_once(sol: hs.Solution) -> bool:
    """Whether most of the record has still to be made."""
    record = sol._of_model.record
    return isinstance(record, LazyTrajectory) and "warnings" not in vars(record)


@pytest.mark.parametrize("save", ["all", "events", "nothing"])
@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_made_later_is_what_was_made_at_once(engine: str, save: str) -> None:
    for model, end in ((hs.load("dfcs"), 0.5), (pair(), 60.0), (struck(), 100.0)):
        options: dict[str, Any] = {"integrator": engine, "keep": save}
        wanted = content(hs.simulate(model, (0, end), limits=ENOUGH, **options), save)
        hs.simulate(model, (0, end), **options)
        sol = hs.simulate(model, (0, end), **options)
        # with little kept, what the loop wrote would take more memory than the record
        is_unexamined = engine in ("exact", "taylor") or sol.stats["steps"] < STEPS_PER_LOOK
        assert is_at_once(sol) == (save == "all" or (save == "events" and is_unexamined))
        assert content(sol, save) == wanted


@pytest.mark.parametrize("engine", ENGINES)
def test_events_and_states_alone_make_no_record(engine: str) -> None:
    model = pair()
    whole = hs.simulate(model, (0, 60), limits=ENOUGH, integrator=engine)
    hs.simulate(model, (0, 60), integrator=engine)
    sol = hs.simulate(model, (0, 60), integrator=engine)
    for name in ("f1", "f2"):
        assert sol.event_times(name).tolist() == [e.t for e in whole.events if e.component == name] != []
    cost = {name: value for name, value in sol.stats.items() if "time" not in name}
    assert cost == {name: whole.stats[name] for name in cost}
    assert len(sol.events) == len(whole.events)
    times = np.linspace(0, 60, 101)
    assert np.array_equal(sol(times), whole(times))
    assert sol.modes == whole.modes
    assert is_at_once(sol)
    assert sol.warnings == whole.warnings
    assert not is_at_once(sol)


@pytest.mark.parametrize("save", ["events", "nothing"])
@pytest.mark.parametrize("engine", ENGINES)
def test_what_waits_takes_no_more_memory_than_what_is_made(engine: str, save: str) -> None:
    model = pair()
    for _ in range(40):  # machine code is made, or read, once modes have taken many steps
        hs.simulate(model, (0, 20), integrator=engine, keep=save)

    def held(**options: Any) -> int:
        """Bytes that sixteen solutions hold."""
        # leaves free as many blocks of memory as are ever kept to be handed on
        before = [hs.simulate(model, (0, 20), integrator=engine, keep=save, **options) for _ in range(8)]
        del before
        gc.collect()
        tracemalloc.start()
        kept = [hs.simulate(model, (0, 20), integrator=engine, keep=save, **options) for _ in range(16)]
        gc.collect()
        size = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        del kept
        return size

    # the least of two: what is made once meanwhile, such as machine code of another thread, is not held by solutions
    made, waiting = (min(held(**options) for _ in range(2)) for options in ({"limits": ENOUGH}, {}))
    assert waiting <= 1.1 * made


@pytest.mark.parametrize("options", [{}, {"limits": ENOUGH}])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_that_is_over_is_let_go_at_once(engine: str, options: dict[str, Any]) -> None:
    """The blocks that its compiled loop wrote to are megabytes, and do not wait for a collection of garbage."""
    model = hs.load("feeny-moon")  # some of its segments go through the general loop
    gc.collect()
    earlier = {
        id(o) for o in gc.get_objects() if issubclass(type(o), (ModeLoop, SegmentRun))
    }  # of other tests
    gc.disable()
    try:
        for _ in range(3):
            hs.simulate(model, (0, 30), integrator=engine, keep="nothing", **options)
        made = [
            o
            for o in gc.get_objects()
            if issubclass(type(o), (ModeLoop, SegmentRun)) and id(o) not in earlier
        ]
        assert not made
    finally:
        gc.enable()


def test_who_breaks_off_while_it_is_made_asks_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C at a question does not turn a finished run into one that was interrupted."""
    model = pair()
    wanted = content(hs.simulate(model, (0, 60), integrator="exact"), "all")
    sol = hs.simulate(model, (0, 60), integrator="exact")

    def broken(*_: Any) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(CompiledLoop, "advance", broken)
        with pytest.raises(KeyboardInterrupt):
            sol.warnings  # noqa: B018  # reading it is the test
    assert content(sol, "all") == wanted


@pytest.mark.parametrize("engine", ENGINES)
def test_later_runs_leave_an_earlier_one_as_it_was(engine: str) -> None:
    model = pair()
    sols = [hs.simulate(model, (0, 60), integrator=engine) for _ in range(4)]
    again = content(sols[0], "all")
    for sol in reversed(sols[1:]):
        assert content(sol, "all") == again


@pytest.mark.parametrize("engine", ["taylor", "dop853"])
def test_events_that_accumulate_are_not_put_off(engine: str) -> None:
    model = bouncing()
    sols = [hs.simulate(model, (0, 5.0), integrator=engine) for _ in range(3)]
    assert not any(map(is_at_once, sols))
    assert content(sols[2], "all") == content(sols[0], "all")
    assert sols[2].modes["mode"][-1].mode == "rest"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_is_stored_and_resumed_before_it_is_looked_at(engine: str) -> None:
    model = pair()
    hs.simulate(model, (0, 60), integrator=engine)
    sol, other = (hs.simulate(model, (0, 60), integrator=engine) for _ in range(2))
    assert is_at_once(sol)
    assert content(pickle.loads(pickle.dumps(sol)), "all") == content(other, "all")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("error", "status"), [(KeyboardInterrupt(), "interrupted"), (StepFailure("no step"), "step-failure")]
)
def test_an_error_of_the_first_call_ends_the_run_as_ever(
    engine: str, error: BaseException, status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = pair()
    hs.simulate(model, (0, 60), integrator=engine)

    def broken(*_: Any) -> Any:
        raise error

    monkeypatch.setattr(CompiledLoop, "go", broken)
    try:
        sol = hs.simulate(model, (0, 60), integrator=engine)
    except RunInterrupted as stopped:
        sol = stopped.solution
        assert status == "interrupted"
    assert sol.status == status
