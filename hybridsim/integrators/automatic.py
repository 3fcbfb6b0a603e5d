"""This module chooses the integrator for integrator="auto", and gives the reason."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.events.monitor_corners import corners_of_monitors
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.linear.modes import is_linear_beside_corners, what_is_not_linear
from hybridsim.engine.run.headway import cost, cost_of_restarts
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.user_functions.code import PythonCode
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.rosenbrock.step import Linearisation

_SMALL = 24  # largest number of states and guards with small tables of closed forms
_TIGHT = 1e-10  # rtol below which series of high order are fastest
_STABLE = 3.0  # |h lambda| at the stability limit of explicit methods of high order
_MANY = 1e6  # steps limited by stability: a minute, for which a stiff method takes less than a second
_DECAYING = 0.25  # smallest share of decay in an eigenvalue, so that rodas5p damps it
_MANY_IN_PYTHON = 1e4  # the same limit without a compiled loop
_APART = 10.0  # ratio to all other rates above which a decay is over before anything else happens


class Choice(NamedTuple):
    """The name of an integrator and the reason for its choice."""

    name: str
    reason: str


def choose(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float], rtol: float) -> Choice:
    """Choose an integrator for a model with given initial values and tolerance.

    The closed form is chosen for linear modes if it runs in compiled code, a stiff method if stability would
    limit the step of an explicit one, unless it would restart at too many clock ticks, and an explicit method
    otherwise. Stiffness is detected at the start,
    from the eigenvalues of the Jacobian. Stiffness that begins later is detected during the run, see
    `successor_of`.
    """
    if not system.has_tape:
        return _for_functions(system, x0, z0, span)
    model = system.model
    is_small = system.n + system.guard_count <= _SMALL and span[1] >= span[0]
    rest = ""
    if is_small and what_is_not_linear(system) is None and is_linear_beside_corners(system):
        obstacle = "inputs" if model.inputs else _monitors_for_python(system)
        if not obstacle:
            return Choice("exact", "its modes are linear in the states")
        rest = f" (the model has {obstacle}, so exact may be slower; pass integrator='exact' to try it)"
    steps = _steps_for_stability(system, x0, z0, span)
    in_python = bool(model.inputs) or system.has_corners or span[1] < span[0]
    is_stiff = steps > _MANY or (steps > _MANY_IN_PYTHON and in_python and _is_apart(system, x0, z0, span[0]))
    if is_stiff and not _restarts_too_often(system, steps, span):
        return Choice("rodas5p", f"for stability an explicit method would need {steps:.0e} steps")
    if system.has_corners:
        return Choice(
            "dop853", "its modes are not stiff at the start; jumps inside modes are not treated as events"
        )
    if rtol < _TIGHT:
        return Choice("taylor", f"its modes are smooth and the tolerance is tight{rest}")
    return Choice("dop853", f"its modes are smooth and not stiff at the start{rest}")


def _restarts_too_often(system: System, steps: float, span: tuple[float, float]) -> bool:
    """Return whether rodas5p, which restarts at each clock tick, would take longer than explicit steps."""
    is_compiled = (
        span[1] >= span[0] and not system.has_corners and all(s.is_polynomial for s in system.signals)
    )
    explicit = cost(0.0, steps, 0.0) if is_compiled else cost(steps, 0.0, 0.0)
    return explicit < cost_of_restarts(system, abs(span[1] - span[0]))


def _monitors_for_python(system: System) -> str:
    """Name the monitors that prevent `exact` from running in compiled code; return an empty text if there are none."""
    if not system.monitor_names:
        return ""
    corners = corners_of_monitors(system)
    if corners is None or system.n + corners.system.guard_count > _SMALL:
        return "many monitors"
    is_possible = what_is_not_linear(corners.system) is None
    return "" if is_possible else "monitors that are not polynomials of the states"


def _for_functions(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> Choice:
    """Choose an integrator for rates that are a Python function."""
    steps = _steps_for_stability(system, x0, z0, span)
    stiff = f"for stability an explicit method would need {steps:.0e} steps" if steps > _MANY else ""
    if isinstance(system.code, PythonCode) and system.code.refused:
        return Choice(
            "scipy-radau" if stiff else "scipy-dop853", stiff or "numba cannot compile its functions"
        )
    return Choice("cvode-bdf" if stiff else "dop853", stiff or "its rates are a Python function")


def _steps_for_stability(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> float:
    """Return the number of steps that stability requires of an explicit method."""
    per_rate = abs(span[1] - span[0]) / _STABLE
    steps = per_rate * _fastest_decay(system, x0, np.maximum(z0, 0), span[0])
    if steps > _MANY and (z0 < 0).any():  # a law may be steep on the side that the motion does not take
        steps = per_rate * _fastest_decay(system, x0, _modes_at_start(system, x0, z0, span), span[0])
    return steps


def _modes_at_start(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Return the modes in which the run begins; an undecided component gets its first mode."""
    p = system.vector(Instant(span[0]), system.discrete_start)
    at = Situation(0.0, x0.copy(), p, z0.copy(), np.zeros(system.n), 0.0)
    return np.maximum(EventResolution(system, at, z0.copy(), span[1] >= span[0]).run((), ()).z, 0)


def successor_of(name: str, system: System) -> Integrator | None:
    """Return the method that continues if the run becomes stiff, or None if stiffness is not monitored."""
    from hybridsim.integrators.rosenbrock.rodas5p import Rodas5P

    return Rodas5P() if name == "dop853" and system.has_tape else None


def _fastest_decay(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> float:
    """Return the largest decay rate -Re(lambda) at the start."""
    return max(0.0, float(-_eigenvalues(system, x, z, t0).real.min(initial=0.0)))


def _is_apart(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> bool:
    """Return whether some decays are so much faster than all other motions that they limit the step."""
    values = _eigenvalues(system, x, np.maximum(z, 0), t0)
    sizes = np.abs(values)
    stiff = values.real < -_DECAYING * sizes
    fastest = sizes[stiff].max(initial=0.0)
    others = sizes[~stiff | (sizes < fastest / _APART)].max(initial=0.0)
    return bool(fastest > _APART * max(others, system.fastest))


def _eigenvalues(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> np.ndarray:
    """Return the eigenvalues of the Jacobian at the start, or no eigenvalues if the Jacobian is not finite."""
    none = np.zeros(0, dtype=complex)
    if not system.n:
        return none
    p = system.vector(Instant(t0), system.discrete_start)
    if system.has_tape:
        jacobian, _ = Linearisation(system, p, z).at(0.0, x)
    else:
        jacobian = system.jacobian(0.0, x, p, z)
    return np.linalg.eigvals(jacobian) if np.isfinite(jacobian).all() else none
