"""A model with the corners of its flows, guards and laws as components, so that every mode is smooth.

`abs`, `min`, `max` and conditionals whose branches agree where they change are corners. Where the mode of a component
implies the side that holds (v >= 0 in slip+), that side is put in. Any other corner gets a component of two modes which
changes its mode where the argument passes through zero; both modes have one value there. A jump (`sign`, a conditional
whose branches differ) is left as it stands, unless modes imply its side.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hybridsim.errors import Place
from hybridsim.expr import Expression, parse
from hybridsim.expr.write import write
from hybridsim.model.component import Component, Corner, Guard, Mode
from hybridsim.model.frozen_map import FrozenMap
from hybridsim.model.meanings import Family
from hybridsim.model.nonsmooth import MODE, Primitive, sides_of, uses_primitives
from hybridsim.model.one_sided import names_of
from hybridsim.model.rewriting import Found, Here, Rewriting

if TYPE_CHECKING:
    from hybridsim.model.model import Model

# Each event judges all components again, and compiled loops keep tables of the combinations of modes that they meet.
MOST = 8


@dataclass(frozen=True)
class Smoothed:
    """The model that is run, and what became of the primitives of the one that was written."""

    model: Model
    primitives: tuple[Primitive, ...]


def smoothed(model: Model) -> Model:
    """The model with its corners as components; the model itself where there is none."""
    if model.flow is not None:
        return model
    found: Model | None = model.once("smoothed", lambda: _smoothed(model))
    return model if found is None else found.with_values_of(model)


def _smoothed(model: Model) -> Model | None:
    """None where there is no corner; the same model but for its values, whatever these are."""
    result = smoothing_of(model).model if uses_primitives(model) else model
    return None if result is model else result


def smoothing_of(model: Model) -> Smoothed:
    """The same with an account of every primitive that is not smooth, fractional powers included."""
    if model.flow is not None:
        return Smoothed(model, ())
    smoothing = _Smoothing(model)
    result, count = smoothing.run(), len(smoothing.work.corners)
    if count > MOST:
        smoothing = _Smoothing(model, f"the model has {count} corners, more than {MOST}")
        result = smoothing.run()
    return Smoothed(result, smoothing.work.primitives())


class _Smoothing:
    """One pass over one model.

    Parameters
    ----------
    refusal : why no corner is to become a component, if so.
    """

    def __init__(self, model: Model, refusal: str = "") -> None:
        self.model = model
        self.work = Rewriting(model, refusal)
        self.meanings, self.components, self.signs = self.work.meanings, self.work.components, self.work.signs

    # -- the model ------------------------------------------------------------------------------------------

    def run(self) -> Model:
        """Rewrite all that is integrated or watched; the model itself where nothing came of it."""
        model = self.model
        surfaces = [c.surface.function.tree for c in self.components if c.surface]
        velocities = self.meanings.reached(surfaces)
        states = tuple(
            replace(state, der=self._rewritten(state.der, Here(f"state {state.name}", state.place)))
            for state in model.states
        )
        components = [self._component(c) for c in range(len(self.components))]
        monitors = tuple(
            replace(monitor, expr=self._watched(monitor.expr, Here(f"monitor {monitor.name}", monitor.place)))
            for monitor in model.monitors
        )
        wanted = self.meanings.reached(self._integrated())
        definitions = []
        for name, expr in model.definitions:
            reason = "it is part of a relative velocity" if name in velocities else ""
            here = Here(f"definition {name}", expr.place, untouched=reason)
            definitions.append((name, self._rewritten(expr, here) if name in wanted else expr))
        if not self.work.count and not self.work.corners:
            return model
        made = [self._with_implied(c, component) for c, component in enumerate(components)]
        return replace(
            model,
            states=states,
            definitions=tuple(definitions),
            components=(*made, *map(self._corner_component, self.work.corners.values())),
            contacts=(),
            surfaces=(),
            impacts=(),
            monitors=monitors,
        )

    def _integrated(self) -> Iterator[ast.expr]:
        yield from (state.der.tree for state in self.model.states)
        yield from (monitor.expr.tree for monitor in self.model.monitors)
        for component in self.components:
            for mode in component.modes:
                exprs = (*mode.der.values(), *mode.set.values(), *(guard.expr for guard in mode.guards))
                yield from (expr.tree for expr in exprs)

    def _component(self, c: int) -> Component:
        component = self.components[c]
        modes = []
        for mode, signs in zip(component.modes, self.signs[c], strict=True):
            where, place = f"mode {mode.name} of {component.name}", mode.place or component.place
            here = Here(where, place, signs)
            guards = tuple(self._guards(component, mode, signs))
            der = {name: self._rewritten(expr, here) for name, expr in mode.der.items()}
            values = {name: self._rewritten(expr, here) for name, expr in mode.set.items()}
            modes.append(replace(mode, guards=guards, der=FrozenMap(der), set=FrozenMap(values)))
        return replace(component, modes=tuple(modes))

    def _guards(self, component: Component, mode: Mode, signs: Mapping[Family, int]) -> Iterator[Guard]:
        surface = component.surface
        for guard in mode.guards:
            family = self.meanings.family(guard.expr.tree)[0]
            is_side = surface and family == self.meanings.family(surface.function.tree)[0]
            here = Here(
                f"guard {guard.name} of mode {mode.name} of {component.name}",
                guard.place or component.place,
                {other: sign for other, sign in signs.items() if other != family},
                "it is part of a relative velocity" if is_side else "",
            )
            if (
                not is_side
                and self.work.never_negative(guard.expr.tree)
                and self._has_corner(guard.expr.tree)
            ):
                self.work.note(
                    guard.expr.tree, MODE, "it is never negative, so that the guard never fires", here
                )
                self.work.count += 1
                continue
            yield replace(guard, expr=self._rewritten(guard.expr, here))

    def _watched(self, expr: Expression, here: Here) -> Expression:
        if self._has_corner(expr.tree):
            minus = isinstance(expr.tree, ast.UnaryOp) and isinstance(expr.tree.op, ast.USub)
            # mypy does not see that minus means a UnaryOp
            if self.work.never_negative(expr.tree.operand if minus else expr.tree):  # type: ignore[attr-defined]  # a minus has one
                self.work.note(
                    expr.tree, MODE, "it never changes its sign, so that the monitor never fires", here
                )
                self.work.count += 1
                return parse(-1 if minus else 1, expr.place)
        return self._rewritten(expr, here)

    def _has_corner(self, node: ast.expr) -> bool:
        tree = self.meanings.written_out(node)
        corners = (ast.Call, ast.IfExp)
        return any(sides_of(part) is not None for part in ast.walk(tree) if isinstance(part, corners))

    def _with_implied(self, c: int, component: Component) -> Component:
        if c not in self.work.implied:
            return component
        modes = []
        for m, mode in enumerate(component.modes):
            values = {name: self._expression(rows[m]) for name, rows in self.work.implied[c].items()}
            modes.append(replace(mode, set=FrozenMap({**mode.set, **values})))
        return replace(component, modes=tuple(modes))

    def _corner_component(self, found: Found) -> Corner:
        modes = []
        for m, (name, other) in enumerate((("+", "-"), ("-", "+"))):
            side = found.argument if m == 0 else ast.UnaryOp(ast.USub(), found.argument)
            values = {variable: self._expression(pair[m]) for variable, pair in found.values.items()}
            # a name stands for a Choice, as in any declaration
            guard = Guard("side", self._expression(side), then=(other,))  # type: ignore[arg-type]  # made a choice
            modes.append(Mode(name, (guard,), set=values))
        return Corner(found.name, tuple(modes), initial="+")

    def _rewritten(self, expr: Expression, here: Here) -> Expression:
        tree = self.work.walk(expr.tree, here)
        return expr if tree is expr.tree else self._expression(tree, expr.place)

    def _expression(self, tree: ast.expr, place: Place | None = None) -> Expression:
        return Expression(write(tree), frozenset(names_of(tree)), place, tree)
