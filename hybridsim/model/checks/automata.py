"""This module checks components: modes, guards, choices, variables, initial mode and surface."""

from __future__ import annotations

from collections.abc import Iterable

from hybridsim.errors import nearest
from hybridsim.model.checks.names import check_labels
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.component import Component, Guard, Mode
from hybridsim.model.parts.declared import Declared


def check_automata(scope: Scope) -> None:
    """Report invalid components, and rates that two components set."""
    owner: dict[str, str] = {}
    for component in scope.components:
        _component(scope, component)
        for state in dict.fromkeys(name for mode in component.modes for name in mode.der):
            if state in owner:
                message = f"components {owner[state]} and {component.name} both set the rate of '{state}'"
                scope.fail(
                    component,
                    message,
                    "let one component set a variable, and use this variable in the other rate",
                )
            owner.setdefault(state, component.name)
    for output in scope.model.outputs:
        for key in output.modes:
            _mode_key(scope, output, f"output {output.name}", key)


def _component(scope: Scope, component: Component) -> None:
    what = f"component {component.name}"
    names = [mode.name for mode in component.modes]
    if not names:
        scope.fail(component, f"{what} has no modes", "declare at least one mode")
        return
    check_labels(scope, f"{what}: mode", component.modes)
    if component.initial is not None and component.initial not in names:
        scope.unknown(component, f"{what}: unknown initial mode", component.initial, names, "modes")
    if component.initial is None and component.surface is None:
        remedy = f"write initial = true in one of the modes {', '.join(names)}"
        if not (component.place and component.place.file):
            remedy = (
                f"pass initial={names[0]!r} to hs.Component, or the name of another mode: {', '.join(names)}"
            )
        scope.fail(component, f"{what} has no initial mode", remedy)
    _surface(scope, component, what, names)
    _limit(scope, component, what, names)
    for mode in component.modes:
        _variables(scope, component, mode, what)
        for state in mode.der:
            known = [part.name for part in scope.model.states]
            if state not in known:
                scope.unknown(
                    mode, f"{what}, mode {mode.name}: rate of an unknown state", state, known, "states"
                )
        check_labels(scope, f"{what}, mode {mode.name}: guard", mode.guards)
        for guard in mode.guards:
            _guard(scope, component, guard, f"{what}, mode {mode.name}, guard {guard.name}", names)


def _variables(scope: Scope, component: Component, mode: Mode, what: str) -> None:
    surface = component.surface
    solved = surface.unknown if surface and mode.name == surface.hold else None
    for name in component.variables:
        if name == solved:
            if name in mode.set:
                message = f"{what}, mode {mode.name} sets '{name}', but the solver computes it in this mode"
                scope.fail(mode, message, f"remove set = {{ {name} = ... }}")
        elif name not in mode.set:
            others = [other.name for other in component.modes if name in other.set]
            where = f"but mode {others[0]} sets it" if others else "although it is the unknown of the surface"
            message = f"{what}, mode {mode.name} does not set '{name}', {where}"
            scope.fail(mode, message, f"write set = {{ {name} = ... }} in every mode")


def _guard(scope: Scope, component: Component, guard: Guard, what: str, names: list[str]) -> None:
    if component.surface is not None:
        if guard.then:
            scope.fail(guard, f"{what} has choices, but the surface selects the next mode", "remove 'then'")
    elif bool(guard.then) == (guard.fatal is not None):
        found = "both choices and a fatal message" if guard.then else "no choices"
        scope.fail(guard, f"{what} has {found}", 'write then = [{ to = "MODE" }] or fatal = "reason"')
    closed = False
    for choice in guard.then:
        if closed:
            message = f"{what}: the choice '{choice.to}' is never reached, because an earlier choice has no condition"
            scope.fail(choice, message, "put the choice without a condition last")
        closed = closed or choice.when is None
        if choice.to not in names:
            scope.unknown(choice, f"{what}: unknown mode", choice.to, names, "modes")
        check_reset(scope, choice, what, choice.reset)


def _limit(scope: Scope, component: Component, what: str, names: list[str]) -> None:
    limit = component.limit
    if limit is None:
        return
    if component.surface is not None:
        scope.fail(limit, f"{what} has a limit, but its surface selects the next mode", "remove 'limit'")
    if limit.when is not None:
        scope.fail(limit, f"{what}: the limit has a condition", "remove 'when'")
    if limit.to not in names:
        scope.unknown(limit, f"{what}, limit: unknown mode", limit.to, names, "modes")
    check_reset(scope, limit, f"{what}, limit", limit.reset)


def check_reset(scope: Scope, part: Declared, what: str, names: Iterable[str]) -> None:
    """Report resets of names that are neither states nor discrete states."""
    for name in names:
        if name not in scope.changed_by_reset:
            kind = scope.kinds.get(name)
            remedy = f"'{name}' is a {kind}" if kind else nearest(name, scope.changed_by_reset, kind="states")
            scope.fail(part, f"{what} resets '{name}', which is not a state", remedy)


def _surface(scope: Scope, component: Component, what: str, names: list[str]) -> None:
    surface = component.surface
    if surface is None:
        return
    sides = surface.modes
    for name in sides:
        if name not in names:
            scope.unknown(surface, f"{what}, surface: unknown mode", name, names, "modes")
    if set(sides) <= set(names) and not len(set(sides)) == len(names) == len(sides):
        roles = (
            "two modes ('above', 'hold')"
            if surface.is_unilateral
            else "three modes ('above', 'below', 'hold')"
        )
        message = f"{what}: a surface needs {roles}, but the modes are {', '.join(names)}"
        scope.fail(surface, message, f"declare exactly {len(sides)} modes")
    for mode in component.modes:
        ways = len(sides) - 1 if mode.name == surface.hold else 1
        if mode.name in sides and len(mode.guards) < ways:
            scope.fail(mode, f"{what}: mode {mode.name} {_lacking(mode, surface.hold)}", _GUARDS_OF_SURFACE)


_GUARDS_OF_SURFACE = (
    "use the switching function as guard of mode 'above' and its negative as guard of mode 'below'; in mode 'hold' use "
    "one guard for each side, which is positive while the mode lasts"
)


def _lacking(mode: Mode, hold: str) -> str:
    if mode.name == hold:
        return f"needs one guard for each side but has only {len(mode.guards)}, so the mode could never end"
    return "has no guard, so the surface could never be reached"


def _mode_key(scope: Scope, part: Declared, what: str, key: str) -> None:
    known = [f"{component.name}.{mode.name}" for component in scope.components for mode in component.modes]
    if key not in known:
        scope.unknown(part, f"{what}: unknown COMPONENT.MODE", key, known, "modes")
