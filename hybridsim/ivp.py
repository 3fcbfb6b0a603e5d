"""This module converts one mode of a model to an initial value problem for other solvers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from hybridsim.arguments import cannot_be, chosen_model, known_entry, known_mode
from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.model import Model

Function = Callable[[float, np.ndarray], Any]


class Ivp(NamedTuple):
    """The result of `to_ivp`, with fields named like the arguments of `scipy.integrate.solve_ivp`."""

    fun: Function
    events: tuple[Function, ...]
    jac: Function


@refusing
def to_ivp(
    model: Model | str | PathLike[str],
    z: Mapping[str, str] | None = None,
    *,
    params: Mapping[str, Any] | None = None,
) -> Ivp:
    """Return one mode of a model as functions of time t and state x.

    fun(t, x) is dx/dt (n,), jac(t, x) its Jacobian (n, n), and events the guards of the mode: the mode lasts while
    all of them are >= 0. Each is a function (t, x) -> float with the attributes terminal = True and direction = -1
    as `solve_ivp` reads them, and component and guard, which name it. States that the mode holds are evaluated from
    their constraint. Corners (`abs`, `min`, `max`, conditionals) and the pieces of a law's tables are switched inside
    the functions, by the state they are called with. Discrete states keep their initial values.

    Parameters
    ----------
    model : str, path or Model
        A `Model`, the name of a packaged one, or the path of a ``.toml`` file.
    z : mapping of str to str, optional
        Mode of each component by name; the default is the declared initial mode. Contacts have no initial mode, so
        their modes are required.
    params : mapping of str to str or float, optional
        Parameter values that replace the declared ones.

    Returns
    -------
    Ivp
        The named tuple (fun, events, jac).

    Raises
    ------
    UsageError
        For an unknown component or mode, a contact without a mode, or gaps that are never zero together.

    Notes
    -----
    Use it with another solver, and decide yourself what follows an event. `simulate` does both, and you can add your
    own solver as an integrator (`hybridsim.integrators.contract.Integrator`).

    Examples
    --------
    >>> import hybridsim as hs
    >>> from scipy.integrate import solve_ivp
    >>> fun, events, jac = hs.to_ivp("dfcs", {"f": "stick"})
    >>> release = solve_ivp(fun, (0, 0.01), [0.0, 0.0], events=events, max_step=1e-4)
    >>> float(round(release.t[-1], 6))  # asin(mu*N/F0)/omega
    0.00172
    """
    from hybridsim.engine.native.compiler import announce_compilation
    from hybridsim.engine.record.counters import Counters
    from hybridsim.engine.run.stepping import Flow
    from hybridsim.engine.system.instant import Instant
    from hybridsim.engine.system.sides import modes_by_state
    from hybridsim.engine.system.system import System
    from hybridsim.model.smoothing.whole_numbers import with_whole_numbers

    model = chosen_model(model, params).validate()
    if with_whole_numbers(model) is not model:
        raise UsageError(
            f"model {model.name} contains floor, mod or round, whose whole numbers change inside a mode",
            remedy="use hs.simulate, or write the number as a discrete state",
        )
    announce_compilation()
    system = System(model, as_written=True)
    modes = _modes(system, z)
    _refuse_dependent(system, modes)
    discrete = np.array([model.discrete_values()[d.name] for d in model.discrete], dtype=float)

    tables = np.flatnonzero(system.is_corner).tolist()
    from_zero = system.vector(Instant(0.0), discrete)
    flows: dict[bytes, Flow] = {}

    def at(t: float, x: np.ndarray) -> tuple[Flow, float]:
        """Return the `Flow` and the local time at time t and states x; inputs and tables are on their active pieces."""
        vector, s = (
            (system.vector(Instant(float(t)), discrete), 0.0) if system.signals else (from_zero, float(t))
        )
        z = modes_by_state(system, tables, s, x, vector, modes) if tables else modes
        if system.signals:
            return Flow(system, vector, z, Counters()), s
        key = z.tobytes()
        if key not in flows:
            flows[key] = Flow(system, vector, z, Counters())
        return flows[key], s

    def fun(t: float, x: Any) -> np.ndarray:
        flow, s = at(t, state := _state(x))
        return flow.rhs(s, state)

    def jac(t: float, x: Any) -> np.ndarray:
        flow, s = at(t, state := _state(x))
        return flow.jacobian(s, state)

    def event(number: int, component: str, guard: str) -> Function:
        def value(t: float, x: Any) -> float:
            flow, s = at(t, state := _state(x))
            return float(flow.guards(np.array([s]), state[None, :])[0, number])

        # solve_ivp reads the attributes terminal and direction; component and guard are for the user
        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]  # SciPy reads them off the function
        value.component, value.guard = component, guard  # type: ignore[attr-defined]  # for the caller to read
        return value

    events = tuple(
        event(number, automaton.name, name)
        for automaton, mode in zip(system.automata, modes, strict=True)
        if not automaton.is_corner
        for number, name in zip(automaton.guards[mode], automaton.guard_names[mode], strict=True)
    )
    return Ivp(fun, events, jac)


def _state(x: Any) -> np.ndarray:
    return np.ascontiguousarray(x, dtype=float)


def _modes(system: Any, declared: Mapping[str, str] | None) -> np.ndarray:
    names = [a.name for a in system.automata]
    z: object = {} if declared is None else declared
    if not isinstance(z, Mapping):
        raise cannot_be("z", z, "use a dict of component names and mode names")
    for name in z:
        known_entry(name, names, "z", f"a component of model '{system.model.name}'", "components")
    modes = []
    for automaton in system.automata:
        mode = z.get(automaton.name)
        if mode is None and automaton.initial < 0:
            raise UsageError(
                f"component {automaton.name} has no initial mode, so `z` must contain its mode",
                remedy=f"use one of {', '.join(automaton.modes)}",
            )
        if mode is None:
            modes.append(automaton.initial)
        else:
            modes.append(known_mode(mode, automaton.modes, "z", automaton.name))
    return np.array(modes, dtype=np.int64)


def _refuse_dependent(system: Any, z: np.ndarray) -> None:
    """Raise an error if the modes `z` keep gaps at zero of which one follows from the others."""
    from hybridsim.engine.system.instant import Instant
    from hybridsim.engine.system.tangents import TangentTape

    free, held = z.copy(), []
    for k, c in enumerate(system.surface_of):
        automaton = system.automata[c]
        if c in system.projected and z[c] == automaton.hold:
            held.append(k)
            free[c] = automaton.above  # holding modes replace the states of their gaps
    if len(held) < 2:
        return
    start = system.start_state({})
    points = np.array([start, start + 0.5 + 0.3 * np.sin(np.arange(1.0, 1.0 + system.n))])
    p = system.vector(Instant(0.0), system.discrete_start)
    tape = TangentTape(system, free, surfaces=tuple(held))
    rows = tape(np.zeros(2), points, p, np.eye(system.n + 1 + len(p), system.n)).slopes[:, system.n :]
    rows = rows[np.isfinite(rows).all(axis=(1, 2))]
    if len(rows) and max(np.linalg.matrix_rank(one) for one in rows) < len(held):
        names = ", ".join(system.automata[system.surface_of[k]].name for k in held)
        raise UsageError(
            f"`z` holds {names} at once, but these gaps depend on each other and cannot all be kept at zero",
            remedy="open one of these gaps in `z`",
        )
