"""The end of a run is a known time: what happens there in exact arithmetic is taken, however it was rounded."""

import random

import numpy as np
import pytest

import hybridsim as hs

METHODS = ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853"]
BALL = """schema = 1
name = "ball"
[states]
h = {{ start = {height}, der = "w" }}
w = {{ start = 0, der = "-{g}" }}
[discrete]
n = 0
[components.b.modes.flight]
guards.floor = {{ expr = "h", then = [{{ to = "flight", reset = {{ h = "0", w = "-0.8*w", n = "+= 1" }} }}] }}
"""


@pytest.mark.parametrize("integrator", METHODS)
def test_a_ball_that_bounces_at_the_end_has_bounced_once(integrator):
    """From g/2 it falls for one second; resumed, it flies up with 0.8 g, and meets the floor at 2.6 again."""
    draw, near = random.Random(7), 1e-9
    for _ in range(12):
        g = round(draw.uniform(1.4, 20.0), 3)
        model = hs.Model.from_toml(BALL.format(height=g / 2, g=g))
        sol = hs.simulate(model, (0.0, 1.0), integrator=integrator)
        assert sol.output("n", 1.0) == 1.0
        assert sol(1.0) == pytest.approx([0.0, 0.8 * g], abs=near)
        assert [event.t for event in sol.events] == pytest.approx([1.0], abs=near)
        assert sol.events[0].x_minus == pytest.approx([0.0, -g], abs=near)
        assert sol.t_end == 1.0 and sol.status == "finished"
        on = sol.resume(1.5)
        assert on.output("n", 1.5) == 1.0 and len(on.events) == 1
        assert on(1.5) == pytest.approx([0.4 * g - g / 8, 0.8 * g - g / 2], abs=near)
        before = hs.simulate(model, (0.0, 1.0 - 1e-6), integrator=integrator)
        assert not before.events and before(before.t_end)[1] < 0.0


BODIES = """schema = 1
name = "three-bodies"
[states]
q1 = {{ start = {q1}, der = "v1" }}
q2 = {{ start = 0, der = "v2" }}
q3 = {{ start = {q3}, der = "v3" }}
v1 = {{ start = {v1}, der = "-p" }}
v2 = {{ start = 0, der = "p - r" }}
v3 = {{ start = {v3}, der = "r" }}
[impacts.p]
gap = "q2 - q1"
restitution = 0.5
[impacts.r]
gap = "q3 - q2"
restitution = 0.8
"""


@pytest.mark.parametrize("integrator", METHODS[:5])
def test_bodies_that_meet_at_the_end_have_struck(integrator):
    """By each law of restitution, v2 - v1 = 0.5 v1 and v3 - v2 = -0.8 v3, and the momentum."""
    draw = random.Random(2)
    for _ in range(12):
        at, v1, v3 = draw.choice([0.3, 1, 1.7]), draw.uniform(0.3, 4), -draw.uniform(0.3, 4)
        model = hs.Model.from_toml(BODIES.format(q1=-v1 * at, q3=-v3 * at, v1=v1, v3=v3))
        sol = hs.simulate(model, (0.0, at), integrator=integrator)
        middle = (v1 + v3 + 0.5 * v1 + 0.8 * v3) / 3.0
        assert sol(at)[3:] == pytest.approx([middle - 0.5 * v1, middle, middle - 0.8 * v3], abs=1e-9)


STOP = """schema = 1
name = "stop"
[parameters]
start = 1
[states]
v = { start = "start", der = "-f" }
[contacts.f]
velocity = "v"
normal = "start"
law = { name = "coulomb", mu = 1 }
"""
SIGN = """schema = 1
name = "sign"
[parameters]
start = -1
[states]
x = { start = "start", der = "rate" }
y = { start = 0, der = "sign(x)" }
"""


@pytest.mark.parametrize("integrator", METHODS)
def test_a_body_that_stops_at_the_end_sticks(integrator):
    draw = random.Random(4)
    model = hs.Model.from_toml(STOP)
    for _ in range(12):
        start = round(draw.uniform(0.2, 5.0), 3)
        sol = hs.simulate(model, (0.0, 1.0), params={"start": start}, integrator=integrator)
        assert [event.target for event in sol.events] == ["stick"]
        assert sol(1.0)[0] == pytest.approx(0.0, abs=1e-13)
        late = sol.resume(2.0)
        assert len(late.events) == 1 and late(2.0)[0] == 0.0


@pytest.mark.parametrize("integrator", METHODS)
def test_a_derivative_to_both_sides_of_an_event_at_the_end(integrator):
    """A start that is moved has the switch before the end or behind it: y moves by 2 or not."""
    draw = random.Random(6)
    for _ in range(6):
        rate = round(draw.uniform(0.2, 5.0), 3)
        model = hs.Model.from_toml(SIGN.replace("start = -1", f"start = {-rate}").replace("rate", str(rate)))
        found = hs.sensitivities(hs.simulate(model, (0.0, 1.0), integrator=integrator), ["start"])
        assert np.isnan(found.by_parameter[1, 0]) and found.by_parameter[0, 0] == pytest.approx(1.0)
        assert "start" in found.warnings[0]


LOADS = {
    "state": '[states.L]\nstart = "T*rate"\nder = "-rate"\n[states.v]\nstart = 50\nder = "-f"\n',
    "time": '[states.v]\nstart = 50\nder = "-f"\n[definitions]\nL = "rate*(T - t)"\n',
}


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("kind", LOADS)
@pytest.mark.parametrize("ends", ["t_end", "schedule"])
def test_a_run_that_ends_where_its_load_ends_needs_no_load_behind_it(integrator, kind, ends):
    """Friction of 0.4 of a load that falls to zero takes 0.4 rate T^2/2 of the speed; resumed, the load is missing."""
    draw = random.Random(9)
    text = f'schema = 1\nname = "load"\n[parameters]\nT = 1\nrate = 1\n{LOADS[kind]}[contacts.f]\nvelocity = "v"\n'
    text += 'normal = "L"\nlaw = { name = "coulomb", mu = 0.4 }\n'
    text += '[schedules.end]\ntimes = ["T"]\nterminate = true\n' if ends == "schedule" else ""
    model = hs.Model.from_toml(text)
    for _ in range(6):
        T, rate = round(draw.uniform(0.1, 3.0), 2), round(draw.uniform(0.3, 3.0), 2)
        until = T if ends == "t_end" else T + 1.0
        sol = hs.simulate(model, (0.0, until), params={"T": T, "rate": rate}, integrator=integrator)
        assert sol.status == ("finished" if ends == "t_end" else "terminated") and sol.t_end == T
        v = dict(zip(sol.names, sol(T), strict=True))["v"]
        assert v == pytest.approx(50.0 - 0.2 * rate * T**2, abs=1e-9)
        if ends == "t_end":
            assert sol.resume(T + 1.0).status == "inconsistent"


@pytest.mark.parametrize("integrator", [*METHODS, "moreau"])
def test_a_tick_at_the_end_is_in_the_state_at_the_end(integrator):
    """The length of the run is a rounded number, and so is the time of the end if it is summed from it."""
    draw = random.Random(3)
    options = {"step": 0.01} if integrator == "moreau" else {}
    for number in range(24):
        start = draw.choice([-0.1, -0.05, 0.1, 0.3, -0.7, draw.uniform(-2.0, 2.0)])
        end = (
            round(start + draw.choice([0.1, 0.2, 0.3, 1.1]), 3)
            if number % 2
            else start + draw.uniform(0.1, 2)
        )
        tick = hs.Schedule("tick", times=[repr(end)], reset={"x": "x + 5", "n": "+= 1"})
        states, counts = [hs.State("x", 0, "1")], [hs.Discrete("n", 0)]
        model = hs.Model("ramp", states=states, discrete=counts, schedules=[tick])
        sol = hs.simulate(model, (start, end), integrator=integrator, **options)
        assert sol(end) == pytest.approx([end - start + 5.0]) and sol.y[0, -1] == sol(end)[0]
        assert sol(end, side="-") == pytest.approx([end - start])
        assert sol.output("n", end) == 1.0 and sol.t[-2:].tolist() == [end, end]
