"""This module checks that gaps and switching functions are smooth, contain a state and are the same in all modes."""

from __future__ import annotations

import ast
from typing import NamedTuple

from hybridsim.expr import Expression
from hybridsim.expr.grammar import TIME
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.declared import Declared
from hybridsim.model.smoothing.nonsmooth import has_word, sides_of
from hybridsim.model.smoothing.one_sided import names_of


class Remedies(NamedTuple):
    """The remedies for the three possible errors of a gap or a switching function."""

    switched: str
    not_smooth: str
    no_state: str


def need_smooth(scope: Scope, part: Declared, what: str, expr: Expression, remedies: Remedies) -> None:
    """Report the expression if it depends on a mode, has corners, or contains no state."""
    reached = scope.reached(expr)
    if not reached <= scope.all_names:
        return
    switched = sorted(filter(scope.is_switched, reached))
    if switched:
        message = f"{what} depends on '{switched[0]}', which depends on a mode"
        scope.fail(part, message, remedies.switched)
    elif any(_is_rough(scope, e) for e in (expr, *(e for n, e in scope.model.definitions if n in reached))):
        scope.fail(part, f"{what} '{expr.text}' is not smooth", remedies.not_smooth)
    elif not any(scope.kinds.get(name) == "state" for name in reached):
        scope.fail(part, f"{what} '{expr.text}' contains no state", remedies.no_state)


def _is_rough(scope: Scope, expr: Expression) -> bool:
    """Return whether an expression has a corner or jump; conditions on time alone do not count."""
    if not has_word(expr):
        return False
    known = scope.model.constant_names() | {TIME}
    for part in ast.walk(expr.tree):
        if isinstance(part, ast.IfExp):
            decides: ast.expr = part.test
        elif isinstance(part, ast.Call) and sides_of(part):
            decides = ast.Tuple(part.args)
        elif isinstance(part, ast.Call) and ast.unparse(part.func) in ("min", "max"):
            return True
        else:
            continue
        if not names_of(decides) <= known:
            return True
    return False
