"""What stands in the way of a step: a rate or guard without a value, or a state that grows without bound."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.model.laws.load_at_zero import load_at_zero

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Outcome
    from hybridsim.engine.record.trajectory import Trajectory
    from hybridsim.engine.system.instant import Instant
    from hybridsim.engine.system.system import System

_GROWN = 1e6  # times the size at the start (or 1): worth saying where no step succeeds any more
_FASTER = 10.0  # times the rate at the start: what a pole makes of it, and a fall at a constant rate does not
_SQUARED = 1e150  # norms are sums of squares
_NEAR, _FARTHEST = 60, 1e-5  # halvings of a probe, which reaches this share of the time so far


@np.errstate(over="ignore", invalid="ignore")  # it looks for what is too large or no number
def in_the_way(system: System, record: Trajectory, outcome: Outcome, origin: Instant, p: np.ndarray) -> str:
    """Why no step goes on from where a run stopped, in words; empty where that cannot be told.

    Looks along the tangent at the last state for the first of the rates, then of the active guards, to have no value.
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
    if load := load_at_zero(system.written, system.names, (t0, began.tolist()), (t, x.tolist())):
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
            return _said(system, "just after, the rate of", names, x, z) + why
        guards = system.rows(
            "guards", system.guard_count, np.array([s + step]), (x + step * rates)[None], p, z
        )[0]
        without = np.flatnonzero(system.active(z) & ~np.isfinite(guards))
        if len(without):
            titles = [system.guard_title(int(g), z) for g in without]
            # what a mode holds has the rate of its constraint: the one that is declared is in the guards
            held = [system.names[i] for g in without for i in system.pins.get(int(system.owner[g]), ())]
            return _said(system, "just after,", titles, x, z) + _cause(system, held, float(here), x)
    if power := _power_without_series(system, x, x + reach * rates):
        return power
    return _steep(system, record, s, x, p, z, rates, first, reach)


def advice_on_sizes(system: System) -> str:
    """What to do where steps collapse and nothing is in their way: what is asked for is below what can be computed."""
    is_sized = all(state.nominal is not None for state in system.model.states)
    return "pass a larger atol or rtol" if is_sized else "declare `nominal` sizes or pass atol"


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # it looks for what is no number
def rates_without_value(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> str:
    """The states whose rates are no numbers in the modes z, and why, in words; empty where all have a value."""
    names = [system.names[i] for i in np.flatnonzero(~np.isfinite(system.flow(s, x, p, z)))]
    if not names:
        return ""
    t = float(p[system.layout.origin_at]) + s
    why = _cause(system, names, t, x) or _of_function(system, s, x, p, z)
    return _said(system, "the rate of", names, x, z) + why


def _cause(system: System, names: list[str], t: float, x: np.ndarray) -> str:
    """What has no value in the rates of some states; empty where that cannot be told."""
    return power_without_value(system, names, t, x) or _division_by_zero(system, names, x)


def _of_function(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> str:
    """What a Python function returns where a rate has no value; empty for a model of expressions."""
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
    """What has a value, and moves too fast or is too large for any step; empty where nothing does."""
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
    steep = (np.abs(rates) * reach > np.maximum(first, np.abs(x))) & (x != 0.0)  # from zero anything is fast
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
    """The root or fractional power in the rates of some states that has no value in a state, and what to write."""
    from hybridsim.expr.write import write
    from hybridsim.model.meanings import Meanings
    from hybridsim.model.smoothing.nonsmooth import roots_in
    from hybridsim.model.smoothing.one_sided import number_of

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
        if value is not None and value < 0.0:  # None: it depends on what a mode sets
            remedy = f"to continue beyond zero, write abs({write(base)})**{power}*sign({write(base)})"
            return f": '{write(node)}' has no value for {write(base)} < 0; {remedy}, or end the run there by a monitor"
    return ""


def _power_without_series(system: System, x: np.ndarray, ahead: np.ndarray) -> str:
    """The whole power under a name that has a value beyond zero and no Taylor series there, and what to write."""
    from hybridsim.expr.grammar import WHOLE_POWERS
    from hybridsim.expr.write import write
    from hybridsim.model.meanings import Meanings
    from hybridsim.model.smoothing.nonsmooth import roots_in
    from hybridsim.model.smoothing.one_sided import number_of

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
                    f"at {text} <= 0, as its exponent is {power:g} given by a name; write the number itself, or use an "
                    "integrator without Taylor series, such as dop853"
                )
    return ""


def _division_by_zero(system: System, names: list[str], x: np.ndarray) -> str:
    """The denominator in the rates of some states that is zero whatever the modes are; empty where there is none."""
    from hybridsim.expr.write import write
    from hybridsim.model.meanings import Meanings
    from hybridsim.model.smoothing.one_sided import number_of

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


def _said(system: System, head: str, names: list[str], x: np.ndarray, z: np.ndarray) -> str:
    """What is no number, and where."""
    state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(system.names, x, strict=True))
    modes = ", ".join(f"{a.name} {a.modes[m]}" for a, m in zip(system.declared, z, strict=False))
    where = f", {modes}" if modes else ""
    return f"{head} {', '.join(names)} is not a number (at {state}{where})"


def reset_in_words(system: System, key: tuple[object, ...]) -> str:
    """Whose reset it is, by its key."""
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
