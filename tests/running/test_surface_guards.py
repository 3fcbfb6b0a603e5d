"""Guards of automata that come to zero together with the velocity of a contact, or with a gap."""

from __future__ import annotations

import math
import random

import pytest

import hybridsim as hs
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

INTEGRATORS = ("exact", "taylor", "dop853", "rodas5p")

THROWN = """
[states]
v = {{ start = {start}, der = "{push} - f" }}
n = {{ start = 0, der = 0 }}
[contacts.f]
velocity = "v"
normal = 1
law = {{ name = "coulomb", mu = {mu} }}
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = {{ expr = "{sign}v", then = [{{ to = "{to}", reset = {{ v = {reset}, n = "n + 1" }} }}] }}
[components.a.modes.off]
"""


def slide(start: float, push: float, mu: float, end: float) -> float:
    """The speed at the end under a constant push and Coulomb friction, by pieces."""
    t, v = 0.0, start
    while t < end:
        side = math.copysign(1.0, v) if v else (math.copysign(1.0, push) if abs(push) > mu else 0.0)
        rate = push - side * mu if side else 0.0
        zero = -v / rate if rate and v * rate < 0.0 else math.inf
        if t + zero >= end:
            return v + rate * (end - t)
        t, v = t + zero, 0.0
    return v


def drawn(seed: int) -> dict[str, float]:
    """Numbers of one slide: it is thrown on or back at its zero where its push exceeds friction."""
    rng = random.Random(seed)
    mu = rng.uniform(0.2, 1.0)
    return {
        "start": rng.uniform(0.5, 1.5),
        "mu": mu,
        "push": -mu * rng.choice([rng.uniform(0.1, 0.9), rng.uniform(1.1, 2.0)]),
        "reset": rng.uniform(0.2, 1.0) * rng.choice([-1, 1]),
    }


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("mirror", [1, -1])
def test_a_body_is_thrown_at_the_end_of_its_slide(seed: int, mirror: int) -> None:
    one = drawn(seed)
    stop = one["start"] / (one["mu"] - one["push"])
    end, goes_on = stop + 0.7, -one["push"] > one["mu"]
    speed = slide(one["reset"], one["push"], one["mu"], 0.7) if goes_on else 0.0
    numbers = {name: mirror * value if name != "mu" else value for name, value in one.items()}
    model = hs.Model.from_toml(THROWN.format(**numbers, sign="" if mirror > 0 else "-", to="off"))
    for integrator in INTEGRATORS:
        run = hs.simulate(model, (0, end), integrator=integrator)
        fired = [event.t for event in run.events if event.component == "a"]
        assert fired == pytest.approx([stop] * goes_on, abs=1e-9)
        assert float(run(run.t_end)[run.names.index("n")]) == goes_on
        assert float(run(run.t_end)[run.names.index("v")]) == pytest.approx(mirror * speed, abs=1e-9)
    reference = multiple_precision_trajectory(model, (0, end))
    assert float(reference.states.state(end)[0]) == pytest.approx(mirror * speed, abs=1e-12)


def test_a_body_is_kicked_as_it_breaks_loose() -> None:
    model = hs.Model.from_toml("""
[states]
y = { start = 0, der = 1 }
u = { start = 0, der = "y - h" }
[contacts.h]
velocity = "u"
normal = 1
law = { name = "coulomb", mu = 1 }
[components.a]
initial = "before"
[components.a.modes.before]
guards.end = { expr = "1 - y", then = [{ to = "after", reset = { u = -0.7 } }] }
[components.a.modes.after]
""")
    for integrator in INTEGRATORS:
        run = hs.simulate(model, (0, 1.25), integrator=integrator)
        assert float(run(run.t_end)[run.names.index("u")]) == pytest.approx(
            -0.7 + 0.5 + 0.03125, abs=1e-9
        )  # u' = y + 1


def test_a_guard_on_a_gap_is_not_passed_in_an_impact() -> None:
    text = """
[states]
h = {{ start = 1, der = "w" }}
w = {{ start = 0, der = "p - 2" }}
[impacts.p]
gap = "h"
restitution = {restitution}
[components.a]
initial = "above"
[components.a.modes.above]
guards.floor = {{ expr = "h", then = [{{ to = "below" }}] }}
[components.a.modes.below]
"""
    for restitution in (0, 0.5, 1):
        model = hs.Model.from_toml(text.format(restitution=restitution))
        for integrator in INTEGRATORS:
            run = hs.simulate(model, (0, 1.25), integrator=integrator)
            assert {event.component for event in run.events} == {"p"}
            assert float(run(run.t_end)[run.names.index("h")]) == pytest.approx(
                restitution * 0.5 - 0.0625 * (restitution > 0), abs=1e-9
            )
