"""What happens at one instant in exact arithmetic is settled together, however the steps to it were rounded."""

import random
from decimal import Decimal

import pytest

import hybridsim as hs

MODEL = """schema = 1
name = "three-bodies"
[states]
q1 = {{ start = {q1}, der = "v1" }}
q2 = {{ start = 0, der = "v2" }}
q3 = {{ start = {q3}, der = "v3" }}
v1 = {{ start = {v1}, der = "-p/{m1}" }}
v2 = {{ start = 0, der = "(p - r)/{m2}" }}
v3 = {{ start = {v3}, der = "r/{m3}" }}
[impacts.p]
gap = "q2 - q1"
restitution = {e1}
[impacts.r]
gap = "q3 - q2"
restitution = {e3}
"""


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p"])
def test_two_bodies_that_reach_a_third_at_one_time_strike_it_at_once(integrator):
    """By each law of restitution, and the momentum: v2 - v1 = e1 v1, v3 - v2 = -e3 v3."""
    draw = random.Random(3)
    for _ in range(12):
        at, v1, v3 = draw.choice([0.3, 1, 1.7]), draw.uniform(0.3, 4), -draw.uniform(0.3, 4)
        m1, m2, m3 = (draw.choice([0.5, 1, 3]) for _ in range(3))
        e1, e3 = draw.uniform(0.2, 1), draw.uniform(0.2, 1)
        model = hs.Model.from_toml(
            MODEL.format(q1=-v1 * at, q3=-v3 * at, v1=v1, v3=v3, m1=m1, m2=m2, m3=m3, e1=e1, e3=e3)
        )
        for end in (1.05 * at, 1.2 * at, 7.0 * at):
            sol = hs.simulate(model, (0.0, end), integrator=integrator)
            middle = (m1 * v1 + m3 * v3 + m1 * e1 * v1 + m3 * e3 * v3) / (m1 + m2 + m3)
            expected = [middle - e1 * v1, middle, middle - e3 * v3]
            assert sol(end)[3:] == pytest.approx(expected, abs=1e-9)
            assert len({event.t for event in sol.events}) == 1


BALL = """schema = 1
name = "ball"
[states]
h = {{ start = {height}, der = "w" }}
w = {{ start = 0, der = "-{g}" }}
[discrete]
n = 0
[components.b.modes.flight]
guards.floor = {{ expr = "h", then = [{{ to = "flight", reset = {{ h = "0", w = "-0.8*w", n = "+= 1" }} }}] }}
[schedules.kick]
times = [1]
reset = {{ w = "+= 2", n = "+= 10" }}
"""
CLOCK = """
[monitors.m]
expr = "t - 1"
action = "reset"
reset = { n = "+= 100" }
"""


@pytest.mark.parametrize(
    "integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853", "cvode-bdf"]
)
@pytest.mark.parametrize("more", ["", CLOCK])
def test_a_bounce_at_a_time_known_beforehand_comes_before_what_is_due_then(integrator, more):
    """The ball from g/2 falls for one second, on whichever side of it the bounce is located."""
    draw = random.Random(5)
    for _ in range(12):
        g, end = round(draw.uniform(1.4, 20.0), 3), draw.choice([1.1, 1.2, 1.5])
        model = hs.Model.from_toml(BALL.format(height=g / 2, g=g) + more)
        sol = hs.simulate(model, (0.0, end), integrator=integrator)
        assert sol(end)[1] == pytest.approx(
            0.8 * g + 2.0 - g * (end - 1.0), abs=1e-5 if "cvode" in integrator else 1e-9
        )
        assert sol.output("n", end) == (111.0 if more else 11.0)


HELD = """
[parameters]
start = 0
speed = 1
floor = 1
belt = 1
level = 1
period = 1
[states]
x = { start = "start", der = "speed" }
h = { start = 0, der = "w" }
w = { start = "floor", der = "p - 3" }
v = { start = "belt", der = "2 - f" }
y = { start = 0, der = "v" }
[impacts.p]
gap = "h - floor*t"
restitution = 0.2
[contacts.f]
velocity = "v - belt - floor*t"
normal = 1
law = { name = "coulomb", mu = 3 }
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "level - x", then = [{ to = "off" }] }
[components.a.modes.off]
[clocks.c]
period = "period"
set = {}
"""


@pytest.mark.parametrize("integrator", ["rodas5p", "tsit5", "taylor", "exact"])
def test_what_is_held_stays_held_where_a_guard_meets_a_tick(integrator: str) -> None:
    rng, model = random.Random(integrator), hs.Model.from_toml(HELD)
    for _ in range(12):
        number = {
            name: Decimal(rng.randint(*of)) / 100
            for name, of in {
                "start": (-100, 100), "speed": (30, 150), "floor": (5, 90), "belt": (5, 90), "period": (20, 100),
            }.items()
        }  # fmt: skip
        number["level"] = number["start"] + number["speed"] * 3 * number["period"]
        end = 4 * number["period"]
        numbers = {name: float(value) for name, value in number.items()}
        run = hs.simulate(model, (0, float(end)), params=numbers, integrator=integrator)
        assert run.status == "finished"
        assert {name: parts[-1].mode for name, parts in run.modes.items()} == {
            "a": "off", "p": "closed", "f": "stick",
        }  # fmt: skip
        values = dict(zip(run.names, run(run.t_end), strict=True))
        assert values["h"] == pytest.approx(float(number["floor"] * end), rel=1e-14)
        assert values["v"] == pytest.approx(float(number["belt"] + number["floor"] * end), rel=1e-14)


@pytest.mark.parametrize(
    "integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-rk45", "scipy-radau", "cvode-bdf"]
)
def test_a_guard_meets_a_tick_whose_time_is_rounded(integrator: str) -> None:
    """In decimals the guard is zero at the first tick; in doubles that time is rounded as the start is."""
    model = hs.Model.from_toml("""
[parameters]
start = 0
speed = 1
level = 1
first = 1
[states]
x = { start = "start", der = "speed" }
[discrete]
n = 0
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "level - x", then = [{ to = "off", reset = { n = 1 } }] }
[components.a.modes.off]
[clocks.c]
period = 1
offset = "first"
set = { x = "start" }
""")
    rng = random.Random(integrator)
    for _ in range(12):
        begin = Decimal(rng.choice(["100", "-3", "0.1", "1000"]))
        start, speed, after = (Decimal(rng.randint(*of)) / 100 for of in ((-100, 100), (30, 150), (20, 99)))
        numbers = {"start": start, "speed": speed, "level": start + speed * after, "first": begin + after}
        span = (float(begin), float(begin + after + Decimal("0.1")))
        params = {name: float(value) for name, value in numbers.items()}
        run = hs.simulate(model, span, params=params, integrator=integrator)
        assert run.output("n", run.t_end) == 1


@pytest.mark.parametrize("integrator", ["exact", "taylor"])
def test_a_touch_at_the_instant_of_an_impact_is_no_event(integrator: str) -> None:
    """The impact leaves the errors of what it does not move as they are."""
    model = hs.Model.from_toml("""
[parameters]
bend = 1
at = 1
[states]
h = { start = "at**2", der = "w" }
w = { start = 0, der = "p - 2" }
y = { start = "bend*at**2", der = "2*bend*(t - at)" }
z = { start = "bend*at**2", der = "s" }
s = { start = "-2*bend*at", der = "2*bend" }
[impacts.p]
gap = "h"
restitution = 0.5
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "y", then = [{ to = "off" }] }
guards.k = { expr = "z", then = [{ to = "off" }] }
[components.a.modes.off]
""")
    rng = random.Random(1)
    for _ in range(20):
        numbers = {"bend": rng.uniform(0.5, 2), "at": rng.uniform(0.5, 2)}
        run = hs.simulate(model, (0, 1.2 * numbers["at"]), params=numbers, integrator=integrator)
        assert [event.component for event in run.events if event.kind == "transition"] == ["p"]
