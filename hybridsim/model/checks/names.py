"""This module checks that names are valid, not reserved, and unique."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Mapping
from typing import Any

from hybridsim.expr.grammar import RESERVED, is_name
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.declared import Declared

_LABEL = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_+-]*")


def check_names(scope: Scope) -> None:
    """Report invalid names, and names with two meanings."""
    model = scope.model
    _label(scope, model, "model", model.name)
    if not model.states and not model.discrete:
        scope.fail(
            model, f"model {model.name} has no states", "declare at least one in [states] or [discrete]"
        )
    seen: dict[str, str] = {}
    for kind, name, part in scope.declarations():
        check_identifier(scope, part, kind, name)
        if name in seen:
            message = f"the name '{name}' is used twice, for a {seen[name]} and for a {kind}"
            scope.fail(part, message, "rename one of them")
        seen.setdefault(name, kind)
    check_labels(scope, "component", [*model.contacts, *model.surfaces, *model.impacts, *model.components])
    check_labels(scope, "event", [*model.monitors, *model.schedules])
    _made_labels(scope)
    _events(scope, seen)
    check_labels(scope, "output", model.outputs)
    for output in model.outputs:
        check_identifier(scope, output, "output", output.name)
        if output.name in scope.all_names and output.expr.text != output.name:
            message = (
                f"the output '{output.name}' has the name of another quantity, but equals {output.expr.text}"
            )
            scope.fail(output, message, "rename the output")


def _made_labels(scope: Scope) -> None:
    """Report conflicts with names of automata that contacts create for lift-off, copies and tables."""
    model = scope.model
    kinds: dict[str, tuple[Any, ...]] = {
        "contact": model.contacts, "surface": model.surfaces, "impact": model.impacts, "component": model.components,
        "monitor": model.monitors, "schedule": model.schedules, "input": model.inputs,
    }  # fmt: skip
    seen = {part.name: f"{kind} '{part.name}'" for kind, parts in kinds.items() for part in parts}
    for contact, parts in zip(model.contacts, scope.made, strict=True):
        for name in (part.name for part in parts if part.name != contact.name):
            if name in seen:
                message = f"contact '{contact.name}' creates an automaton '{name}', but {seen[name]} has this name too"
                scope.fail(contact, message, "rename one of them")
            seen.setdefault(name, f"an automaton of contact '{contact.name}'")


def _events(scope: Scope, seen: Mapping[str, str]) -> None:
    """Report monitors and schedules with the name of another part, because events are found by name."""
    model = scope.model
    taken = {name: kind for name, kind in seen.items() if kind not in ("parameter", "definition")}
    parts: tuple[Any, ...] = (*model.contacts, *model.surfaces, *model.impacts, *model.components)
    taken |= {part.name: "component" for part in parts if part.name not in taken}
    for kind, events in (("monitor", model.monitors), ("schedule", model.schedules)):
        for event in events:
            if event.name in taken:
                message = f"the {kind} '{event.name}' has the name of a {taken[event.name]}"
                scope.fail(event, message, f"rename the {kind}")


def check_identifier(scope: Scope, part: Declared, kind: str, name: object) -> bool:
    """Return whether a name can be used in expressions, and report an invalid name."""
    segments = name.split(".") if isinstance(name, str) else []
    good = isinstance(name, str) and name.isascii() and is_name(name)
    if not good or any(word.startswith("__") for word in segments):
        scope.fail(
            part,
            f"{kind} '{name}': not a valid name",
            "use ASCII letters, digits and _, without a digit at the start",
        )
        return False
    if any(word in RESERVED or keyword.iskeyword(word) for word in segments):
        scope.fail(
            part,
            f"{kind} '{name}': the name is reserved",
            "functions, pi, t (time) and keywords of Python are reserved",
        )
        return False
    return True


def _label(scope: Scope, part: Declared, kind: str, name: object) -> None:
    # names of components and events inside a part contain dots
    segments = (
        name.split(".")
        if isinstance(name, str) and kind in ("component", "event", "output", "shape")
        else [name]
    )
    if not all(isinstance(word, str) and _LABEL.fullmatch(word) for word in segments):
        scope.fail(part, f"{kind} {name!r}: not a valid name", "use ASCII letters, digits, _, - and +")


def check_labels(scope: Scope, kind: str, parts: Iterable[Declared]) -> None:
    """Report invalid or duplicate labels of components, modes, guards or events."""
    seen = set()
    for part in parts:
        name = getattr(part, "name", "")
        _label(scope, part, kind, name)
        if name in seen:
            scope.fail(part, f"{kind} '{name}' is declared twice", "rename one of them")
        seen.add(name)
