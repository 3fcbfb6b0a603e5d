"""Random scenes, decided twice: by the engine, and in multiple precision by other rules. Both must say the same."""

from __future__ import annotations

import random

import pytest

import hybridsim as hs
from hybridsim.analysis.compare.errors_against_reference import Yardstick
from hybridsim.analysis.compare.resets import resets_of
from hybridsim.analysis.compare.trajectory import trajectory_of
from hybridsim.reference.multiple_precision import multiple_precision_trajectory
from hybridsim.reference.trajectory import EventLike

END = 6.0
LAWS = (
    '{ name = "coulomb", mu = 0.5 }',
    '{ name = "static-kinetic", mu_s = 0.6, mu_k = 0.4 }',
    '{ name = "stribeck", mu_s = 0.6, mu_k = 0.4, v_s = 0.5 }',
)
INPUTS = (
    'kind = "wave"\nshape = "square"\nperiod = 3.1\namplitude = 1.5\n',
    'kind = "wave"\nshape = "triangle"\nperiod = 2.3\n',
    'kind = "table"\ntimes = [0, 1, 2.5, 4]\nvalues = [0, 1, -1, 0.5]\n',
    'kind = "chirp"\nf0 = 0.1\nf1 = 0.6\nduration = 5\n',
)


def blocks(draw: random.Random) -> str:
    """Two blocks on springs, driven; each rubs on the ground, or the second one on the first."""
    stacked = draw.random() < 0.5
    forces = [f"-{draw.choice([1, 2, 5])}*x{i} - 0.1*v{i} + x{1 - i} - x{i}" for i in (0, 1)]
    forces[0] += f" + {draw.choice([1, 2])}*sin({draw.choice([0.7, 1.3])}*t) - f0" + (
        " + f1" if stacked else ""
    )
    forces[1] += " + u - f1"
    text = "[states]\n"
    for i in (0, 1):
        text += f'x{i} = {{ start = {draw.choice([0, 1, -0.5])}, der = "v{i}" }}\n'
        text += f'v{i} = {{ start = {draw.choice([0, 1, -1])}, der = "{forces[i]}" }}\n'
    text += f"[inputs.u]\n{draw.choice(INPUTS)}"
    for i, velocity in enumerate(["v0", "v1 - v0" if stacked else f"v1 - {draw.choice([0, 0.2])}"]):
        normal = draw.choice(["1", "1 + 0.3*sin(t)"])
        text += f'[contacts.f{i}]\nvelocity = "{velocity}"\nnormal = "{normal}"\nlaw = {draw.choice(LAWS)}\n'
    return text + '[monitors.m]\nexpr = "v0"\n[schedules.kick]\ntimes = 3.3\nreset = { v0 = "v0 + 0.7" }\n'


def switches(draw: random.Random) -> str:
    """An oscillator with two automata, a clock, and a monitor that resets."""
    resets = (
        "",
        ', reset = { v = "-0.7*v" }',
        ', reset = { y = "0", v = "v + d" }',
        ', reset = { d = "d + 1" }',
    )
    level = draw.choice([0.3, 0.5, 1])
    return f"""
[states]
x = {{ start = {draw.choice([0, 0.5, 1])}, der = "v" }}
v = {{ start = {draw.choice([0, 1, 2])}, der = "-{draw.choice([1, 4])}*x - 0.1*v + a + b" }}
y = {{ start = 0, der = "{draw.choice(["1", "x", "cos(t)"])}" }}
[discrete]
d = 1
[components.p.modes.low]
initial = true
set = {{ a = "{draw.choice([0, 1, -1])}" }}
guards.g = {{ expr = "{level} - x", then = {{ to = "high"{draw.choice(resets)} }} }}
guards.h = {{ expr = "{draw.choice([1, 2])} - y", then = [
  {{ when = "v > 0", to = "low", reset = {{ y = "0" }} }}, {{ to = "high", reset = {{ y = "-1" }} }} ] }}
[components.p.modes.high]
set = {{ a = "-2" }}
guards.g = {{ expr = "x - {level - 0.25}", then = {{ to = "low"{draw.choice(resets)} }} }}
[components.q.modes.on]
initial = true
set = {{ b = "{draw.choice(["sin(t)", "0.5"])}" }}
guards.k = {{ expr = "{draw.choice(["1.5 - t", "v + 1", "0.8 - x*x - v*v/9"])}", then = "off" }}
[components.q.modes.off]
set = {{ b = "-d" }}
[monitors.r]
expr = "y - 0.6"
direction = "up"
action = "reset"
reset = {{ y = "y - {draw.choice([0.3, 1])}" }}
[clocks.c]
period = 0.7
set = {{ d = "0.5*d - x" }}
"""


def sliders(draw: random.Random) -> str:
    """Two coupled sliders that are pulled over springs, and whose slips end between their limits."""
    text = "[states]\n"
    for i in (0, 1):
        text += f'e{i} = {{ start = {draw.choice([0, 0.02])}, der = "{draw.choice([0.07, 0.09])} - v{i}" }}\n'
        text += f'v{i} = {{ start = 0, der = "{draw.choice([9, 16])}*e{i} + e{i} - e{1 - i} - f{i}" }}\n'
    for i in (0, 1):
        law = (
            f'{{ name = "static-kinetic", mu_s = {draw.choice([0.8, 1])}, mu_k = {draw.choice([0.1, 0.2])} }}'
        )
        text += f'[contacts.f{i}]\nvelocity = "v{i}"\nnormal = {draw.choice([0.3, 0.4])}\nlaw = {law}\n'
    return text


@pytest.mark.parametrize("scene", [blocks, switches, sliders])
@pytest.mark.parametrize("seed", range(5))
def test_engine_and_multiple_precision_agree(scene: object, seed: int) -> None:
    """The same modes in the same order, the same events of every kind, states to 1e-9 of their amplitudes."""
    assert callable(scene)
    model = hs.Model.from_toml(f'schema = 1\nname = "scene"\n{scene(random.Random(seed))}')
    truth = multiple_precision_trajectory(model, (0, END), digits=24)
    run = hs.simulate(model, (0, END), rtol=1e-11)
    assert run.success
    errors = Yardstick(truth, resets_of(model), [1.0] * len(model.states), None).measure(trajectory_of(run))
    assert errors.sequence.right

    def counted(events: tuple[EventLike, ...]) -> list[tuple[str, str]]:
        return sorted((event.kind, event.component) for event in events if event.kind != "near-grazing")

    assert counted(run.events) == counted(truth.events)
    assert len(truth.events) > 3
    assert errors.state < 1e-9
    assert errors.event_time is not None and errors.event_time < 1e-9
