"""Explain why a step fails: a rate or guard is not a number, or a state grows without bound."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.expr.grammar import WHOLE_POWERS
from hybridsim.expr.write import write
from hybridsim.model.laws.vanishing_load import vanishing_load
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.one_sided import number_of

_GROWN = 1e6  # a state this many times its initial size (or 1) is reported as growing without bound
_FASTER = 10.0  # ratio to the initial rate that indicates a pole; a constant rate does not reach it
_SQUARED = 1e150  # norms are sums of squares
_NEAR, _FARTHEST = 60, 1e-5  # halvings of the probe, and its longest reach as a fraction of the time so far


@np.errstate(over="ignore", invalid="ignore")  # overflow and nan are what it looks for
def in_the_way(system: System, record: Trajectory, outcome: Outcome, origin: Instant, p: np.ndarray) -> str:
    """Return the reason why no step succeeds at the point where a run stopped, or an empty text.

    The search goes along the tangent at the last state. It looks for the first of the rates, then of the active guards,
    that is not a number.
    """
    if not system.n:
        return ""
    last = record.segments[-1] if record.segments and record.segments[-1].end >= origin else None
    if last is not None and float(last.end) == float(origin) and len(last.s) == 1:
        last = None
    s = float(last.s[-1]) if last is not None else 0.0
    x = last.x[-1] if last is not None else outcome.x
    p, z = (last.p, last.z) if last is not None else (p, outcome.z)
    here = origin.plus(s) if last is None else last.end
    t, began = float(here), record.segments[0].x[0] if record.segments else x
    t0 = float(record.segments[0].origin) if record.segments else t
    if load := vanishing_load(system.written, system.names, (t0, began.tolist()), (t, x.tolist())):
        return load
    first = np.abs(began)
    grown = np.flatnonzero(np.abs(x) > _GROWN * np.maximum(first, 1.0))
    if len(grown):
        states = ", ".join(f"{system.names[i]} = {x[i]:.3g}" for i in grown)
        return f"{states}: it may grow without bound"
    if lost := rates_without_value(system, s, x, p, z):
        return lost
    rates = system.flow(s, x, p, z)
    reach = _FARTHEST * max(abs(float(here)), abs(s), 1e-300)
    for k in range(_NEAR, -1, -1):
        step = reach * 0.5**k
        ahead = system.flow(s + step, x + step * rates, p, z)
        if not np.isfinite(ahead).all():
            names = [system.names[i] for i in np.flatnonzero(~np.isfinite(ahead))]
            why = power_without_value(system, names, float(here) + step, x + step * rates)
            why = why or _of_function(system, s + step, x + step * rates, p, z)
            return _sentence(system, "just after, the rate of", names, x, z) + why
        guards = system.rows(
            "guards", system.guard_count, np.array([s + step]), (x + step * rates)[None], p, z
        )[0]
        without = np.flatnonzero(system.active(z) & ~np.isfinite(guards))
        if len(without):
            titles = [system.guard_title(int(g), z) for g in without]
            # a held state has the rate of its constraint; its declared rate enters the guards
            held = [system.names[i] for g in without for i in system.pins.get(int(system.owner[g]), ())]
            return _sentence(system, "just after,", titles, x, z) + _cause(system, held, float(here), x)
    if power := _power_without_series(system, x, x + reach * rates):
        return power
    return _steep(system, record, s, x, p, z, rates, first, reach)


def name_vanished_load(system: System, record: Trajectory) -> None:
    """Correct the status and the message of a run that stopped because a law divides by a load of zero.

    Near the zero the signs of the load and of the rates of the law are those of roundings, so the run may seem to have
    no admissible mode, or to have events that accumulate.
    """
    if record.status not in ("accumulation", "inconsistent") or not record.segments:
        return
    first, last = record.segments[0], record.segments[-1]
    began, ended = (float(first.origin), first.x[0].tolist()), (float(last.end), last.x[-1].tolist())
    if load := vanishing_load(system.written, system.names, began, ended):
        record.status, record.message = "step-failure", f"after t = {ended[0]:.9g}: {load}"


def advice_on_sizes(system: System) -> str:
    """Return a remedy if steps become too small because the tolerance is below the rounding error."""
    is_sized = all(state.nominal is not None for state in system.model.states)
    return "pass a larger atol or rtol" if is_sized else "declare `nominal` sizes or pass atol"


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # nan is what it looks for
def rates_without_value(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> str:
    """Name the rates that are not numbers in the modes `z`, with the reasons; return an empty text if there is none."""
    names = [system.names[i] for i in np.flatnonzero(~np.isfinite(system.flow(s, x, p, z)))]
    if not names:
        return ""
    t = float(p[system.layout.origin_at]) + s
    why = _cause(system, names, t, x) or _of_function(system, s, x, p, z)
    return _sentence(system, "the rate of", names, x, z) + why


def _cause(system: System, names: list[str], t: float, x: np.ndarray) -> str:
    """Return the reason why the rates of some states are not numbers, or an empty text if the reason is unknown."""
    return power_without_value(system, names, t, x) or _division_by_zero(system, names, x)


def _of_function(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> str:
    """Return a message on a Python function that returned non-finite rates, or an empty text."""
    from hybridsim.engine.system.user_functions.code import PythonCode

    return system.code.flow_without_value(s, x, p, z) if isinstance(system.code, PythonCode) else ""


def _steep(
    system: System,
    record: Trajectory,
    s: float,
    x: np.ndarray,
    p: np.ndarray,
    z: np.ndarray,
    rates: np.ndarray,
    first: np.ndarray,
    reach: float,
) -> str:
    """Name the values that are too large or change too fast for any step, or return an empty text."""
    found = [
        f"{system.names[i]} = {x[i]:.3g} is too large to be squared"
        for i in np.flatnonzero(np.abs(x) > _SQUARED)
    ]
    if found:
        return ", ".join(found)
    none = np.zeros(system.n)
    guards = system.series(s, x, p, z, none, 0.0).guards
    rates_before, guards_before = np.zeros(system.n), np.zeros(len(guards))
    if record.segments:
        start = record.segments[0]
        rates_before = system.flow(0.0, start.x[0], start.p, start.z)
        guards_before = system.series(0.0, start.x[0], start.p, start.z, none, 0.0).guards[:, 0]
    steep = (np.abs(rates) * reach > np.maximum(first, np.abs(x))) & (
        x != 0.0
    )  # any rate is large relative to a state at zero
    faster = np.abs(rates) > _FASTER * np.abs(rates_before)
    found = [
        f"{system.names[i]} = {x[i]:.3g} has the rate {rates[i]:.3g}" for i in np.flatnonzero(steep & faster)
    ]
    poles = system.active(z) & (np.abs(guards[:, 2]) * reach > np.abs(guards[:, 1]))
    poles &= ~(np.abs(guards[:, 0]) <= np.abs(guards_before))
    for g in np.flatnonzero(poles & (np.abs(guards[:, 1]) * reach > np.abs(guards[:, 0]))):
        found.append(f"{system.guard_title(int(g), z)} = {guards[g, 0]:.3g} has the rate {guards[g, 1]:.3g}")
    return f"{', '.join(found)}: there may be a pole" if found else ""


def power_without_value(system: System, names: list[str], t: float, x: np.ndarray) -> str:
    """Name a root or fractional power in the rates that is undefined at a state, with a remedy."""
    from hybridsim.model.smoothing.nonsmooth import roots_in

    model = system.model
    if model.flow is not None:
        return ""
    meanings = Meanings(model)
    values = model.parameter_values() | dict(zip(system.names, x.tolist(), strict=True)) | {"t": t}
    modes = [mode for component in model.all_components() for mode in component.modes]
    rates = [state.der for state in model.states if state.name in names]
    rates += [mode.der[name] for mode in modes for name in names if name in mode.der]
    rates += [expr for mode in modes for expr in mode.set.values()]
    for node, base, power in (found for rate in rates for found in roots_in(rate, meanings)):
        value = number_of(base, values, meanings.lookup)
        if value is not None and value < 0.0:  # None if it depends on a variable of a mode
            remedy = f"to continue beyond zero, write abs({write(base)})**{power}*sign({write(base)})"
            return f": '{write(node)}' has no value for {write(base)} < 0; {remedy}, or end the run there by a monitor"
    return ""


def _power_without_series(system: System, x: np.ndarray, ahead: np.ndarray) -> str:
    """Name a power without a Taylor series at x <= 0, with a remedy."""
    from hybridsim.model.smoothing.nonsmooth import roots_in

    model = system.model
    if model.flow is not None:
        return ""
    meanings, numbers = Meanings(model), model.parameter_values()
    points = [numbers | dict(zip(system.names, point.tolist(), strict=True)) for point in (x, ahead)]
    for state in model.states:
        for node, base, _ in roots_in(state.der, meanings):
            power = number_of(node.right, numbers, meanings.lookup) if isinstance(node, ast.BinOp) else None
            if power is None or power != round(power) or power in WHOLE_POWERS:
                continue
            values = [number_of(base, point, meanings.lookup) for point in points]
            if any(value is not None and value <= 0.0 for value in values):
                text, place = write(base), state.der.place or state.place
                return (
                    f"{place.prefix if place else ''}'{write(node)}' in the rate of {state.name} has no Taylor series "
                    f"at {text} <= 0, because its exponent {power:g} is given by a name: write the number itself, "
                    "or use an integrator without Taylor series, such as dop853"
                )
    return ""


def _division_by_zero(system: System, names: list[str], x: np.ndarray) -> str:
    """Name a denominator in the rates that is zero in every mode, or return an empty text."""
    if system.model.flow is not None:
        return ""
    lookup = Meanings(system.model).lookup
    values = system.model.parameter_values() | dict(zip(system.names, x.tolist(), strict=True))
    for rate in (state.der.tree for state in system.model.states if state.name in names and state.der):
        for node in ast.walk(rate):
            if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Div):
                continue
            if number_of(node.right, values, lookup) == 0.0:
                return f": it divides by {write(node.right)}, which is 0"
    return ""


def _sentence(system: System, head: str, names: list[str], x: np.ndarray, z: np.ndarray) -> str:
    """Return a sentence on quantities that are not numbers, with the state and the modes."""
    state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(system.names, x, strict=True))
    modes = ", ".join(f"{a.name} {a.modes[m]}" for a, m in zip(system.declared, z, strict=False))
    where = f", {modes}" if modes else ""
    return f"{head} {', '.join(names)} is not a number (at {state}{where})"


def reset_description(system: System, key: tuple[object, ...]) -> str:
    """Return the name of a reset for messages, given its key."""
    model = system.model
    if key[0] == "limit":
        return f"the limit of {system.automata[int(str(key[1]))].name}"
    if key[0] != "choice":
        kind, number = str(key[0]), int(str(key[1]))
        parts: Any = model.monitors if kind == "monitor" else model.schedules
        return f"the reset of {kind} {parts[number].name}"
    c, mode, j = (int(str(k)) for k in key[1:4])
    automaton = system.automata[c]
    return f"the reset of guard {automaton.guard_names[mode][j]} of {automaton.name}.{automaton.modes[mode]}"
