"""This module refuses guards, resets and contacts that read a quantizer, whose value may be outdated at an event.

A quantizer takes its steps in the rounds of an event. A rate or an output never meets an old value, because no time
passes meanwhile; a guard or a reset of the same instant may.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from hybridsim.expr import Expression
from hybridsim.model.elements.element import Element


def refuse_readers(model: Any, parts: Mapping[str, Any], quantizers: Mapping[str, Element]) -> None:
    """Raise an error for the first expression that reads a quantizer and decides the result of an event.

    parts : the definitions, components and schedules of the model together with those of its elements.
    """
    if not quantizers:
        return
    behind = {name: set(expr.names) for name, expr in parts["definitions"]}
    for component in parts["components"]:
        for mode in component.modes:
            for name, expr in mode.set.items():
                if name not in quantizers:
                    behind.setdefault(name, set()).update(expr.names)
    for what, expr in _deciding(model, parts):
        waiting, seen = set(expr.names), set(expr.names)
        while waiting:
            waiting = set().union(*(behind.get(name, set()) for name in waiting)) - seen
            seen |= waiting
        for name in sorted(seen & quantizers.keys()):
            raise expr.error(
                f"{what} reads the quantizer '{name}', which may still have an old value at an event",
                remedy=f"compare the input '{quantizers[name].input.text}' of the quantizer with the borders "
                "instead; if this input is sampled, quantize the output of a 'delay' element "
                "with `ticks = 1`",
            )


def _deciding(model: Any, parts: Mapping[str, Any]) -> Iterator[tuple[str, Expression]]:
    """Yield the expressions that are read at events, each with a text that names its place."""
    for component in parts["components"]:
        what = f"component {component.name}"
        choices = [component.limit] if component.limit else []
        for mode in component.modes:
            for guard in mode.guards:
                yield f"{what}, guard {guard.name}", guard.expr
                choices += guard.then
        for choice in choices:
            if choice.when is not None:
                yield f"{what}, when", choice.when
            yield from ((f"{what}, reset of {name}", expr) for name, expr in choice.reset.items())
    for monitor in model.monitors:
        yield f"monitor {monitor.name}", monitor.expr
        yield from (
            (f"monitor {monitor.name}, reset of {name}", expr) for name, expr in monitor.reset.items()
        )
    for schedule in parts["schedules"]:
        yield from (
            (f"schedule {schedule.name}, reset of {name}", expr) for name, expr in schedule.reset.items()
        )
    for surface in model.surfaces:
        yield f"surface {surface.name}", surface.expr
    for impact in model.impacts:
        yield f"impact {impact.name}, gap", impact.gap
        yield f"impact {impact.name}, restitution", impact.restitution
    for contact in model.contacts:
        yield f"contact {contact.name}, velocity", contact.velocity
        yield f"contact {contact.name}, normal", contact.normal
        yield from ((f"contact {contact.name}, {name}", expr) for name, expr in contact.arguments.items())
