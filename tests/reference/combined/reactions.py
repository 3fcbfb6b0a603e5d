"""Random reactions of three substances, over times in which stiffness begins."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import hybridsim as hs

STEPS = 2e7  # thousands of times as many as a method for stiff problems takes
CLOSE = 1e-4


def reactions(number: int) -> Iterator[dict[str, Any]]:
    """A reaction of Robertson's kind by the automatic choice, beside an implicit method of SciPy."""
    rng = random.Random(number * 23 + 5)
    k1, k2, k3 = 4 * 10.0 ** rng.randint(-3, -1), 10.0 ** rng.randint(2, 4), 3 * 10.0 ** rng.randint(4, 7)
    end = rng.choice([1, 2, 4, 8]) * 10.0 ** rng.randint(1, 8)
    states = [
        hs.State("a", 1, f"-{k1}*a + {k2}*b*c"),
        hs.State("b", 0, f"{k1}*a - {k2}*b*c - {k3}*b**2"),
        hs.State("c", 0, f"{k3}*b**2"),
    ]
    sol = hs.simulate(hs.Model("reaction", states=states), (0, end), limits={"steps": STEPS})
    if sol.status != "finished":
        yield {
            "kind": "stopped",
            "status": sol.status,
            "detail": f"{(k1, k2, k3)} to {end:g}: {sol.message}"[:300],
        }
        return

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        one, two, three = k1 * x[0], k2 * x[1] * x[2], k3 * x[1] ** 2
        return np.array([two - one, one - two - three, three])

    right = solve_ivp(rate, (0, end), [1.0, 0.0, 0.0], method="Radau", rtol=1e-8, atol=1e-13).y[:, -1]
    off = float(np.abs(sol.y[:, -1] - right).max())
    if off > CLOSE:
        yield {"kind": "differs", "detail": f"{(k1, k2, k3)} to {end:g}: off by {off:.1e}"}
