"""Random smooth expressions over the names of `engine.tapes`."""

from __future__ import annotations

import random

from engine.tapes import NAMES, STATES


def random_expression(pick: random.Random, depth: int) -> str:
    """A smooth expression whose parts stay of order one; constants are short in binary, so that folding is exact."""
    if depth == 0 or pick.random() < 0.2:
        return pick.choice([*NAMES, *STATES, "0.5", "2", "1.25"])
    a, b = random_expression(pick, depth - 1), random_expression(pick, depth - 1)
    name = pick.choice(NAMES)
    return pick.choice(
        [
            *(f"({a} {op} {b})" for op in "+-"),
            f"({a})*({b})",
            f"({a})/(3 + cos({b}))",
            f"-({a})",
            *(f"{f}({a})" for f in ("sin", "cos", "atan", "tanh", "abs")),
            *(f"{f}(sin({a})*0.75)" for f in ("exp", "sinh", "cosh", "tan", "asin", "acos")),
            f"log(2 + sin({a}))",
            f"sqrt(2 + sin({a}))",
            *(f"(2 + sin({a}))**{n}" for n in ("2", "3", "-1", "-4", "0.5", "-0.5", "2.5", "0.75", f"({b})")),
            f"sign({name})*({a})",
            f"min({a}, {b})",
            f"max({a}, {b}, 0.5)",
            f"atan2({a}, 2 + sin({b}))",
            f"({a} if {name} < 0.25 else {b})",
        ]
    )
