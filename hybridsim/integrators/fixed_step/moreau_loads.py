"""This module rejects friction loads that depend on friction, which time stepping does not support."""

from __future__ import annotations

from hybridsim.errors import UsageError
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of


def refuse_loads_of_friction(model: Model, integrator: str) -> None:
    """Raise an error for a contact whose load or law uses the friction force of another contact.

    The sweeps treat each limit as given, except for normal forces. A limit that depends on another friction
    force would be evaluated at the slip force of that contact.
    """
    components = model.all_components()
    frictions = {c.surface.unknown: c.name for c in components if c.surface and not c.surface.is_unilateral}
    behind = {name: names_of(expr.tree) for name, expr in model.definitions}
    for component in components:
        for mode in component.modes:
            for name, expr in mode.set.items():
                if name not in frictions:
                    behind[name] = behind.get(name, frozenset()) | names_of(expr.tree)
    for component in components:
        surface = component.surface
        if surface is None or surface.is_unilateral:
            continue
        open_ = set().union(*(names_of(guard.expr.tree) for mode in component.modes for guard in mode.guards))
        open_ |= set().union(*(names_of(expr.tree) for mode in component.modes for expr in mode.set.values()))
        seen: set[str] = set()
        while open_:
            name = open_.pop()
            seen.add(name)
            open_ |= behind.get(name, set()) - seen
        used = sorted(seen & (frictions.keys() - {surface.unknown}))
        if used:
            raise UsageError(
                f"{integrator} does not support loads that depend on friction forces: the load of {component.name} "
                f"depends on {', '.join(used)}",
                remedy="use an integrator that locates events, such as exact, taylor or dop853",
            )
