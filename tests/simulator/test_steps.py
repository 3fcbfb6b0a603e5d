"""A simulator in steps: held inputs against closed forms, and steps against straight runs."""

from __future__ import annotations

import json
import math
import pickle
from copy import deepcopy
from html import escape
from typing import Any

import pytest

import hybridsim as hs

BLOCK = """
schema = 1
name = "block"
[parameters]
m = 2
mu = 0.5
N = 40
[inputs]
F = { kind = "held", value = 0, unit = "N" }
[states]
x = { start = 0, der = "v" }
v = { start = 0, der = "(F - f)/m" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "coulomb", mu = "mu" }
"""
METHODS = ("exact", "taylor", "dop853", "rodas5p", "scipy-dop853")


def block(integrator: str = "exact", **options: Any) -> hs.Simulator:
    """A block of 2 kg with a friction of at most 20 N, pulled by a held force F."""
    return hs.Simulator(hs.Model.from_toml(BLOCK), integrator=integrator, **options)


def changes(events: tuple[hs.Event, ...]) -> list[tuple[float, str, str]]:
    return [(event.t, event.source, event.target) for event in events]


@pytest.mark.parametrize("integrator", METHODS)
def test_a_held_force_releases_and_stops_a_contact_at_the_very_time(integrator: str) -> None:
    sim = block(integrator)
    assert sim.start(0.0) == ()
    assert sim.advance(0.7, {"F": 10.0}) == ()
    assert (sim.state["x"], sim.output("f"), sim.modes) == (0.0, 10.0, {"f": "stick"})
    assert changes(sim.set({"F": 30.0})) == [(0.7, "stick", "slip+")]
    assert (sim.output("f"), sim.output("F"), sim.inputs) == (20.0, 30.0, {"F": 30.0})
    assert sim.advance(1.0) == ()
    # 10 N accelerate 2 kg for 0.3 s
    assert sim.state["v"] == pytest.approx(1.5, rel=1e-12)
    assert sim.state["x"] == pytest.approx(0.225, rel=1e-12)
    # 30 N slow it down, and it stops after 0.1 s
    ((t, source, target),) = changes(sim.advance(2.0, {"F": -10.0}))
    assert (source, target) == ("slip+", "stick")
    assert t == pytest.approx(1.1, rel=1e-12)
    assert sim.state["x"] == pytest.approx(0.3, rel=1e-11)
    assert sim.state["v"] == 0.0


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    ("force", "mode", "rate"),
    [(0.0, "stick", 0.0), (20.0, "stick", 0.0), (40.0, "slip+", 10.0), (-40.0, "slip-", -10.0)],
)
def test_a_force_set_at_the_instant_of_a_stop_decides_what_follows(
    integrator: str, force: float, mode: str, rate: float
) -> None:
    """A block with 1 m/s and 16 N of friction stops after 0.125 s, where the force meets v = 0."""
    model = hs.Model.from_toml(BLOCK).with_(N=32)
    sim = hs.Simulator(model, integrator=integrator)
    sim.start(0.0, x0={"v": 1.0})
    ((t, *_),) = changes(sim.advance(0.125))
    assert t == pytest.approx(0.125, abs=1e-15)
    assert sim.modes == {"f": "stick"}
    sim.set({"F": force * 0.8})
    assert sim.modes == {"f": mode}
    sim.advance(1.125)
    assert sim.state["v"] == pytest.approx(0.8 * rate, rel=1e-12)


@pytest.mark.parametrize("integrator", METHODS)
def test_steps_that_end_at_knots_are_the_run_with_these_knots(integrator: str) -> None:
    """A discrete force that schedules reset where the held input is set: the same bits."""
    times, values = [0.5, 0.8125, 1.25, 2.0], [30.0, -10.0, -35.0, 22.5]
    text = BLOCK.replace("inputs", "discrete").replace('kind = "held", value = 0, unit = "N"', "start = 0")
    for t, value in zip(times, values, strict=True):
        text += f"[schedules.at{str(t).replace('.', '_')}]\ntimes = [{t}]\nreset = {{ F = {value} }}\n"
    whole = hs.simulate(hs.Model.from_toml(text), (0, 3), integrator=integrator)
    sim, events = block(integrator), []
    sim.start(0.0)
    for t, value in zip(times, values, strict=True):
        events += sim.advance(t)
        events += sim.set({"F": value})
    events += sim.advance(3.0)
    assert events == [event for event in whole.events if event.kind != "scheduled"]
    assert list(sim.state.values()) == whole.y[:, -1].tolist()


@pytest.mark.parametrize("integrator", METHODS)
def test_an_unchanged_value_changes_no_bit(integrator: str) -> None:
    plain, told = block(integrator), block(integrator)
    for sim in (plain, told):
        sim.start(0.0)
        sim.set({"F": 30.0})
    for k in range(1, 9):
        assert plain.advance(k / 7) == told.advance(k / 7, {"F": 30.0})
        assert plain.state == told.state


@pytest.mark.parametrize("integrator", METHODS)
def test_pieces_that_end_at_events_are_the_straight_run(integrator: str) -> None:
    straight = hs.simulate("dfcs", (0, 0.05), integrator=integrator)
    sim, events = hs.Simulator("dfcs", integrator=integrator), []
    sim.start(0.0)
    for t in (*dict.fromkeys(event.t for event in straight.events), 0.05):
        events += sim.advance(t)
    assert [(e.component, e.source, e.target) for e in events] == [
        (e.component, e.source, e.target) for e in straight.events
    ]
    assert [e.t for e in events] == pytest.approx([e.t for e in straight.events], rel=1e-12)
    assert list(sim.state.values()) == pytest.approx(straight.y[:, -1].tolist(), rel=1e-9)


def test_a_copy_and_a_saved_state_go_their_own_ways() -> None:
    sim = block()
    sim.start(0.0)
    sim.advance(0.25, {"F": 24.0})
    saved, other = sim.save(), sim.copy()
    sim.advance(1.0, {"F": 40.0})
    assert (other.t, other.state["v"], other.inputs) == (0.25, 0.5, {"F": 24.0})
    other.advance(1.0)
    assert other.state["v"] == pytest.approx(2.0, rel=1e-12)
    assert sim.state["v"] == pytest.approx(8.0, rel=1e-12)
    sim.restore(saved)
    sim.advance(1.0)
    assert sim.state == other.state
    sim.reset()
    assert (sim.t, sim.state) == (0.0, {"x": 0.0, "v": 0.0})


def test_a_whole_run_does_not_move_the_steps() -> None:
    sim = block()
    sim.start(0.0)
    sim.advance(0.5, {"F": 30.0})
    before = sim.state
    # a run of its own, in which the input keeps the value of its start
    assert sim.run((0, 1), x0={"F": 40.0}).y[1, -1] == pytest.approx(10.0, rel=1e-12)
    assert sim.run((0, 1), params={"N": 0.5}, x0={"F": 1.25}).y[1, -1] == pytest.approx(0.5, rel=1e-12)
    assert (sim.t, sim.state) == (0.5, before)


def test_wrong_calls_are_refused_and_change_nothing() -> None:
    sim = block()
    with pytest.raises(hs.UsageError, match="has not started"):
        _ = sim.t
    with pytest.raises(hs.UsageError, match=r"advance\(\) needs a simulator that has started"):
        sim.advance(1.0)
    sim.start(0.0)
    sim.advance(1.0)
    before = sim.state
    for call, message in (
        (lambda: sim.advance(0.5), "already at 1.0"),
        (lambda: sim.advance(math.nan), "`to` cannot be nan"),
        (lambda: sim.advance(2.0, {"G": 1.0}), "`inputs` contains 'G', which is not a held input"),
        (lambda: sim.advance(2.0, {"F": math.inf}), "`inputs` of F cannot be inf"),
        (lambda: sim.set(3.0), "`inputs` cannot be 3.0"),
        (lambda: sim.output("q"), "no quantity 'q'"),
        (lambda: sim.restore(3), "`saved` cannot be 3"),
    ):
        with pytest.raises(hs.UsageError, match=message):
            call()
        assert (sim.t, sim.state) == (1.0, before)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (lambda sim: sim.state.__setitem__("x", 1), ("sim.state['x']", "set to 1", "x0={name: value}")),
        (lambda sim: sim.state.update(x=1), ("sim.state", "cannot be changed", "sim.start(")),
        (lambda sim: sim.modes.__setitem__("f", "slip+"), ("sim.modes['f']", "'slip+'", "z0={name: mode}")),
        (lambda sim: sim.inputs.__setitem__("F", 3.0), ("sim.inputs['F']", "3.0", "sim.advance(to, inputs=")),
        (lambda sim: sim.inputs.__delitem__("F"), ("sim.inputs['F']", "deleted", "sim.set(")),
        (lambda sim: sim.state.__ior__({"x": 1}), ("sim.state",)),
        (lambda sim: sim.state.pop("x"), ("sim.state",)),
    ],
)
def test_what_is_read_cannot_be_assigned(change: Any, parts: tuple[str, ...]) -> None:
    sim = block()
    sim.start(0.0)
    with pytest.raises(hs.UsageError) as caught:
        change(sim)
    assert all(part in str(caught.value) for part in parts)


def test_what_is_read_is_a_dict_and_its_copies_are_ordinary_ones() -> None:
    sim = block()
    sim.start(0.0)
    assert sim.state == {"x": 0.0, "v": 0.0} and json.loads(json.dumps(sim.state)) == sim.state
    for copy in (
        sim.state.copy(),
        deepcopy(sim.state),
        pickle.loads(pickle.dumps(sim.state)),
        sim.state | {},
    ):
        assert type(copy) is dict
        copy["x"] = 1.0
    assert sim.state["x"] == 0.0


def test_a_simulator_shows_where_it_is() -> None:
    """Below the limit of 20 N the block rests; above it, (30 - 20)/2 = 5 m/s^2 act for 0.5 s."""
    sim = block("auto")
    assert repr(sim) == "Simulator of block by auto: not started"
    sim = block()
    sim.start(0.0)
    sim.advance(0.5, {"F": 30.0})
    assert repr(sim).splitlines() == [
        "Simulator of block by exact: at t = 0.5",
        "  state   x = 0.625, v = 2.5",
        "  inputs  F = 30",
        "  modes   f slip+",
    ]
    assert sim._repr_html_() == f"<pre>{escape(repr(sim))}</pre>"
