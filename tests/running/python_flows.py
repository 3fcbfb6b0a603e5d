"""Models of Python functions that several tests run: a ball that bounces, and an oscillator.

Their functions stand in the module, so that the models of all tests share one compiled code.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import hybridsim as hs


def fall(t: float, x: Any, p: Any) -> Any:
    return x[1], -p.g


def height(t: float, x: Any, p: Any) -> Any:
    return x[0]


def rebound(t: float, x: Any, p: Any) -> Any:
    return -p.e * x[1]


def ball(**changes: Any) -> hs.Model:
    floor = hs.Guard("floor", height, hs.Choice("flight", reset={"h": 0.0, "w": rebound}))
    fields: dict[str, Any] = {
        "states": {"h": 1.0, "w": 0.0},
        "parameters": {"g": 9.81, "e": 0.8},
        "flow": fall,
        "components": [hs.Component("ball", [hs.Mode("flight", [floor])])],
    }
    return hs.Model("ball", **(fields | changes))


def bounces(count: int, g: float = 9.81, e: float = 0.8) -> np.ndarray:
    """Times at which a ball dropped from 1 meets the floor: each flight takes e times the one before."""
    first = math.sqrt(2.0 / g)
    return first + 2.0 * first * np.array([sum(e**j for j in range(1, k + 1)) for k in range(count)])


def oscillate(t: float, x: Any, p: Any) -> Any:
    rates = np.empty(2)
    rates[0] = x[1]
    rates[1] = -(p.w**2) * x[0]
    return rates


def energy(t: float, x: Any, p: Any) -> Any:
    return 0.5 * (x[1] ** 2 + p.w**2 * x[0] ** 2)


def oscillator(**changes: Any) -> hs.Model:
    fields: dict[str, Any] = {
        "states": {"x": 1.0, "v": 0.0},
        "parameters": {"w": 3.0},
        "flow": oscillate,
        "monitors": [hs.Monitor("zero", height, direction="down")],
        "outputs": {"energy": energy},
    }
    return hs.Model("oscillator", **(fields | changes))
