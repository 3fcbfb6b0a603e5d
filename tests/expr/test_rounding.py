"""The error of a number is half a unit in its last place, or nothing for a whole number or exact decimals."""

from __future__ import annotations

import math
import random
from decimal import Decimal

from hybridsim.expr import own_roundoff


def test_a_number_is_exact_if_its_decimals_are() -> None:
    draw = random.Random(0)
    numbers = [
        0.5,
        0.1,
        1e-5,
        2.0**-24,
        2.0**-25,
        3 * 2.0**-25,
        5e-324,
        1e300,
        2.0**53 + 1,
        math.inf,
        0.0,
        -0.0,
    ]
    numbers += [draw.randrange(1 << 53) * 2.0 ** draw.randrange(-70, 3) for _ in range(3000)]
    numbers += [draw.randrange(1 << draw.randrange(1, 30)) * 2.0 ** -draw.randrange(40) for _ in range(3000)]
    numbers += [draw.uniform(-1, 1) for _ in range(1000)]
    exact = 0
    for number in numbers:
        is_exact = math.isinf(number) or number.is_integer() or Decimal(repr(number)) == Decimal(number)
        assert own_roundoff(number) == (0.0 if is_exact else 0.5 * math.ulp(number)), number
        exact += is_exact
    assert 500 < exact < len(numbers) - 500
