"""Parameters in steps of 1e-12 through equal eigenvalues, resonance, zero damping and a vanishing coupling.

The truth is the exponential of the matrix at 40 digits: forces sin(omega*t) and cos(omega*t) are two further states.
"""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.native.compiler import seconds_compiling
from hybridsim.engine.system.system_cache import system_of
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

END = 8.0
STEP, STEPS = 1e-12, 12  # on each side of the special value
# Largest error of a state at the end in units of 2^-53 times the largest state. The run has up to 16 radians of a wave,
# whose angle is rounded once, and about a dozen roundings in each of two changes of basis of condition up to 100.
BOUND = 128.0 * 2.0**-53

MODEL = """
[parameters]
m = 1.0
c = 0.2
k = 4.0
omega = 1.4
e = 0.5
N = 0.0
[states]
x = { start = 0.5, der = "v" }
v = { start = 0, der = "(3*sin(omega*t) - c*v - k*x + e*(y - x) - f)/m" }
y = { start = -0.25, der = "w" }
w = { start = 0, der = "e*(x - y) - c*w - k*y" }
[contacts.f]
velocity = "v"
normal = "N"
law = { name = "coulomb", mu = 0.5 }
"""
CASES = {  # the parameter that is changed, its special value, the others
    "equal eigenvalues": ("c", 4.0, {"e": 0.0}),
    "resonance": ("omega", 2.0, {"c": 0.0, "e": 0.0}),
    "equal eigenvalues at resonance": ("omega", 2.0, {"c": 4.0, "e": 0.0}),
    "zero damping": ("c", 0.0, {}),
    "no coupling": ("e", 0.0, {}),
    "no coupling, equal eigenvalues": ("e", 0.0, {"c": 4.0}),
    "no stiffness": ("k", 0.0, {"e": 0.0, "c": 0.0}),
    "a force that stands": ("omega", 0.0, {}),
}


def truth(p: dict[str, float]) -> np.ndarray:
    """The states at the end, without friction."""
    with mpmath.workdps(40):
        c, k, e, omega = (mpmath.mpf(p[name]) for name in ("c", "k", "e", "omega"))
        A = mpmath.matrix(6)
        A[0, 1] = A[2, 3] = 1
        A[1, 0], A[1, 1], A[1, 2], A[1, 4] = -k - e, -c, e, 3
        A[3, 0], A[3, 2], A[3, 3] = e, -k - e, -c
        A[4, 5], A[5, 4] = omega, -omega
        y = mpmath.expm(A * END) * mpmath.matrix([0.5, 0, -0.25, 0, 0, 1])
        return np.array([float(y[i]) for i in range(4)])


@pytest.mark.parametrize("case", CASES)
def test_steps_of_a_millionth_of_a_millionth(case: str) -> None:
    """No error, no new binding, and all states right, also at the special value itself."""
    name, special, others = CASES[case]
    model = hs.Model.from_toml(MODEL)
    values = model.parameter_values() | others
    code = system_of(model).code
    for i in (-STEPS, 0, STEPS):  # what is compiled or loaded at first need
        hs.simulate(model, (0, END), integrator="exact", params=others | {name: special + i * STEP})
    compiled, worst = seconds_compiling(), 0.0
    for i in range(-STEPS, STEPS + 1):
        changes = others | {name: special + i * STEP}
        sol = hs.simulate(model, (0, END), integrator="exact", params=changes)
        assert sol.status == "finished"
        assert system_of(sol.model).code is code
        worst = max(worst, float(np.abs(sol.y[:, -1] - truth(values | changes)).max() / np.abs(sol.y).max()))
    assert seconds_compiling() == compiled
    assert worst <= BOUND, worst / 2.0**-53


@pytest.mark.parametrize("case", ["equal eigenvalues", "resonance", "zero damping", "no coupling"])
def test_events_between_such_steps(case: str) -> None:
    """With friction: the times of all stops and releases are those in multiple precision."""
    name, special, others = CASES[case]
    model = hs.Model.from_toml(MODEL)
    for i in (-1, 0, 1):
        changes = others | {name: special + i * STEP, "N": 2.0}
        sol = hs.simulate(model, (0, END), integrator="exact", params=changes)
        wanted = multiple_precision_trajectory(model.with_(**changes), (0, END))
        assert len(sol.events) == len(wanted.events) > 2
        for found, true in zip(sol.events, wanted.events, strict=True):
            assert found.t == pytest.approx(float(true.t), abs=1e-12) and math.isfinite(found.t)
            assert found.target == true.target
