"""This module checks the forcing for a steady state: the argument `period`, and declarations that never repeat."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from typing import Any

from hybridsim.arguments import cannot_be, number
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.expr import evaluate
from hybridsim.expr.grammar import TIME
from hybridsim.model import Model
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.one_sided import names_of, number_of

_COMMENSURATE = 1e-9  # relative difference from a whole multiple
_PERIODIC = ("sin", "cos")
_SAMPLES, _OFFSET = 32, 0.381966  # times in a period; the offset keeps them away from steps at round times
_REPEATS = 1e-6  # largest relative change over a period, because periods are rounded


def require_multiple(period: Any, own: float | None, name: str) -> float:
    """Return a period as a number, after checking that it is a multiple of the forcing's own period, if known."""
    found = number(period, "period")
    if not (found > 0.0 and math.isfinite(found)):
        raise cannot_be("period", found, "use a time above zero")
    if own is not None and abs(found / own - max(round(found / own), 1)) > _COMMENSURATE * found / own:
        raise UsageError(
            f"`period` is {found!r}, but {name} is forced with the period {own!r}",
            remedy="remove `period`, or use a whole multiple of the forcing period",
        )
    return found


def refuse_what_ends(system: System) -> None:
    """Reject models with impacts, and models that an event or an input changes permanently."""
    model = system.model
    if system.is_unilateral.any():
        raise UsageError(
            f"model {model.name} has impacts, for which steady states are not supported",
            remedy="measure one period late in a run, hs.sweep(..., 'maximum.x', after=100), whose reading 'residual' "
            "is the distance from repeating; or write the impact as a guard with a reset",
        )
    for declared in model.inputs:
        if declared.period is None:
            raise UsageError(
                f"model {model.name} is driven by {declared.subject}, which does not repeat (a {declared.kind}), so "
                "there is no steady state",
                remedy=f"use a periodic input, or replace the {declared.kind} by its final value",
            )
    for clock in model.schedules:
        if clock.period is None or clock.count is not None:
            raise UsageError(
                f"schedule {clock.name} of model {model.name} ends, but a steady state needs schedules without an end",
                remedy="remove the schedule, or remove its `count`",
            )
        start = evaluate(clock.start, system.values) if clock.start is not None else 0.0
        if start >= evaluate(clock.period, system.values):
            raise UsageError(
                f"clock {clock.name} of model {model.name} begins after its first period",
                remedy="use a `start` below the period of the clock",
            )


def refuse_plain_time(system: System, period: float | None) -> None:
    """Reject a declaration that contains t itself, if it does not repeat with the period or if the period is unknown.

    Raises
    ------
    UsageError
        The message names the declaration.
    """
    tape = system.code.data["tape"]
    if tape is None or all(source != system.layout.origin_at for _, source in tape["parameters"]):
        return
    model = system.written
    meanings, discrete = Meanings(model), {part.name for part in model.discrete}
    inputs = [signal.name for signal in model.inputs]
    names = [*system.names, *sorted(discrete), *inputs, *model.variables()]
    numbers = {name: 0.739 + 0.0618 * k for k, name in enumerate(names)} | model.parameter_values()
    for declaration, tree in _with_time(model, meanings):
        if period is None:
            raise UsageError(
                f"{_cause(declaration, tree, meanings)} contains t outside of sines and cosines, so the period of "
                f"model {model.name} is unknown",
                remedy="if the motion is periodic, pass `period`",
            )
        found = _change(tree, period, numbers, meanings)
        if found is None:
            continue
        _refuse_stored_time(declaration, tree, meanings, discrete)
        for name in sorted(meanings.reached([tree])):  # a definition that does not repeat is the cause
            inner = _change(meanings.definitions[name], period, numbers, meanings)
            declaration, found = (declaration, found) if inner is None else (f"definition {name}", inner)
        t, change = found
        raise UsageError(
            f"{declaration} does not repeat after the period {period:g}: it changes by {change:.4g} from "
            f"t = {t:.4g} to t = {t + period:.4g}",
            remedy="pass the period of the forcing, or replace a ramp by its final value",
        )
    if period is None:  # t in a guard or a reset
        raise UsageError(
            f"model {model.name} contains t outside of sines and cosines, so the period of its forcing is unknown",
            remedy="if the motion is periodic, pass `period`",
        )
    for declaration, tree in _event_trees(model):
        if (
            _has_plain_time(meanings.written_out(tree))
            and _change(tree, period, numbers, meanings) is not None
        ):
            _refuse_stored_time(declaration, tree, meanings, discrete)


def _refuse_stored_time(declaration: str, tree: ast.expr, meanings: Meanings, discrete: set[str]) -> None:
    """Reject a comparison of t with a discrete state, which may store the time of an event."""
    stored = sorted(meanings.depended_on(names_of(tree)) & discrete)
    if stored:
        raise UsageError(
            f"{declaration} depends on t and on the discrete state {stored[0]}, which may store a time, but the search "
            "for a steady state sets t back after each period",
            remedy="use a clock with a period, or a state with the rate 1 that a reset sets to 0",
        )


def _change(
    tree: ast.expr, period: float, numbers: Mapping[str, float], meanings: Meanings
) -> tuple[float, float] | None:
    """Return a time, and the change of an expression over the period from then on, or None if it repeats."""
    times = [period * (k + _OFFSET) / _SAMPLES for k in range(_SAMPLES)]
    pairs = [
        [number_of(tree, {**numbers, TIME: at}, meanings.lookup) for at in (t, t + period)] for t in times
    ]
    largest = max((abs(value) for pair in pairs for value in pair if value is not None), default=0.0)
    for t, (now, later) in zip(times, pairs, strict=True):
        if now is not None and later is not None and abs(later - now) > _REPEATS * largest:
            return t, later - now
    return None


def _cause(declaration: str, tree: ast.expr, meanings: Meanings) -> str:
    """Return the definition that brings t into a declaration, or the declaration itself."""
    inner = [name for name in sorted(meanings.reached([tree])) if _has_plain_time(meanings.definitions[name])]
    return f"definition {inner[0]}" if inner else declaration


def _with_time(model: Model, meanings: Meanings) -> Iterator[tuple[str, ast.expr]]:
    """Yield the declarations that depend on t outside of sines and cosines of linear time, with names for messages.

    A definition is listed only if an event reads it. Elsewhere its value is inserted.
    """
    in_events = meanings.reached(tree for _, tree in _event_trees(model))
    found = [(f"definition {name}", expr) for name, expr in model.definitions if name in in_events]
    for contact in model.contacts:
        found.append((f"contact {contact.name}, normal", contact.normal))
        found.append((f"contact {contact.name}, velocity", contact.velocity))
        found += [(f"contact {contact.name}, {name}", expr) for name, expr in contact.arguments.items()]
    for component in model.components:
        for mode in component.modes:
            what = f"component {component.name}, mode {mode.name}"
            found += [(f"{what}, {name}", expr) for name, expr in (*mode.der.items(), *mode.set.items())]
    found += [(f"state {state.name}, der", state.der) for state in model.states]
    for what, expr in found:
        if _has_plain_time(meanings.written_out(expr.tree)):
            yield what, expr.tree


def _event_trees(model: Model) -> Iterator[tuple[str, ast.expr]]:
    """Yield the expressions that decide events or are set by them, with names for messages."""
    resets = [(f"monitor {one.name}", one.reset) for one in model.monitors]
    resets += [(f"schedule {one.name}", one.reset) for one in model.schedules]
    yield from ((f"monitor {one.name}", one.expr.tree) for one in model.monitors)
    for component in model.components:
        for guard in (guard for mode in component.modes for guard in mode.guards):
            what = f"guard {guard.name} of {component.name}"
            yield what, guard.expr.tree
            yield from ((what, choice.when.tree) for choice in guard.then if choice.when is not None)
            resets += [(what, choice.reset) for choice in guard.then]
    yield from (
        (f"{what}, reset of {name}", one.tree) for what, reset in resets for name, one in reset.items()
    )


def _has_plain_time(node: ast.AST) -> bool:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _PERIODIC:
        return not _is_linear(node.args[0])
    if isinstance(node, ast.Name):
        return node.id == TIME
    return any(map(_has_plain_time, ast.iter_child_nodes(node)))


def _is_linear(node: ast.expr) -> bool:
    """Return whether the form of an expression shows that it is linear in t."""
    match node:
        case ast.BinOp(op=ast.Add() | ast.Sub(), left=left, right=right):
            return _is_linear(left) and _is_linear(right)
        case ast.BinOp(op=ast.Mult(), left=left, right=right):
            return _is_linear(left) and _is_linear(right) and not (_has_time(left) and _has_time(right))
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            return _is_linear(left) and not _has_time(right)
        case ast.UnaryOp(operand=operand):
            return _is_linear(operand)
        case ast.Name():
            return True
    return not _has_time(node)


def _has_time(node: ast.expr) -> bool:
    return TIME in names_of(node)
