"""Functions of a model without a compiler: faults of Python are the numbers of compiled code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.native.model_functions import as_compiled


def held(t: float, x: Any, p: Any, z: Any, out: Any) -> int:
    """A force that is undetermined, 0/0, beside states that do not depend on it."""
    force = (1.0 - 1.0 * t) / (2.0 - 2.0 * t)
    out[0] = x[0]
    out[1] = force
    return 0


def no_root(t: float, x: Any, p: Any, z: Any, out: Any) -> int:
    """No number of Python's, nor of NumPy's."""
    out[0] = math.sqrt(-t)
    return 0


def test_what_is_undetermined_is_not_a_number_and_the_rest_is() -> None:
    out, x = np.zeros(2), np.array([3.0])
    with np.errstate(invalid="ignore"):
        assert as_compiled(held)(1.0, x, None, None, out) == 0
        assert out[0] == 3.0 and math.isnan(out[1])
        assert as_compiled(held)(3.0, x, None, None, out) == 0 and out.tolist() == [3.0, 0.5]
    assert as_compiled(no_root)(1.0, x, None, None, out) == 1 and np.isnan(out).all()
