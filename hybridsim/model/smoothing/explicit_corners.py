"""This module replaces the corners and jumps of a model by components.

Corners are `abs`, `min`, `max` and conditionals whose branches agree at the change. If the mode of a component implies
the active side (v >= 0 in slip+), this side replaces the corner. Any other corner becomes a component with two modes
that switches at the zero of its argument, where both modes have the same value. A jump (`sign`, a conditional whose
branches differ) becomes a switching surface (`hybridsim.model.smoothing.jumps`), or a signal if it depends on time
alone (`hybridsim.model.smoothing.steps_in_time`). If neither is possible, the jump is not replaced.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from hybridsim.expr import Expression, of_tree
from hybridsim.model.meanings import Family
from hybridsim.model.parts.component import Component, Corner, Guard, Mode, Surface
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.jumps import not_linear
from hybridsim.model.smoothing.nonsmooth import MODE, Primitive, sides_of, uses_primitives
from hybridsim.model.smoothing.rewriting import Rewriting
from hybridsim.model.smoothing.rewriting_state import IN_EVENTS, IN_VELOCITY, Found, Here
from hybridsim.model.smoothing.whole_numbers import with_whole_numbers

# Largest number of corners and jumps to replace. Each event checks all components, and compiled loops store a table of
# the combinations of modes.
MOST = 8
IN_MODE = "it is in a mode of a component"


@dataclass(frozen=True)
class Smoothed:
    """A model with its corners and jumps replaced, and the treatment of each non-smooth function."""

    model: Model
    primitives: tuple[Primitive, ...]


def smoothed(model: Model) -> Model:
    """Return the model with its corners and jumps as components, or the model itself if it has none."""
    if model.flow is not None:
        return model
    found: Model | None = model.once("smoothed", lambda: _smoothed(model))
    return model if found is None else found.with_values_of(model)


def _smoothed(model: Model) -> Model | None:
    """Return the smoothed model, which copies with other values share, or None if nothing changes."""
    result = with_whole_numbers(model)
    result = smoothing_of(result).model if uses_primitives(result) else result
    return None if result is model else result


def smoothing_of(model: Model) -> Smoothed:
    """Return the smoothed model, and how each non-smooth function and fractional power is treated.

    Raises
    ------
    ModelError
        For a jump in a velocity, gap or switching function that does not depend on time alone.
    """
    if model.flow is not None:
        return Smoothed(model, ())
    model = with_whole_numbers(model)
    refused: dict[Family, str] = {}
    shared: frozenset[Family] = frozenset()
    timed: frozenset[Family] = frozenset()
    while True:
        work = Rewriting(model, "", refused, shared, timed)
        result, crooked = _Smoothing(model, work).run()
        if work.faults:
            raise work.faults[0]
        both = (work.corners.keys() & work.jumps.keys()) - shared
        in_time = (work.steps.keys() & {*work.jumps, *work.corners}) - timed
        if len(work.corners) + len(work.jumps) > MOST:  # signals do not count
            in_time |= work.timed_by_form() - timed
        if not (crooked or both or in_time):
            break
        refused |= dict.fromkeys(crooked, "it enters the rates nonlinearly")
        shared, timed = (shared | both) - refused.keys(), timed | in_time
    count = len(work.corners) + len(work.jumps)
    if count > MOST:
        work = Rewriting(
            model, f"the model has {count} corners and jumps, more than {MOST}", {}, frozenset(), timed
        )
        result, _ = _Smoothing(model, work).run()
    return Smoothed(result, work.primitives())


class _Smoothing:
    """Replaces the corners and jumps of one model."""

    def __init__(self, model: Model, work: Rewriting) -> None:
        self.model, self.work = model, work
        self.meanings, self.components, self.signs = self.work.meanings, self.work.components, self.work.signs

    # -- the model ------------------------------------------------------------------------------------------

    def run(self) -> tuple[Model, list[Family]]:
        """Rewrite all rates, guards and monitors; return the model itself if nothing changed.

        The second result contains the families of jumps that enter the rates nonlinearly.
        """
        model = self.model
        surfaces = [c.surface.function.tree for c in self.components if c.surface]
        velocities = self.meanings.reached(surfaces)
        states = tuple(
            replace(
                state,
                der=self._rewritten(state.der, Here(f"state {state.name}", state.place, jumps="", times="")),
            )
            for state in model.states
        )
        components = [self._component(c) for c in range(len(self.components))]
        monitors = tuple(
            replace(
                monitor,
                expr=self._rewritten(monitor.expr, Here(f"monitor {monitor.name}", monitor.place, jumps="")),
            )
            for monitor in model.monitors
        )
        in_use = self.meanings.reached((*self._integrated(), *self._event_trees()))
        of_modes = self.meanings.reached(self._of_modes())
        outside = self.meanings.reached(self._event_trees()) | of_modes
        definitions = []
        for name, expr in model.definitions:
            where = f"definition {name}"
            here = Here(where, expr.place, jumps="", times=IN_EVENTS if name in outside else "")
            if name in velocities:
                here = replace(here, untouched=IN_VELOCITY)
            elif name in of_modes:
                here = replace(here, jumps=IN_MODE, is_passing=True)
            definitions.append((name, self._rewritten(expr, here) if name in in_use else expr))
        if not self.work.count and not self.work.corners:
            return model, []
        made = [self._with_implied(c, component) for c, component in enumerate(components)]
        jumps = [jump.component() for jump in self.work.jumps.values()]
        result = replace(
            model,
            states=states,
            definitions=tuple(definitions),
            components=(*made, *jumps, *map(self._corner_component, self.work.corners.values())),
            contacts=(),
            surfaces=(),
            impacts=(),
            monitors=monitors,
            inputs=(*model.inputs, *(step for step, _ in self.work.steps.values())),
        )
        return result, self._crooked(result)

    def _integrated(self) -> Iterator[ast.expr]:
        """Yield the trees of rates and of variables that modes set."""
        yield from (state.der.tree for state in self.model.states)
        yield from self._of_modes()

    def _of_modes(self) -> Iterator[ast.expr]:
        for component in self.components:
            for mode in component.modes:
                yield from (expr.tree for expr in (*mode.der.values(), *mode.set.values()))

    def _event_trees(self) -> Iterator[ast.expr]:
        yield from (monitor.expr.tree for monitor in self.model.monitors)
        for component in self.components:
            yield from (guard.expr.tree for mode in component.modes for guard in mode.guards)

    def _crooked(self, result: Model) -> list[Family]:
        """Return the keys of jumps that enter the rates nonlinearly."""
        jumps = {family: jump for family, jump in self.work.jumps.items() if not jump.is_timed}
        carried = {name: {name} for name in self.meanings.forced}
        for jump in jumps.values():
            carried |= {name: {jump.unknown} for name in (jump.unknown, *jump.blended)}
        trees = [(name, expr.tree) for name, expr in result.definitions]
        trees += [("", state.der.tree) for state in result.states]
        for component in result.components:
            for mode in component.modes:
                trees += [("", expr.tree) for expr in mode.der.values()]
                trees += [(name, expr.tree) for name, expr in mode.set.items()]
        found = not_linear(trees, carried) if jumps else set()
        return [family for family, jump in jumps.items() if jump.unknown in found]

    def _component(self, c: int) -> Component:
        component = self.components[c]
        modes = []
        for mode, signs in zip(component.modes, self.signs[c], strict=True):
            where, place = f"mode {mode.name} of {component.name}", mode.place or component.place
            here = Here(where, place, signs, jumps=IN_MODE, is_passing=True)
            guards = tuple(self._guards(component, mode, signs))
            der = {name: self._rewritten(expr, here) for name, expr in mode.der.items()}
            values = {name: self._rewritten(expr, here) for name, expr in mode.set.items()}
            modes.append(replace(mode, guards=guards, der=FrozenMap(der), set=FrozenMap(values)))
        return replace(component, modes=tuple(modes), surface=self._surface(component))

    def _surface(self, component: Component) -> Surface | None:
        """Return the surface of a component, with jumps in time replaced by signals."""
        surface = component.surface
        if surface is None:
            return None
        here = Here("", component.place, untouched=IN_VELOCITY)  # the modes report primitives that are kept
        return replace(
            surface,
            function=self._rewritten(surface.function, here),
            jump_above=self._rewritten(surface.jump_above, here),
            jump_below=self._rewritten(surface.jump_below, here),
            restitution=surface.restitution and self._rewritten(surface.restitution, here),
        )

    def _guards(self, component: Component, mode: Mode, signs: Mapping[Family, int]) -> Iterator[Guard]:
        surface = component.surface
        for guard in mode.guards:
            family = self.meanings.family(guard.expr.tree)[0]
            is_side = surface and family == self.meanings.family(surface.function.tree)[0]
            here = Here(
                f"guard {guard.name} of mode {mode.name} of {component.name}",
                guard.place or component.place,
                {other: sign for other, sign in signs.items() if other != family},
                IN_VELOCITY if is_side else "",
                jumps="",
            )
            if (
                not is_side
                and self.work.never_negative(guard.expr.tree)
                and self._has_corner(guard.expr.tree)
            ):
                self.work.note(
                    guard.expr.tree, MODE, "the guard never fires, because its value is never negative", here
                )
                self.work.count += 1
                continue
            yield replace(guard, expr=self._rewritten(guard.expr, here))

    def _has_corner(self, node: ast.expr) -> bool:
        tree = self.meanings.written_out(node)
        corners = (ast.Call, ast.IfExp)
        return any(sides_of(part) is not None for part in ast.walk(tree) if isinstance(part, corners))

    def _with_implied(self, c: int, component: Component) -> Component:
        if c not in self.work.implied:
            return component
        modes = []
        for m, mode in enumerate(component.modes):
            values = {name: of_tree(rows[m]) for name, rows in self.work.implied[c].items()}
            modes.append(replace(mode, set=FrozenMap({**mode.set, **values})))
        return replace(component, modes=tuple(modes))

    def _corner_component(self, found: Found) -> Corner:
        modes = []
        for m, (name, other) in enumerate((("+", "-"), ("-", "+"))):
            side = found.argument if m == 0 else ast.UnaryOp(ast.USub(), found.argument)
            values = {variable: of_tree(pair[m]) for variable, pair in found.values.items()}
            guard = Guard("side", of_tree(side), then=(other,))  # type: ignore[arg-type]  # becomes a Choice
            modes.append(Mode(name, (guard,), set=values))
        return Corner(found.name, tuple(modes), initial="+")

    def _rewritten(self, expr: Expression, here: Here) -> Expression:
        tree = self.work.walk(self.work.single_signs(expr.tree), here)
        return expr if tree is expr.tree else of_tree(tree, expr.place)
