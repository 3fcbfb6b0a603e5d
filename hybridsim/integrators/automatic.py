"""Which integrator "auto" takes, and why."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.linear_modes import what_is_not_linear
from hybridsim.engine.outcome import Situation
from hybridsim.engine.python_code import PythonCode
from hybridsim.engine.rosenbrock_step import linearise
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import System
from hybridsim.engine.taylor import advance
from hybridsim.engine.timepair import Instant

_SMALL = 24  # states and guards up to which tables of closed forms are small
_TIGHT = 1e-10  # rtol below which series of high order cost least
_STABLE = 3.0  # |h lambda| at which explicit methods of high order are about to lose stability
_MANY = 1e6  # steps held down by stability alone: a minute where a stiff method takes less than a second


class Choice(NamedTuple):
    """An integrator by name, and the reason in words."""

    name: str
    reason: str


def choose(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float], rtol: float) -> Choice:
    """The closed form where it goes from event to event, a stiff method where stability would rule, an explicit one.

    Stiffness is seen where it shows at the start, in the eigenvalues of the Jacobian.
    """
    if not system.has_tape:
        return _for_functions(system, x0, z0, span)
    model = system.model
    is_small = system.n + system.guard_count <= _SMALL and span[1] >= span[0]
    is_watched, rest = bool(model.monitors or model.inputs), ""
    if is_small and what_is_not_linear(system) is None:
        if not is_watched:
            return Choice("exact", "its modes are linear in the states")
        what = "monitors" if model.monitors else "inputs"
        rest = f" (they are linear, but with {what} exact cannot go from event to event in compiled code)"
    steps = _steps_for_stability(system, x0, z0, span)
    if steps > _MANY:
        return Choice("rodas5p", f"stability would hold an explicit method to {steps:.0e} steps")
    if system.has_corners:
        return Choice("dop853", "its modes are not stiff at the start, and jump inside")
    if rtol < _TIGHT:
        return Choice("taylor", f"its modes are smooth and the tolerance is tight{rest}")
    return Choice("dop853", f"its modes are smooth and not stiff at the start{rest}")


def _for_functions(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> Choice:
    """For rates that are a Python function: there is no tape for closed forms and series."""
    steps = _steps_for_stability(system, x0, z0, span)
    stiff = f"stability would hold an explicit method to {steps:.0e} steps" if steps > _MANY else ""
    if isinstance(system.code, PythonCode) and system.code.refused:
        return Choice(
            "scipy-radau" if stiff else "scipy-dop853", stiff or "numba cannot compile its functions"
        )
    return Choice("cvode-bdf" if stiff else "dop853", stiff or "its rates are a Python function")


def _steps_for_stability(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> float:
    """Steps to which stability alone would hold an explicit method."""
    per_rate = abs(span[1] - span[0]) / _STABLE
    steps = per_rate * _fastest_decay(system, x0, np.maximum(z0, 0), span[0])
    if steps > _MANY and (z0 < 0).any():  # a law may be steep on the side on which the motion is not
        steps = per_rate * _fastest_decay(system, x0, _modes_at_start(system, x0, z0, span), span[0])
    return steps


def _modes_at_start(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """The modes in which the run begins; the first of each component that cannot be decided."""
    p = system.vector(Instant(span[0]), system.discrete_start)
    at = Situation(0.0, x0.copy(), p, z0.copy(), np.zeros(system.n), 0.0)
    return np.maximum(Settling(system, at, z0.copy(), span[1] >= span[0]).run((), ()).z, 0)


def _fastest_decay(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> float:
    """The largest rate -Re(lambda) at which anything decays at the start."""
    n = system.n
    if not n:
        return 0.0
    p = system.vector(Instant(t0), system.discrete_start)
    jacobian = _jacobian(system, x, p, z) if system.has_tape else system.jacobian(0.0, x, p, z)
    if not np.isfinite(jacobian).all():
        return 0.0
    return max(0.0, float(-np.linalg.eigvals(jacobian).real.min()))


def _jacobian(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """d(dx/dt)/dx from the tape."""
    n, inputs, lean = system.n, system.registers.inputs, system.lean_tape(z)
    V = np.zeros((system.registers.count, 2))
    V[inputs.constants, 0] = inputs.values[:, 0]
    V[inputs.parameters, 0] = p[inputs.sources]
    advance(lean.constant_rows, V, 0)
    jacobian, rate = np.empty((n, n)), np.empty(n)
    places = (int(inputs.time[0]), inputs.states, lean.derivatives)
    linearise(lean.rows, places, 0.0, x, V, jacobian, rate)
    return jacobian
