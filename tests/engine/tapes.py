"""An expression on a tape along a flow whose motion is known: a line, a decay and an oscillation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
import sympy

from hybridsim.engine.series.bounded import ORDER, UNIT, run_tape
from hybridsim.engine.series.tape import TapeBuilder
from hybridsim.expr import parse
from hybridsim.expr.symbolic import to_sympy

STATES = ("x", "y", "u", "v")  # x' = c, y' = -y, u' = v, v' = -u
NAMES = (*STATES, "t", "a", "b", "c")


@dataclass(frozen=True)
class Point:
    """Where the series are taken: states, local time and parameters."""

    x: float = 0.5
    y: float = 0.25
    u: float = 0.75
    v: float = -0.5
    t: float = 0.0
    a: float = 1.5
    b: float = -0.25
    c: float = 1.0

    def motion(self, h: Any) -> Mapping[str, Any]:
        """Every name at time t + h, exactly."""
        x, y, u, v, t, a, b, c = (mpmath.mpf(getattr(self, n)) for n in NAMES)
        return {
            "x": x + c * h,
            "y": y * mpmath.exp(-h),
            "u": u * mpmath.cos(h) + v * mpmath.sin(h),
            "v": v * mpmath.cos(h) - u * mpmath.sin(h),
            "t": t + h,
            "a": a,
            "b": b,
            "c": c,
        }


def series(text: str, at: Point, x_error: float = 0.0, s_error: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of an expression along the flow, and their error bounds."""
    symbols = {n: sympy.Symbol(n, real=True) for n in NAMES}
    builder = TapeBuilder()
    flow = {"d_x": symbols["c"], "d_y": -symbols["y"], "d_u": symbols["v"], "d_v": -symbols["u"]}
    assignments = [*flow.items(), ("g", to_sympy(parse(text), symbols))]
    rows = np.array(builder.rows(assignments, {}), dtype=np.int64)
    place = {n: builder.register(n) for n in (*NAMES, *flow, "g")}
    V, E = np.zeros((builder.count, ORDER + 1)), np.zeros((builder.count, ORDER + 1))
    for (value, error), register in builder.constants.items():
        V[register, 0], E[register, 0] = value, error
    for name in NAMES:
        V[place[name], 0] = getattr(at, name)
    for name in STATES:
        E[place[name], 0] = x_error * abs(getattr(at, name))
    V[place["t"], 1], E[place["t"], 0] = 1.0, s_error
    states = np.array([place[n] for n in STATES])
    derivatives = np.array([place["d_" + n] for n in STATES])
    run_tape(rows, ORDER, states, derivatives, V, E)
    return V[place["g"]].copy(), E[place["g"]].copy()


__all__ = ["ORDER", "UNIT", "Point", "series"]
