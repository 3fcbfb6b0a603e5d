"""Which integrator "auto" takes, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.events.resolve import Settling
from hybridsim.engine.linear.modes import is_linear_beside_corners, what_is_not_linear
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.user_functions.code import PythonCode
from hybridsim.integrators.rosenbrock.step import linearise

if TYPE_CHECKING:
    from hybridsim.integrators.contract import Integrator

_SMALL = 24  # states and guards up to which tables of closed forms are small
_TIGHT = 1e-10  # rtol below which series of high order cost least
_STABLE = 3.0  # |h lambda| at which explicit methods of high order are about to lose stability
_MANY = 1e6  # steps held down by stability alone: a minute where a stiff method takes less than a second
_DECAYING = 0.25  # share of an eigenvalue that is its decay, so that rodas5p damps it out
_MANY_IN_PYTHON = 1e4  # the same where no compiled loop takes them
_APART = (
    10.0  # times as fast as all that moves beside it is a decay that is over before anything else happens
)


class Choice(NamedTuple):
    """An integrator by name, and the reason in words."""

    name: str
    reason: str


def choose(system: System, x0: np.ndarray, z0: np.ndarray, span: tuple[float, float], rtol: float) -> Choice:
    """The closed form where it goes from event to event, a stiff method where stability would rule, an explicit one.

    Stiffness is seen where it shows at the start, in the eigenvalues of the Jacobian; what begins later is met on the
    way, see `successor_of`.
    """
    if not system.has_tape:
        return _for_functions(system, x0, z0, span)
    model = system.model
    is_small = system.n + system.guard_count <= _SMALL and span[1] >= span[0]
    is_watched, rest = bool(model.monitors or model.inputs), ""
    if is_small and what_is_not_linear(system) is None and is_linear_beside_corners(system):
        if not is_watched:
            return Choice("exact", "its modes are linear in the states")
        what = "monitors" if model.monitors else "inputs"
        rest = f" (exact was not chosen because the model has {what})"
    steps = _steps_for_stability(system, x0, z0, span)
    in_python = is_watched or system.has_corners or span[1] < span[0]
    if steps > _MANY or (steps > _MANY_IN_PYTHON and in_python and _is_apart(system, x0, z0, span[0])):
        return Choice("rodas5p", f"stability would hold an explicit method to {steps:.0e} steps")
    if system.has_corners:
        return Choice(
            "dop853",
            "its modes are not stiff at the start; jumps inside modes are not treated as events",
        )
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


def successor_of(name: str, system: System) -> Integrator | None:
    """The method that goes on where one that was chosen meets stiffness on the way; None where it does not look."""
    from hybridsim.integrators.rosenbrock.rodas5p import Rodas5P

    return Rodas5P() if name == "dop853" and system.has_tape else None


def _fastest_decay(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> float:
    """The largest rate -Re(lambda) at which anything decays at the start."""
    return max(0.0, float(-_eigenvalues(system, x, z, t0).real.min(initial=0.0)))


def _is_apart(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> bool:
    """Whether decays are far faster than all that they do not belong to, so that they alone hold the steps down."""
    values = _eigenvalues(system, x, np.maximum(z, 0), t0)
    sizes = np.abs(values)
    stiff = values.real < -_DECAYING * sizes
    fastest = sizes[stiff].max(initial=0.0)
    others = sizes[~stiff | (sizes < fastest / _APART)].max(initial=0.0)
    return bool(fastest > _APART * max(others, system.fastest))


def _eigenvalues(system: System, x: np.ndarray, z: np.ndarray, t0: float) -> np.ndarray:
    """Those of the Jacobian at the start; none where it is not finite."""
    none = np.zeros(0, dtype=complex)
    if not system.n:
        return none
    p = system.vector(Instant(t0), system.discrete_start)
    jacobian = _jacobian(system, x, p, z) if system.has_tape else system.jacobian(0.0, x, p, z)
    return np.linalg.eigvals(jacobian) if np.isfinite(jacobian).all() else none


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
