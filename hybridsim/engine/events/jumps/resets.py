"""Apply the resets of one instant together: every reset reads the state before the first reset.

Each new value carries an error bound, from the values it was made of and from its own evaluation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

import numpy as np

from hybridsim.engine.events.diagnosis import reset_description
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.lowering.reset_keys import added, declared_reset, is_added
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.system import System
from hybridsim.expr import FunctionExpression, has_rounded_number, rounding_of
from hybridsim.expr.walk import NoValue
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of

Key = tuple[Any, ...]


@dataclass
class _Changes:
    """The changes of one variable by the resets of one instant: assigned values and added amounts."""

    set: list[tuple[Key, float, float]] = field(default_factory=list)  # key of the reset, value, error bound
    added: list[tuple[Key, float, float]] = field(default_factory=list)


def combine_resets(
    system: System,
    at: Situation,
    keys: list[Key],
    x_plus: np.ndarray,
    p_plus: np.ndarray,
    x_error: np.ndarray,
) -> str:
    """Write the state after all resets of one instant; return a message if resets contradict each other."""
    changes: dict[str, _Changes] = {}
    for key in keys:
        if key not in system.resets:
            continue
        amounts = set(system.resets[added(key)][1]) if added(key) in system.resets else set()
        for part, names in ((key, set(system.resets[key][1]) - amounts), (added(key), amounts)):
            if not names:
                continue
            values, errors = _evaluated(system, at, part)
            for name in names:
                place = _place(system, name)
                if not np.isfinite(values[place]):
                    state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(system.names, at.x, strict=True))
                    return f"{reset_description(system, key)} sets {name} to a value that is not finite, at {state}"
                one = changes.setdefault(name, _Changes())
                (one.set if part is key else one.added).append(
                    (key, float(values[place]), float(errors[place]))
                )
    n, discrete = system.n, system.layout.discrete_at
    for name, one in changes.items():
        if clash := _contradiction(system, name, one):
            return clash
        place = _place(system, name)
        if one.set:
            # the values agree within their bounds; take the most accurate one, independent of order
            _, value, error = min(one.set, key=lambda c: (c[2], c[1]))
        else:
            before, known = (at.x[place], x_error[place]) if place < n else (at.p[discrete + place - n], 0.0)
            value = math.fsum([before, *(amount for _, amount, _ in one.added)])
            error = math.fsum([known, *(e for _, _, e in one.added)]) + UNIT * abs(value)
        if place < n:
            x_plus[place], x_error[place] = value, error
        else:
            p_plus[discrete + place - n] = value
    return ""


def _contradiction(system: System, name: str, one: _Changes) -> str:
    """Return the reason why the changes of one variable at one instant are incompatible, or an empty text."""
    keys = [key for key, _, _ in (*one.set, *one.added)]
    if len(keys) < 2 or not one.set:
        return ""
    remedy = f'; to add amounts in any order, write {name} = "+= amount"'
    descriptions = " and ".join(dict.fromkeys(reset_description(system, key) for key in keys))
    if one.added:
        return f"at one instant {descriptions} both set {name} and add to it, and their order is not declared{remedy}"
    if any(_reads(system.model, key, name) for key in keys):
        return f"{descriptions} change {name} at one instant, and one of them also reads {name}{remedy}"
    (_, low, low_error), *_, (_, high, high_error) = sorted(one.set, key=lambda c: c[1])
    if high - low > low_error + high_error:
        return f"two resets at one instant set {name} to {low!r} and to {high!r} ({descriptions}){remedy}"
    return ""


def _place(system: System, name: str) -> int:
    """Return the index of a variable in the list of states and discrete states."""
    if name in system.names:
        return system.names.index(name)
    return system.n + [d.name for d in system.model.discrete].index(name)


def _reads(model: Model, key: Key, name: str) -> bool:
    """Return whether a reset reads the variable that it sets, also through definitions or mode variables."""
    value = declared_reset(model, key)[name]
    if isinstance(value, FunctionExpression):
        return False  # a Python function cannot be inspected
    behind = {n: [e.tree] for n, e in model.definitions}
    for component in model.all_components():
        for mode in component.modes:
            for n, e in mode.set.items():
                behind.setdefault(n, []).append(e.tree)
    seen: set[str] = set()
    open_ = [value.tree]
    while open_:
        for one in names_of(open_.pop()) - seen:
            seen.add(one)
            open_ += behind.get(one, [])
    return name in seen


def _evaluated(system: System, at: Situation, key: Key) -> tuple[np.ndarray, np.ndarray]:
    """Return the values that one reset assigns, with their error bounds.

    The bounds are first-order propagations of the errors of all inputs. Each is at least the roundoff of the value.
    """
    x, p = at.x.copy(), at.p.copy()
    system.apply_reset(key, at.s, at.x, at.p, at.z, x, p)
    values = np.concatenate([x, p[system.layout.discrete_slice]])
    if not np.isfinite(values).all():
        return values, UNIT * np.abs(values)
    x_error = np.maximum(at.x_error, UNIT * np.abs(at.x))
    errors = np.array([*x_error, *(UNIT * np.abs(at.p)), at.s_error])
    slopes = _slopes(system, at, key, errors) if system.has_tape else None
    if slopes is None:
        slopes = _differences(system, at, key, errors)
    return values, np.abs(slopes) @ errors + UNIT * np.abs(values) + _of_numbers(system, at, key)


def _of_numbers(system: System, at: Situation, key: Key) -> np.ndarray:
    """Return the errors that rounded numbers in the formulas of a reset cause in the states and discrete states."""
    found = np.zeros(system.n + len(system.model.discrete))
    values = dict(zip(system.names, at.x.tolist(), strict=True))
    discrete = at.p[system.layout.discrete_slice].tolist()
    values |= {
        d.name: value for d, value in zip(system.model.discrete, discrete, strict=True)
    } | system.values
    declared = declared_reset(system.model, key[1:] if is_added(key) else key)
    for name, value in declared.items():
        if name not in system.names or isinstance(value, FunctionExpression) or not has_rounded_number(value):
            continue
        if names_of(value.tree) <= values.keys():
            try:
                found[_place(system, name)] = rounding_of(value, values, values.keys())
            except NoValue:
                continue
    return found


def _slopes(system: System, at: Situation, key: Key, errors: np.ndarray) -> np.ndarray | None:
    """Return the derivatives of the values of a reset with respect to the quantities that the reset reads."""
    n, size = system.n, len(errors)
    seeds = np.eye(size)
    x, p = with_slopes(at.x, seeds[:n]), with_slopes(at.p, seeds[n:-1])
    out: list[Any] = [*x, *p[system.layout.discrete_slice]]
    function: FunctionType = system.code.module.reset
    try:
        with np.errstate(all="ignore"):
            differentiated(function)(
                with_slopes([at.s], seeds[-1:])[0], x, p, np.array([*at.z, system.resets[key][0]]), out
            )
    except (ValueError, ArithmeticError):
        return None
    slopes = values_and_slopes(out, size)[1]
    return slopes if np.isfinite(slopes).all() else None


def _differences(system: System, at: Situation, key: Key, errors: np.ndarray) -> np.ndarray:
    """Return the derivatives of a reset's values by finite differences, for Python code."""
    n, discrete = system.n, system.layout.discrete_slice
    columns = []
    for shift in np.diag(errors):
        (x, p), (x_on, p_on) = (at.x, at.p), (at.x + shift[:n], at.p + shift[n:-1])
        results = []
        for state, vector, s in ((x, p, at.s), (x_on, p_on, at.s + shift[-1])):
            x_out, p_out = state.copy(), vector.copy()
            system.apply_reset(key, s, state, vector, at.z, x_out, p_out)
            results.append(np.concatenate([x_out, p_out[discrete]]))
        moved, size = results[1] - results[0], float(shift.max(initial=0.0))
        columns.append(moved / size if size > 0.0 and np.isfinite(moved).all() else np.zeros(len(moved)))
    return np.array(columns).T
