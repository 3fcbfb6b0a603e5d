"""Random impacts of mechanisms: several contacts, with friction, that act on each other through a mass matrix."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.events.jumps.impulse import ImpactProblem


def random_impact_problem(
    rng: np.random.Generator, normal: int, tangential: int, common: bool = False
) -> ImpactProblem:
    """Contacts of a mechanism with as many coordinates as contacts or more; none nearly follows from others."""
    m = normal + tangential
    n = m + int(rng.integers(0, 3))
    sign = np.where(np.arange(m) < normal, 1.0, -1.0)
    condition = np.inf
    while condition > 1e4:
        W = rng.normal(size=(m, n))
        root = rng.normal(size=(n, n)) + 2.0 * np.eye(n)
        effects = W @ np.linalg.solve(root @ root.T, W.T) * sign
        condition = np.linalg.cond(effects)
    before = W @ rng.normal(size=n)
    before[:normal] = -np.abs(before[:normal]) * (rng.random(normal) < 0.7)
    e = np.full(normal, rng.random()) if common else rng.random(normal)
    mu = np.zeros((tangential, normal))
    for t in range(tangential):
        mu[t, t % normal] = rng.random()
    return ImpactProblem(effects, before, e, mu, mu)
