"""This module refuses derivatives at points where an expression is not differentiable, and names the expression."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.expr.write import write
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.one_sided import Lookup, number_of

_EDGES = {"sqrt": 0.0, "abs": 0.0, "sign": 0.0, "log": 0.0, "asin": 1.0, "acos": 1.0}
_REMEDY = "move the run off this point, or write a smooth function, such as sqrt(x**2 + b**2) with a small b"


def no_derivative(
    system: System, title: str, by: Sequence[str], t: float, x: np.ndarray, states: Sequence[str]
) -> UsageError:
    """Return the error for a function that has no derivative with respect to some names at time t.

    title : the function, in a sentence. states : names of the states whose rates it contains, or none.
    """
    values = dict(zip(system.names, x.tolist(), strict=True))
    at = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
    found = sorted(_edges(system, states, system.values | values | {"t": t}))
    cause = (
        f": {' and '.join(found)} {'has' if len(found) == 1 else 'have'} a kink or an infinite slope there"
        * bool(found)
    )
    return UsageError(
        f"at t = {t:.9g} ({at}) {title} has no derivative with respect to {' and '.join(by)}{cause}",
        remedy=_REMEDY,
    )


def _edges(system: System, states: Sequence[str], values: Mapping[str, float]) -> Iterator[str]:
    """Yield the functions in a model's rates and guards that have no derivative at the given values."""
    model = system.written
    if model.flow is not None:
        return
    meanings, modes = Meanings(model), [mode for c in model.all_components() for mode in c.modes]
    trees = [state.der.tree for state in model.states if state.name in states or not states]
    trees += [e.tree for mode in modes for name, e in mode.der.items() if name in states or not states]
    trees += [e.tree for mode in modes for e in mode.set.values()]
    trees += [guard.expr.tree for mode in modes for guard in mode.guards if not states]
    trees += [meanings.definitions[name] for name in sorted(meanings.reached(trees))]
    seen = set()
    for node in (part for tree in trees for part in ast.walk(tree)):
        if (
            isinstance(node, ast.expr)
            and is_at_edge(node, values, meanings.lookup)
            and (text := write(node)) not in seen
        ):
            seen.add(text)
            yield text


def is_at_edge(node: ast.expr, values: Mapping[str, float], lookup: Lookup = lambda _: None) -> bool:
    """Return whether the function at one node of an expression may have no derivative at its arguments."""
    match node:
        case ast.Call(func=ast.Name(id=name), args=args):
            arguments = [number_of(arg, values, lookup) for arg in args]
            if name in _EDGES:
                return arguments[0] is not None and abs(arguments[0]) == _EDGES[name]
            if name in ("min", "max"):
                return None not in arguments and len(set(arguments)) < len(arguments)
            return name == "atan2" and arguments == [0.0, 0.0]
        case ast.BinOp(left=base, op=ast.Pow(), right=power):
            exponent = number_of(power, values, lookup)
            return (
                exponent is not None
                and exponent != round(exponent)
                and number_of(base, values, lookup) == 0.0
            )
        case ast.Compare(left=left, comparators=[right]):
            difference = number_of(ast.BinOp(left, ast.Sub(), right), values, lookup)
            return difference == 0.0
    return False
