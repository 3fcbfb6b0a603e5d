"""Several things at one instant: guards and monitors at known times, errors of starts and of what resets copy."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.expr import evaluate, parse, rounding_of
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.measuring import load

LOCATING = ("dop853", "tsit5", "rodas5p", "exact", "taylor", "scipy-dop853", "cvode-adams", "cvode-bdf")


@cache  # several methods run each model
def model(text: str) -> hs.Model:
    return hs.Model.from_toml('schema = 1\nname = "scene"\n' + text)


def ramp_to_a_tick(seed: int) -> tuple[str, float, bool]:
    """A ramp that comes to zero of a guard or monitor at a scheduled time, in one of several equal forms."""
    draw = random.Random(seed)
    rate = Fraction(draw.randint(1, 99), 10)
    time = draw.randint(1, 4) * Fraction(draw.randint(1, 40), 10 * draw.choice([1, 3, 7]))
    start = Fraction(draw.randint(-30, 30), 10)
    r, t, x0 = float(rate), float(time), float(start)
    form = draw.choice(
        [
            f"({x0!r} + {r!r}*{t!r}) - x",
            f"{float(start + rate * time)!r} - x",
            f"{r!r}*{t!r} - (x - {x0!r})",
            f"1 - (x - {x0!r})/({r!r}*{t!r})",
        ]
    )
    is_monitor = draw.random() < 0.3
    carries = draw.choice(['x = "x - 100", n = "+= 1"', f'x = "{x0 - 5!r}"', 'n = "+= 1"'])
    if is_monitor:
        carries = 'x = "x - 100"'
        watched = f'[monitors.m]\nexpr = "{form}"\n'
    else:
        watched = (
            f'[modes.one]\ninitial = true\nguards.g = {{ expr = "{form}", then = "two" }}\n[modes.two]\n'
        )
    parts = [f"[schedules.tick]\ntimes = [{t!r}]\nreset = {{ {carries} }}\n", watched]
    if draw.random() < 0.5:  # an unrelated clock
        parts.append(f'[schedules.other]\ntimes = [{t!r}]\nreset = {{ n = "+= 1" }}\n')
    draw.shuffle(parts)
    states = f'[states]\nx = {{ start = {x0!r}, der = "{r!r}" }}\ny = {{ start = 1, der = "-y" }}\n'
    return states + "[discrete]\nn = 0\n" + "".join(parts), t, is_monitor


@pytest.mark.parametrize("integrator", LOCATING)
def test_a_guard_that_is_zero_at_a_known_time_fires_and_a_monitor_that_is_carried_back_does_not(
    integrator: str,
) -> None:
    for seed in range(16):
        text, t, is_monitor = ramp_to_a_tick(seed)
        sol = hs.simulate(model(text), (0, 1.5 * t), integrator=integrator)
        located = [event.t for event in sol.events if event.kind != "scheduled"]
        assert sol.status == "finished" and not sol.warnings, text
        assert located == ([] if is_monitor else [pytest.approx(t, rel=1e-12)]), text


SAW = """
[states]
x = { start = 0, der = "0.7" }
y = { start = 1, der = "-y" }
[discrete]
n = 0
[components.saw.modes.on]
guards.top = { expr = "0.21 - x", then = { to = "on", reset = { x = "0" } } }
"""


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize("action", ["record", "terminate"])
@pytest.mark.parametrize("clock", ["", '[clocks.other]\nperiod = 0.3\noffset = 0.3\nset = { n = "+= 1" }\n'])
@pytest.mark.parametrize("direction", ["up", "down", "both"])
@pytest.mark.parametrize("form", ["x - 0.21", "x/0.7 - 0.3", "1 - x/0.21"])
def test_an_unrelated_clock_does_not_make_a_monitor_fire(
    integrator: str, action: str, clock: str, direction: str, form: str
) -> None:
    text = SAW + clock + f'[monitors.m]\nexpr = "{form}"\naction = "{action}"\ndirection = "{direction}"\n'
    sol = hs.simulate(model(text), (0, 1.4), integrator=integrator)
    assert sol.status == "finished"
    assert [event.component for event in sol.events if event.kind == "monitor"] == []
    assert [event.t for event in sol.events if event.kind == "transition"] == pytest.approx(
        [0.3, 0.6, 0.9, 1.2]
    )


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize("clock", ["", '[schedules.other]\ntimes = [0.3]\nreset = { n = "+= 1" }\n'])
def test_a_monitor_that_goes_on_is_recorded_once(integrator: str, clock: str) -> None:
    text = '[states]\nx = { start = 0, der = "0.7" }\n[discrete]\nn = 0\n' + clock
    text += '[modes.one]\ninitial = true\nguards.g = { expr = "0.21 - x", then = "two" }\n[modes.two]\n'
    text += '[monitors.m]\nexpr = "x/0.7 - 0.3"\n[monitors.end]\nexpr = "x - 0.7*0.3"\naction = "terminate"\n'
    sol = hs.simulate(model(text), (0, 1), integrator=integrator)
    assert sol.status == "terminated"
    assert sorted(event.component for event in sol.events if event.kind == "monitor") == ["end", "m"]
    assert [event.t for event in sol.events] == [pytest.approx(0.3, rel=1e-12)] * len(sol.events)
    assert len(sol.events) == (4 if clock else 3)


STARTS = {
    "guard": 'x = {{ start = {start}, der = "1" }}\n[modes.one]\ninitial = true\n'
    'guards.g = {{ expr = "x - (a + b)", then = "two" }}\n[modes.two]\n',
    "equal guard": 'x = {{ start = {start}, der = "1" }}\n[modes.one]\ninitial = true\n'
    'guards.g = {{ expr = "x - b - a", then = "two" }}\n[modes.two]\n',
    "gap": 'x = {{ start = {start}, der = "v" }}\nv = {{ start = 1, der = "p" }}\n'
    '[impacts.p]\ngap = "x - (a + b)"\nrestitution = 0.5\n',
    "belt": 'x = {{ start = {start}, der = "0.1 - f" }}\n'
    '[contacts.f]\nvelocity = "x - (a + b)"\nnormal = "1"\nlaw = {{ name = "coulomb", mu = 0.5 }}\n',
    "monitor": 'x = {{ start = {start}, der = "1" }}\n[monitors.m]\nexpr = "x - (a + b)"\n',
}


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853", "cvode-bdf"])
@pytest.mark.parametrize("kind", STARTS)
@pytest.mark.parametrize("is_expression", [True, False])
def test_a_start_that_is_the_zero_of_a_guard_is_on_it(
    integrator: str, kind: str, is_expression: bool
) -> None:
    draw = random.Random(3)
    for _ in range(12):
        a, b = round(draw.uniform(-3, 3), 2), round(draw.uniform(-3, 3), 3)
        start = '"a + b"' if is_expression else repr(a + b)
        text = f"[parameters]\na = {a!r}\nb = {b!r}\n[states]\n" + STARTS[kind].format(start=start)
        sol = hs.simulate(model(text), (0, 0.05), integrator=integrator)
        assert (sol.status, len(sol.events), sol.warnings) == ("finished", 0, ()), text
        if kind == "belt":
            assert sol(0.05)[0] == pytest.approx(a + b, rel=1e-15)


def test_a_rimless_wheel_keeps_its_speed_where_it_starts() -> None:
    # the angle begins at the guard's own zero, ga - al, and the next spoke strikes later
    text = (
        '[parameters]\nga = 0.08\nal = 0.4\n[states]\nth = { start = "ga - al", der = "w" }\n'
        'w = { start = 1.2, der = "sin(th)" }\n'
        '[modes.rolling]\ninitial = true\nguards.back = { expr = "th - (ga - al)", '
        'then = { to = "rolling", reset = { w = "w/2" } } }\n'
        'guards.strike = { expr = "(ga + al) - th", '
        'then = { to = "rolling", reset = { th = "ga - al", w = "0.9*w" } } }\n'
    )
    for integrator in ("taylor", "dop853", "tsit5"):
        sol = hs.simulate(model(text), (0, 3), integrator=integrator)
        assert {event.guard for event in sol.events} == {"strike"}
        assert sol.events[0].t > 0.5


@pytest.mark.parametrize(
    ("text", "values", "exact"),
    [
        ("a + b", (0.1, 0.7), lambda a, b: a + b),
        ("a*b - c", (0.1, 0.7, 0.07), lambda a, b, c: a * b - c),
        ("a/b/7", (1.0, 3.0), lambda a, b: a / b / 7),
        ("(a + b) - 1e8", (1e8, 0.1), lambda a, b: a + b - 10**8),
        ("2 + 3", (0.0, 0.0), lambda a, b: Fraction(5)),
        ("(a + b)**3", (0.1, 0.2), lambda a, b: (a + b) ** 3),
    ],
)
def test_the_error_of_an_expression_is_within_its_bound(
    text: str, values: tuple[float, ...], exact: Callable[..., Fraction]
) -> None:
    expr, given = parse(text), dict(zip("abc", values, strict=False))
    off = abs(float(exact(*map(Fraction, values)) - Fraction(evaluate(expr, given))))
    assert off <= rounding_of(expr, given, exact=given) <= off + 1e-7 * abs(evaluate(expr, given)) * 2.0**-20


COPIED = """
[states]
x = {{ start = {start}, der = "v" }}
v = {{ start = 0, der = "{push} - 3*x" }}
y = {{ start = 0, der = "-1" }}
[components.s.modes.before]
initial = true
guards.g = {{ expr = "{c} - x", then = {{ to = "after", reset = {{ {reset} }} }} }}
[components.s.modes.after]
guards.h = {{ expr = "{guard}", then = "end" }}
[components.s.modes.end]
"""


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853", "tsit5", "cvode-bdf", "scipy-dop853"])
@pytest.mark.parametrize(
    ("reset", "guard"),
    [
        ('y = "x"', "{c} - y"),
        ('y = "x + 1"', "{c} - (y - 1)"),
        ('y = "2*x"', "1 - y/(2*{c})"),
        ('y = "x - {c}"', "-y"),
        ('y = "x", x = "y"', "1 - y/{c}"),
        ('y = "1000*(x - {c})"', "-y"),
        ('y = "+= x - y"', "{c} - y"),
    ],
)
def test_a_copy_of_what_was_located_carries_its_error(integrator: str, reset: str, guard: str) -> None:
    # y becomes what x is at the event, on the zero of the guard of the next mode, and falls away from it
    draw = random.Random(5)
    for _ in range(8):
        c = round(draw.uniform(0.2, 2), 3)
        start, push = round(c - draw.uniform(0.1, 30), 2), round(draw.uniform(20, 100), 2)
        put_in = {"c": repr(c)}
        text = COPIED.format(
            start=start, push=push, reset=reset.format(**put_in), guard=guard.format(**put_in), **put_in
        )
        sol = hs.simulate(model(text), (0, 3), integrator=integrator)
        assert sol.status == "finished" and not sol.warnings, text
        assert [(event.kind, event.guard) for event in sol.events] == [("transition", "g")], text


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853"])
@pytest.mark.parametrize(
    "held",
    [
        "[discrete]\nls = 0\nlc = 10\n",
        'ls = { start = 0, der = "0" }\nlc = { start = 10, der = "0" }\n',
    ],
)
def test_a_touch_beside_an_event_tells_its_time_by_its_curvature(integrator: str, held: str) -> None:
    # c comes back to 10, three above its last sample, and turns: a touch at the instant of a sample of s
    text = '[states]\ns = { start = 0, der = "20*pi*cos(2*pi*t)" }\nc = { start = 10, der = "-20*pi*sin(2*pi*t)" }\n'
    text += held
    for name, value, last in (("one", "s", "ls"), ("two", "c", "lc")):
        text += f'[components.{name}.modes.on]\nguards.g = {{ expr = "3 - abs({value} - {last})", '
        text += f'then = {{ to = "on", reset = {{ {last} = "{value}" }} }} }}\n'
    sol = hs.simulate(model(text), (0, 6), integrator=integrator)
    assert sol.status == "finished"
    # s is sampled at 3, 6, 9, 6, 3, 0, -3, ... whatever the touches of c are taken for
    a, b, c = (math.asin(0.1 * k) / math.tau for k in (3, 6, 9))
    half = [a, b, c, 0.5 - b, 0.5 - a, 0.5]
    expected = [0.5 * k + t for k in range(12) for t in half]
    sampled = [event.t for event in sol.events if event.kind == "transition" and event.component == "one"]
    assert sampled[:71] == pytest.approx(expected[:71], rel=1e-9)


@pytest.mark.parametrize("rtol", [1e-9, 1e-12])
def test_a_corner_that_turns_says_nothing_of_an_instant(rtol: float) -> None:
    """The corner of abs(c - last) is passed where c turns, and no state is worse known for it."""
    scene = next(scene for scene in SCENES if scene.name == "touch-beside-a-sample")
    sol = hs.simulate(load(scene), scene.span, integrator="scipy-lsoda", rtol=rtol)
    assert sol.status == "finished"
    seen = [0.0] + [e.x_minus[0] for e in sol.events if e.component == "one" and e.kind == "transition"]
    assert np.abs(np.abs(np.diff(seen)) - 2.0).max() < 1e-8


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "scipy-rk45"])
@pytest.mark.parametrize("guard", ["a*T**2/2 - y", "(a*T**2/2 - y)*(1 + t)", "a*T**2/2 - y + h**2"])
def test_what_touches_zero_at_an_impact_does_not_fire(integrator: str, guard: str) -> None:
    """y = a*T*t - a*t**2/2 has its top at T, when a ball from 4.905*T**2 comes to the floor."""
    draw = random.Random(5)
    for _ in range(12):
        top, steepness = draw.uniform(0.3, 1.3), draw.uniform(0.5, 2.0)
        model = hs.Model(
            "touch",
            parameters={"T": top, "a": steepness},
            states=[
                hs.State("h", "4.905*T**2", "w"),
                hs.State("w", 0, "-9.81 + p"),
                hs.State("y", 0, "v"),
                hs.State("v", "a*T", "-a"),
            ],
            impacts=[hs.Impact("p", gap="h", restitution=0.8)],
            components=[
                hs.Component(
                    "c",
                    [hs.Mode("on", guards=[hs.Guard("g", guard, then="off")]), hs.Mode("off")],
                    initial="on",
                )
            ],
        )
        sol = hs.simulate(model, (0.0, 1.3 * top), integrator=integrator)
        assert sol.success, sol.message
        changes = [(e.t, e.component) for e in sol.events if e.kind != "near-grazing"]
        assert changes == [(pytest.approx(top, rel=1e-12), "p")]
