"""What remains of a simulator after an error or Ctrl-C, in other threads and processes, and in a callback."""

from __future__ import annotations

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.run.mode_loop import ModeLoop

from .test_steps import block

LOAD = """
schema = 1
name = "loaded"
[inputs]
N = { kind = "held", value = 2 }
[states]
x = { start = 0, der = "v" }
v = { start = 3, der = "-f" }
[contacts.f]
velocity = "v"
normal = "N - t"
law = { name = "coulomb", mu = "0.5" }
"""


def test_after_an_error_it_stands_just_after_the_last_event() -> None:
    """The load 2 - t is negative after t = 2. At t = 1 a tick happens, and the error comes later."""
    model = hs.Model.from_toml(LOAD + "[clocks.tick]\nperiod = 1\noffset = 1\nset = { x = '0' }\n")
    sim = hs.Simulator(model, integrator="taylor")
    sim.start(0.0)
    with pytest.raises(hs.SimulationError, match="inconsistent"):
        sim.advance(4.5)
    assert sim.t == 1.0
    # x is what the tick at t = 1 makes it, and v = 3 - (2 - 1/2)/2
    assert sim.state == {"x": 0.0, "v": pytest.approx(2.25, rel=1e-14)}
    # a larger load lets the motion go on; the tick that was not returned comes first
    events = sim.advance(1.5, {"N": 10.0})
    assert [(event.component, event.t) for event in events] == [("tick", 1.0)]
    assert sim.state["v"] == pytest.approx(2.25 - 0.5 * (10 * 0.5 - (1.5**2 - 1) / 2), rel=1e-12)


def test_a_change_that_allows_no_motion_leaves_the_state_before_it() -> None:
    sim = hs.Simulator(hs.Model.from_toml(LOAD), integrator="taylor")
    sim.start(0.0)
    sim.advance(1.0)
    before = sim.state
    with pytest.raises(hs.SimulationError):
        sim.set({"N": -5.0})
    assert (sim.t, sim.state, sim.inputs) == (1.0, before, {"N": 2.0})
    sim.advance(1.25)
    assert sim.state["v"] == pytest.approx(3 - 0.5 * (2 * 1.25 - 1.25**2 / 2), rel=1e-12)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError("no space left")])
def test_ctrl_c_and_errors_leave_a_state_to_go_on_from(
    error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ball that bounces at sqrt(2/9.81) is interrupted in its second flight."""
    first = np.sqrt(2 / 9.81)
    floor = hs.Guard("floor", "h", hs.Choice("air", reset={"h": 0, "w": "-w/2"}))
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1, "w"), hs.State("w", 0, "-9.81")],
        components=[hs.Component("ball", [hs.Mode("air", floor)])],
    )
    sim = hs.Simulator(ball, integrator="scipy-dop853")
    sim.start(0.0)

    def interrupted(loop: Any, instant: Any) -> None:
        if float(instant) > first + 0.05:
            raise error

    with monkeypatch.context() as patch:
        patch.setattr(ModeLoop, "_progress", interrupted)
        with pytest.raises(type(error)):
            sim.advance(0.7)
    assert sim.t == pytest.approx(first, rel=1e-9)
    assert sim.state["w"] == pytest.approx(0.5 * 9.81 * first, rel=1e-9)
    (event,) = sim.advance(0.7)
    assert event.t == pytest.approx(first, rel=1e-9)
    assert sim.state["w"] == pytest.approx(0.5 * 9.81 * first - 9.81 * (0.7 - first), rel=1e-9)


def test_one_thread_owns_a_simulator_and_a_copy_belongs_to_who_takes_it() -> None:
    sim = block()
    sim.start(0.0)
    with ThreadPoolExecutor(1) as pool:
        for call in (
            lambda: sim.advance(1.0),
            lambda: sim.set({"F": 1.0}),
            sim.reset,
            lambda: sim.start(0.0),
        ):
            with pytest.raises(hs.UsageError, match="belongs to thread 'MainThread', and 'ThreadPool"):
                pool.submit(call).result()
        other = pool.submit(lambda: copy.copy(sim)).result()
        with pytest.raises(hs.UsageError, match="belongs to thread 'ThreadPool"):
            other.advance(1.0)
        pool.submit(lambda: other.advance(1.0, {"F": 24.0})).result()
    assert (sim.t, other.t) == (0.0, 1.0)


def test_many_threads_with_copies_agree_to_the_bit() -> None:
    sim = block("taylor")
    sim.start(0.0)

    def drive(copied: list[Any]) -> None:
        own = sim.copy()
        for k in range(1, 40):
            own.advance(k / 10, {"F": 30.0 * np.sin(k)})
        copied.append(own.state)

    results: list[Any] = []
    threads = [threading.Thread(target=drive, args=(results,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    assert all(result == results[0] for result in results)


def test_a_call_within_a_call_is_refused_and_another_simulator_is_not() -> None:
    inner = block()
    inner.start(0.0)
    holder: list[hs.Simulator] = []
    refused: list[str] = []

    class Rate:
        """A rate that drives another simulator, and then its own."""

        def __call__(self, t: float, x: Any, p: Any) -> Any:
            if t > 0.25 and not refused:
                inner.advance(1.0, {"F": 24.0})
                try:
                    holder[0].advance(2.0)
                except hs.UsageError as error:
                    refused.append(str(error))
            return (-x[0],)

    sim = hs.Simulator(hs.Model("outer", states={"x": 1}, flow=Rate()), integrator="scipy-dop853")
    holder.append(sim)
    sim.start(0.0)
    sim.advance(1.0)
    assert "during another call of the same simulator" in refused[0]
    assert inner.state["v"] == pytest.approx(2.0, rel=1e-12)
    assert sim.state["x"] == pytest.approx(np.exp(-1.0), rel=1e-9)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "moreau"])
def test_a_pickle_is_text_and_goes_on_bit_for_bit(integrator: str) -> None:
    options = {"step": 0.01} if integrator == "moreau" else {}
    sim = block(integrator, **options)
    sim.start(0.0)
    sim.advance(0.3, {"F": 30.0})
    stored, saved = pickle.dumps(sim), pickle.dumps(sim.save())
    assert b"schema = 1" in stored
    again = pickle.loads(stored)
    third = sim.copy()
    for each in (sim, again):
        each.advance(0.9, {"F": -40.0})
        each.advance(1.7)
    assert again.state == sim.state
    third.restore(pickle.loads(saved))
    third.advance(0.9, {"F": -40.0})
    third.advance(1.7)
    assert third.state == sim.state
    again.reset()
    assert (again.t, again.inputs) == (0.0, {"F": 0.0})


def test_a_saved_state_of_another_model_or_with_other_settings_is_refused() -> None:
    sim, other = block(), hs.Simulator("dfcs", integrator="exact")
    sim.start(0.0)
    other.start(0.0)
    with pytest.raises(hs.UsageError, match="belongs to another model, dfcs"):
        sim.restore(other.save())
    finer = block("taylor", rtol=1e-12)
    finer.start(0.0)
    with pytest.raises(hs.UsageError, match="belongs to other settings"):
        sim.restore(finer.save())


def test_a_monitor_that_terminates_ends_the_steps() -> None:
    model = hs.Model(
        "fall", states=[hs.State("h", 1, "w"), hs.State("w", 0, "-9.81")],
        monitors=[hs.Monitor("floor", "h", action="terminate")],
    )  # fmt: skip
    sim = hs.Simulator(model, integrator="taylor")
    sim.start(0.0)
    (event,) = sim.advance(2.0)
    assert event.t == sim.t == pytest.approx(np.sqrt(2 / 9.81), rel=1e-14)
    assert "ended by floor" in sim.ended
    with pytest.raises(hs.UsageError, match="the run has ended by floor"):
        sim.advance(3.0)
    sim.reset()
    assert (sim.t, sim.ended) == (0.0, "")
