"""A load, or another guard, that reaches zero where an input or a corner in time begins a new piece: nothing happens.

Truth: the speed falls by mu times the area under the load, and the way is its integral.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

INTEGRATORS = ["exact", "taylor", "dop853", "tsit5"]
SLIDING = """schema = 1
name = "sliding"
[parameters]
P = 50
[states]
x = {{ start = 0, der = "v", nominal = 1 }}
v = {{ start = {v}, der = "{force} - f", nominal = 1 }}
[contacts.f]
velocity = "v"
normal = "{load}"
law = {{ name = "coulomb", mu = 0.4 }}
"""
TABLE = """[inputs.u]
kind = "table"
times = {times}
values = {values}
"""
RAMP = (50 * 2 - 20 * (0.5 * 2 - 1 / 6), 50 - 20 * 0.5)  # 50 (1 - t) up to t = 1, then nothing
VALLEY = (50 * 2 - 20 * (0.5 * 2 - 1 / 6 + 1 / 6), 50 - 20 * 1.0)  # 50 |1 - t|


def sliding(load: str, v: float = 50.0, force: str = "0", more: str = "") -> hs.Model:
    """A body of mass 1 under a load."""
    return hs.Model.from_toml(SLIDING.format(load=load, v=v, force=force) + more)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    ("load", "end"),
    [
        ("P*max(1 - t, 0)", RAMP),
        ("max(P*(1 - t), 0)", RAMP),
        ("-P*min(t - 1, 0)", RAMP),
        ("P*(1 - t if t < 1 else 0)", RAMP),
        ("P*(abs(1 - t) + 1 - t)/2", RAMP),
        ("P*abs(1 - t)", VALLEY),
    ],
)
def test_a_load_written_with_a_corner_in_time_touches_zero(load, end, integrator):
    sol = hs.simulate(sliding(load), (0, 2), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2.0) == pytest.approx(end, rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_load_of_half_waves_touches_zero_at_no_double(integrator):
    """The area under max(cos 3 t, 0) up to t = 2 is 1/3, and that of the next half wave so far."""
    sol = hs.simulate(sliding("P*max(cos(3*t), 0)"), (0, 2), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2.0)[1] == pytest.approx(50 - 20 * (1 / 3 + (math.sin(6.0) + 1) / 3), rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("at", [1.0, 0.3, math.sqrt(2.0)])
@pytest.mark.parametrize("after", [0, 50])
def test_a_load_that_is_an_input_touches_zero(after, at, integrator):
    more = TABLE.format(times=[0, at, 2 * at], values=[50, 0, after])
    sol = hs.simulate(sliding("u", more=more), (0, 2 * at), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2 * at)[1] == pytest.approx(50 - 0.4 * at * (50 + after) / 2, rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(("shape", "amplitude"), [("triangle", 25), ("sawtooth", 25), ("sawtooth", -25)])
def test_a_load_that_is_a_wave_touches_zero_in_each_period(shape, amplitude, integrator):
    """The mean load is 25, also of the one that jumps to zero and of the one that jumps up from it."""
    more = (
        f'[inputs.u]\nkind = "wave"\nshape = "{shape}"\nperiod = 0.7\namplitude = {amplitude}\noffset = 25\n'
    )
    sol = hs.simulate(sliding("u", more=more), (0, 2.8), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2.8)[1] == pytest.approx(50 - 0.4 * 25 * 2.8, rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_load_that_a_schedule_renews_at_its_zero(integrator):
    more = '[discrete]\nbegan = 0\n[schedules.s]\nstart = 1\nperiod = 1\nreset = { began = "t" }\n'
    sol = hs.simulate(sliding("P*(1 - t + began)", more=more), (0, 2.5), integrator=integrator, rtol=1e-10)
    assert (sol.status, [event.kind for event in sol.events]) == ("finished", ["scheduled"] * 2)
    assert sol(2.5)[1] == pytest.approx(50 - 20 * (0.5 + 0.5 + 0.375), rel=1e-9)


COUNTING = {
    "monitor": '[monitors.m]\nexpr = "y"\naction = "reset"\nreset = { n = "+= 1" }\n',
    "guard": "[components.c.modes.a]\ninitial = true\n"
    'guards.g = { expr = "y", then = { to = "b", reset = { n = "+= 1" } } }\n[components.c.modes.b]\n',
}


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("what", COUNTING)
def test_a_load_waits_for_its_schedule_whatever_else_is_zero(what, integrator):
    """y = 1 - t reaches zero with the load; what it sets off says nothing of the load."""
    more = '[states.y]\nstart = 1\nder = "-1"\n[discrete]\nbegan = 0\nn = 0\n'
    more += '[schedules.s]\ntimes = [1]\nreset = { began = "t" }\n' + COUNTING[what]
    sol = hs.simulate(sliding("P*(1 - t + began)", more=more), (0, 1.5), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.output("n", 1.5)) == ("finished", 1.0)
    assert sol(1.5)[1] == pytest.approx(50 - 20 * (0.5 + 0.375), rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("load", ["max(P*(1 - t), 0)", "50*max(1 - t, 0)", "P*max(1 - t, 0)"])
def test_a_body_at_rest_stays_where_its_load_ends_unless_a_force_grows(load, integrator):
    at_rest = hs.simulate(sliding(load, v=0), (0, 2), integrator=integrator)
    assert (at_rest.status, at_rest.events) == ("finished", ())
    assert (at_rest.y == 0.0).all()
    pulled = hs.simulate(sliding(load, v=0, force="max(t - 1, 0)"), (0, 2), integrator=integrator, rtol=1e-10)
    assert [(event.t, event.target) for event in pulled.events] == [(1.0, "slip+")]
    assert pulled(2.0) == pytest.approx([1 / 6, 1 / 2], rel=1e-9)


GUARDED = """schema = 1
name = "guarded"
[states]
x = {{ start = 0, der = "1", nominal = 1 }}
[discrete]
n = 0
[components.c.modes.a]
initial = true
guards.g = {{ expr = "u", then = {{ to = "b" }} }}
[components.c.modes.b]
[monitors.m]
expr = "u"
action = "reset"
reset = {{ n = "+= 1" }}
"""


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    ("times", "values", "fired"),
    [
        ([0, 0.7, 3], [50, 0, 0], "m"),
        ([0, 0.7, 3], [50, 0, 50], ""),
        ([0, 0.7, 0.7, 3], [50, 0, 20, 20], ""),
        ([0, 0.7, 3], [50, 0, -50], "cm"),
        ([0, 0.7, 0.7, 3], [50, 0, -20, -20], "cm"),
        ([0, 0.7, 0.7, 3], [50, 10, -20, -20], "cm"),
    ],
)
def test_a_guard_on_an_input_fires_where_it_is_negative_just_after_and_a_monitor_where_it_is_no_more_positive(
    times, values, fired, integrator
):
    text = GUARDED.format() + TABLE.format(times=times, values=values)
    sol = hs.simulate(hs.Model.from_toml(text), (0, 2), integrator=integrator)
    assert sorted((event.component, event.t) for event in sol.events) == [(name, 0.7) for name in fired]
    assert sol.output("n", 2.0) == fired.count("m")


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("after", [-3.0, 4.0])
def test_a_force_that_touches_the_limit_of_stick_at_its_knot_moves_nothing(after, integrator):
    more = TABLE.format(times=[0, 0.3, 3], values=[0, 4, after])
    sol = hs.simulate(sliding("10", v=0, force="u", more=more), (0, 2), integrator=integrator)
    assert (sol.status, sol.events) == ("finished", ())
    assert (sol.y == 0.0).all()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_body_whose_speed_is_zero_where_its_force_turns_round_does_not_stop(integrator):
    """v = 1 - t up to t = 1, then the force 11 less the friction 4."""
    more = TABLE.format(times=[0, 1, 1, 3], values=[3, 3, 11, 11])
    sol = hs.simulate(sliding("10", v=1, force="u", more=more), (0, 2), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2.0) == pytest.approx([0.5 + 3.5, 7.0], rel=1e-9)


def test_resets_at_a_knot_read_the_input_as_it_was_before_its_jump():
    text = """schema = 1
name = "ball"
[states]
h = { start = 1, der = "-1", nominal = 1 }
[discrete]
seen = 0
[components.c.modes.a]
guards.g = { expr = "h", then = { to = "a", reset = { h = "2", seen = "u" } } }
[inputs.u]
kind = "table"
times = [0, 1, 1, 3]
values = [5, 7, 20, 20]
"""
    sol = hs.simulate(hs.Model.from_toml(text), (0, 2), integrator="taylor")
    assert [event.t for event in sol.events] == [1.0]
    assert sol.output("seen", 2.0) == 7.0


def test_a_load_that_does_become_negative_says_what_to_do():
    sol = hs.simulate(sliding("P*(1 - t)"), (0, 2), integrator="exact")
    assert (sol.status, sol.t_end) == ("inconsistent", 1.0)
    assert "P*(1 - t) < 0" in sol.message and "opens = true" in sol.message


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_backward_a_load_touches_zero_as_well(integrator):
    sol = hs.simulate(sliding("P*abs(1 - t)", v=30), (2, 0), integrator=integrator, rtol=1e-10)
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(0.0)[1] == pytest.approx(50.0, rel=1e-9)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
def test_a_load_that_dies_away_with_the_speed(integrator):
    """v - 40 = 10 exp(-20 t): the load reaches zero in no time, and below all rounding in two units of it."""
    sol = hs.simulate(
        sliding("P*max(v - 40, 0)"), (0, 2), integrator=integrator, rtol=1e-9, limits={"steps": 1000}
    )
    assert (sol.status, sol.events) == ("finished", ())
    assert sol(2.0) == pytest.approx([80.5, 40.0], abs=1e-7)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
@pytest.mark.parametrize("load", ["P*max(1 - t, 0)", "P*abs(1 - t)"])
@pytest.mark.parametrize(
    "law",
    [
        '{ name = "dahl", mu = 0.4, sigma = 1e4 }',
        '{ name = "lugre", mu_s = 0.5, mu_k = 0.4, v_s = 0.1, sigma_0 = 1e4, sigma_1 = 1, sigma_2 = 0 }',
    ],
)
def test_a_law_that_divides_by_its_load_says_so_where_the_load_is_zero(law, load, integrator):
    text = SLIDING.format(load=load, v=3, force="0").replace('{ name = "coulomb", mu = 0.4 }', law)
    with np.errstate(all="ignore"):
        sol = hs.simulate(hs.Model.from_toml(text), (0, 2), integrator=integrator)
    assert sol.status == "step-failure"
    assert sol.t_end == pytest.approx(1.0, abs=1e-6)
    assert f"the load '{load}' of contact f reaches zero" in sol.message and "divides by it" in sol.message


@pytest.mark.parametrize("integrator", ["dop853", "taylor", "tsit5", "rodas5p"])
@pytest.mark.parametrize(
    ("load", "zero"), [("P*abs(1 - 3*t)", 1 / 3), ("P*abs(0.9999999999999999 - t)", 1.0)]
)
def test_a_law_that_divides_by_its_load_says_so_where_no_double_is_the_zero(load, zero, integrator):
    """Beside the zero the run seems to have no admissible mode, or events that accumulate."""
    text = SLIDING.format(load=load, v=3, force="0")
    text = text.replace('{ name = "coulomb", mu = 0.4 }', '{ name = "dahl", mu = 0.4, sigma = 1e4 }')
    with np.errstate(all="ignore"):
        sol = hs.simulate(hs.Model.from_toml(text), (0, 2), integrator=integrator)
    assert sol.status == "step-failure" and sol.t_end == pytest.approx(zero, abs=1e-6)
    assert f"the load '{load}' of contact f reaches zero" in sol.message and "divides by it" in sol.message
