"""Random rates that are divided by what may come to zero, at a time that is known in closed form."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

import hybridsim as hs

METHODS = ("dop853", "tsit5", "rodas5p", "scipy-rk45", "taylor")


def poles(number: int) -> Iterator[dict[str, Any]]:
    """One run with a quotient: where its denominator passes zero the run must not end as if nothing were wrong."""
    rng = random.Random(number * 19 + 7)
    a, b, k = (rng.randint(2, 20) / 10 for _ in range(3))
    start, level, end = rng.randint(5, 30) / 10, rng.randint(-10, 10) / 10, rng.randint(10, 60) / 10
    kind = rng.choice(["falls", "decays", "turns"])
    rate, zero = {
        "falls": (f"-{a}", (start - level) / a),
        "decays": (f"-{a}*(x + 1)", math.log((start + 1) / (level + 1)) / a if level > -1 else math.inf),
        "turns": (f"cos({a}*t)", math.inf),
    }[kind]
    if kind == "turns":
        start, level = 0.0, -(1.0 / a + 0.2)  # x = sin(a*t)/a stays above it
    zero = zero if zero > 0 else math.inf
    below = rng.choice([f"(x - ({level}))", f"(({level}) - x)", f"({k}*x - {k}*({level}))"])
    above = rng.choice([f"(y - {b}*w)", f"({b} - y)", f"{b}"])
    form = rng.choice(["{a}/{d}", "{k}*{a}/{d}", "{k}*tanh({a}/{d})", "-{a}*{d}**-1"])
    quotient = form.format(a=above, d=below, k=k)
    if min(zero, abs(zero - end)) < 0.2:
        return
    states = [hs.State("x", start, rate), hs.State("y", 1, f"-{quotient}"), hs.State("w", 2, "-0.2*w")]
    rng.shuffle(states)
    integrator = rng.choice(METHODS)
    try:
        sol = hs.simulate(
            hs.Model("quotient", states=states), (0, end), integrator=integrator, limits={"steps": 20_000}
        )
    except hs.HybridsimError:
        return  # refused by name
    if zero < end and sol.status == "finished" and not sol.warnings:
        yield {
            "kind": "went on",
            "integrator": integrator,
            "detail": f"{quotient} has a pole at t = {zero:.6g}",
        }
    if zero > end and (sol.status != "finished" or any("denominator" in w for w in sol.warnings)):
        detail = f"{quotient} has no pole: {sol.status} {sol.message} {sol.warnings}"
        yield {"kind": "stopped", "integrator": integrator, "detail": detail[:300]}
