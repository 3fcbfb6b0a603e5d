"""Random rates with corners, whose linearization is compared with differences of the judge's own values."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import numpy as np

import hybridsim as hs

from .builder import Builder, number_set
from .forms import Node, var
from .render import Renderer, Style
from .values import Values

CLOSE = 1e-6
STEP = 1e-4


def rates(b: Builder) -> None:
    """One to three states whose rates have corners in them."""
    names = ["x", "y", "v"][: b.rng.randint(1, 3)]
    for name in names:
        rate: Node = b.num(-1, 1) * var(b.rng.choice(names))
        for _ in range(b.rng.randint(1, 2)):
            rate = rate + b.num(-2, 2) * b.corner(var(b.rng.choice(names)), "rate", 2)
        if b.chance(0.4):
            rate = rate + b.positive(var(b.rng.choice(names)), "rate") * var(b.rng.choice(names))
        b.m.states[name] = b.num(-2, 2), rate


def linearizations(number: int) -> Iterator[dict[str, Any]]:
    """The linearization of one random model at a random point."""
    b = Builder(number * 17 + 11)
    rates(b)
    numbers = number_set(b.m, number, 0)
    names, rng = list(b.m.states), random.Random(number)
    point = {k: rng.randint(-300, 300) / 100 + 0.00317 for k in names}
    judge = Values(b.m, numbers)

    def at(**moved: float) -> np.ndarray:
        judge.x = {k: point[k] + moved.get(k, 0.0) for k in names}
        return np.array([float(judge.value(judge.rates[k])) for k in names])

    here = at()
    sides = [[(at(**{k: s * STEP}) - here) / (s * STEP) for k in names] for s in (1, -1)]
    if np.abs(np.array(sides[0]) - np.array(sides[1])).max() > 0.05:  # a corner is near
        return
    right = np.array([(at(**{k: STEP}) - at(**{k: -STEP})) / (2 * STEP) for k in names]).T
    try:
        renderer = Renderer(b.m, Style(number))
        model = hs.Model.from_toml(renderer.toml(numbers))
        found = hs.linearize(model, at=point, params=renderer.values(numbers))
        order = [found.states.index(k) for k in names]
        ours = found.A[np.ix_(order, order)]
        if not np.abs(ours - right).max() <= CLOSE * (1 + np.abs(right).max()):
            yield {"kind": "differs", "detail": f"right {right.tolist()} got {ours.tolist()} at {point}"}
    except hs.ModelError:
        return  # the form is refused by name
    except hs.HybridsimError as error:
        yield {"kind": "refused", "detail": f"{error}"[:300]}
