"""Random relays under sampled control: derivatives against differences of their closed form in forty digits."""

from __future__ import annotations

import itertools
import random

import pytest
from mpmath import exp, log, mp, mpf

import hybridsim as hs

RELAY = """schema = 1
name = "relay"
[parameters]
{parameters}
[states]
x = {{ start = "x0", der = "-x + u + h" }}
[discrete]
u = {{ start = 0 }}
[clocks.k]
period = "T"
offset = "o"
set.u = "c*x"
[components.b]
initial = "on"
modes.on.set.h = "F"
modes.off.set.h = "0"
modes.on.guards.up = {{ expr = "high - x - g*u", then = "off" }}
modes.off.guards.down = {{ expr = "x + g*u - low", then = [{{ to = "on", reset = {{ x = "r*x" }} }}] }}
"""
RANGES = {
    "x0": (0, 1), "c": (-0.5, 0.5), "high": (1, 1.5), "low": (0.2, 0.8), "r": (0.9, 1.1), "F": (1.6, 3),
    "g": (-1, 1), "T": (0.2, 1), "o": (0.05, 0.3),
}  # fmt: skip
END = 3


def drawn(seed: int) -> dict[str, mpf]:
    draw = random.Random(seed)
    return {name: mpf(round(draw.uniform(*span), 3)) for name, span in RANGES.items()}


def followed(p: dict[str, mpf]) -> tuple[mpf, list[tuple[str, float]]]:
    """The state at the end, and what happened when: between events x tends to u + h as exp(-t)."""
    x, u, on, t, ticks, record = p["x0"], mpf(0), True, mpf(0), 0, []
    while True:
        level = (p["high"] if on else p["low"]) - p["g"] * u
        if (level - x if on else x - level) < 0:  # set off by a tick or by a reset
            on, x = (False, x) if on else (True, p["r"] * x)
            record.append(("on" if on else "off", float(t)))
            continue
        target = u + (p["F"] if on else 0)
        tick = p["o"] + ticks * p["T"]
        until = min(tick, mpf(END))
        share = (level - target) / (x - target)
        if 0 < share < 1 and t - log(share) < until:
            t, x = t - log(share), level
            on, x = (False, x) if on else (True, p["r"] * x)
            record.append(("on" if on else "off", float(t)))
            continue
        x = target + (x - target) * exp(t - until)
        t = until
        if t == END:
            return x, record
        u, ticks = p["c"] * x, ticks + 1
        record.append(("tick", float(t)))


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_derivatives_of_random_relays(integrator: str) -> None:
    compared = at_once = 0
    with mp.workdps(40):
        h = mpf(10) ** -12
        for seed in range(60, 100):
            p = drawn(seed)
            end, record = followed(p)
            slopes = {}
            for name in p:
                (ahead, one), (behind, other) = (followed({**p, name: p[name] + s * h}) for s in (1, -1))
                if not [w for w, _ in one] == [w for w, _ in other] == [w for w, _ in record]:
                    break
                slopes[name] = float((ahead - behind) / (2 * h))
            if len(slopes) < len(p):
                continue
            text = "\n".join(f"{name} = {float(value)!r}" for name, value in p.items())
            solution = hs.simulate(
                hs.Model.from_toml(RELAY.format(parameters=text)), (0, END), integrator=integrator, rtol=1e-12
            )
            assert solution.y[0, -1] == pytest.approx(float(end), abs=1e-9), seed
            found = hs.sensitivities(solution, list(p)).by_parameter[0]
            assert found == pytest.approx(list(slopes.values()), rel=1e-6, abs=1e-8), seed
            compared += 1
            at_once += any(a[1] == b[1] for a, b in itertools.pairwise(record))
    assert compared > 30 and at_once >= 3
