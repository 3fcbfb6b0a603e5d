"""What the multiple-precision run does at events, with inputs and functions, and what it refuses."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.multiple_precision import multiple_precision_trajectory
from hybridsim.analysis.multiple_precision.functions import Functions
from hybridsim.analysis.multiple_precision.nodes import Given, in_order
from hybridsim.analysis.trajectory import Trajectory
from hybridsim.errors import SimulationError, UsageError

MP = mpmath.mp.clone()
MP.dps = 60
RISING = '[states]\nx = { start = 0, der = "1" }\n'


def run(text: str, end: float, **options: Any) -> Trajectory:
    model = hs.Model.from_toml(f'schema = 1\nname = "scene"\n{text}')
    return multiple_precision_trajectory(model, (0, end), **options)


def seen(trajectory: Trajectory) -> list[tuple[str, float]]:
    return [(event.component, event.t) for event in trajectory.events]


@pytest.mark.parametrize(
    "name",
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt"],
)
def test_functions_have_the_series_that_differentiation_gives(name: str) -> None:
    inner = [MP.mpf(c) for c in ("0.3", "0.5", "-0.2", "0.1", "0.07", "-0.3", "0.02")]
    u = Given(MP)
    u.c = list(inner)
    node = Functions(MP).build(name, u)
    for part in in_order([node]):
        if part.constant:
            part.extend(0)
    for n in range(len(inner)):
        for part in in_order([node]):
            if not part.constant:
                part.extend(n)
    outer = mpmath.mp.clone()
    outer.dps = 120  # numerical differentiation loses half of them
    function = getattr(outer, name)
    expected = outer.taylor(lambda t: function(outer.polyval(inner[::-1], t)), 0, len(inner) - 1)
    for ours, theirs in zip(node.c, expected, strict=True):
        assert abs(ours - theirs) < 1e-40


@pytest.mark.parametrize(
    ("rate", "value"),
    [
        ("x**3", "1/sqrt(1 - 2*t)"),
        ("-x**2.5", "(1 + 1.5*t)**(-2/mpf(3))"),
        ("1/x", "sqrt(1 + 2*t)"),
        ("x**-2", "(1 + 3*t)**(1/mpf(3))"),
        ("2*t*x", "exp(t**2)"),
        ("x*cos(t)", "exp(sin(t))"),
        ("x**p*sqrt(x)", "(1 - 2*t)**-0.5"),
    ],
)
def test_separable_equations(rate: str, value: str) -> None:
    """x' = rate from x = 1, against the solution by hand."""
    end = 0.25
    trajectory = run(f'[parameters]\np = 2.5\n[states]\nx = {{ start = 1, der = "{rate}" }}\n', end)
    expected = eval(value, {**vars(mpmath), "mpf": MP.mpf, "t": MP.mpf(end), "sqrt": MP.sqrt, "exp": MP.exp, "sin": MP.sin})  # noqa: S307
    assert abs(trajectory.states.state(end)[0] - expected) < 1e-30
