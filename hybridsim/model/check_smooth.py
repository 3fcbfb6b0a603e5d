"""What is zero on a surface, of a gap and of a switching function alike: smooth, of states, and entered by no mode."""

from __future__ import annotations

from typing import NamedTuple

from hybridsim.expr import Expression
from hybridsim.model.declared import Declared
from hybridsim.model.nonsmooth import has_word
from hybridsim.model.scope import Scope


class Remedies(NamedTuple):
    """What to do about a function with a fault."""

    switched: str
    not_smooth: str
    no_state: str


def need_smooth(scope: Scope, part: Declared, what: str, expr: Expression, remedies: Remedies) -> None:
    """Report the expression of a part if it depends on a mode, has corners, or contains no state."""
    reached = scope.reached(expr)
    if not reached <= scope.all_names:
        return
    switched = sorted(filter(scope.is_switched, reached))
    if switched:
        message = f"{what} depends on '{switched[0]}', which depends on a mode"
        scope.fail(part, message, remedies.switched)
    elif any(map(has_word, [expr, *(e for n, e in scope.model.definitions if n in reached)])):
        scope.fail(part, f"{what} '{expr.text}' is not smooth", remedies.not_smooth)
    elif not any(scope.kinds.get(name) == "state" for name in reached):
        scope.fail(part, f"{what} '{expr.text}' contains no state", remedies.no_state)
