"""Several things at one instant: guards and monitors at known times, errors of starts and of what resets copy."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest

import hybridsim as hs

LOCATING = ("dop853", "tsit5", "rodas5p", "exact", "taylor", "scipy-dop853", "cvode-adams", "cvode-bdf")


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
