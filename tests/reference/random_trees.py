"""Random smooth expressions, as trees of `reference.integer_series`: bounded, and free of singularities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

NUMBERS = (0.5, 2.0, 1.25, 0.75)


def random_tree(rng: np.random.Generator, names: Sequence[str], depth: int) -> Any:
    """An expression whose value is of order one and whose slopes are not much larger."""
    if depth == 0 or rng.random() < 0.12:
        return names[rng.integers(len(names))] if rng.random() < 0.85 else NUMBERS[rng.integers(len(NUMBERS))]
    a, b = random_tree(rng, names, depth - 1), random_tree(rng, names, depth - 1)
    shapes: list[Any] = [
        ("+", a, b),
        ("-", a, b),
        ("*", ("sin", a), b),
        ("*", ("tanh", a), ("cos", b)),
        ("*", a, ("exp", ("sin", b))),
        ("/", a, ("+", 1.25, ("*", b, b))),
        ("/", ("sin", a), ("+", 2.0, ("cos", b))),
        ("atan", ("+", a, b)),
        ("tanh", ("-", a, b)),
        ("sin", ("+", a, b)),
        ("sqrt", ("+", 1.25, ("*", a, a))),
        ("exp", ("-", 0.0, ("*", ("cos", a), ("cos", a)))),
    ]
    return shapes[rng.integers(len(shapes))]
