"""A model with the corners of its flows, guards and laws as components, so that every mode is smooth.

`abs`, `min`, `max` and conditionals whose branches agree where they change are corners. Where the mode of a component
implies the side that holds (v >= 0 in slip+), that side is put in. Any other corner gets a component of two modes which
changes its mode where the argument passes through zero; both modes have one value there. A jump (`sign`, a conditional
whose branches differ) is left as it stands, unless modes imply its side.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from hybridsim.errors import Place
from hybridsim.expr import Expression, parse
from hybridsim.expr.rebuild import rebuilt
from hybridsim.expr.write import write
from hybridsim.model.component import Component, Corner, Guard, Mode
from hybridsim.model.continuity import is_continuous
from hybridsim.model.frozen_map import FrozenMap
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.nonsmooth import (
    COMPONENT,
    KEPT,
    MODE,
    POWER,
    Primitive,
    is_clear_of_zero,
    is_whole,
    limited,
    uses_primitives,
)
from hybridsim.model.one_sided import names_of, never_negative, number_of

if TYPE_CHECKING:
    from hybridsim.model.model import Model

# Each event judges all components again, and compiled loops keep tables of the combinations of modes that they meet.
MOST = 8
VARIABLE = "__corner_"  # names of a model do not begin with two underscores

_ZERO = ast.Constant(0)
_HOLDS = {ast.Gt: (True, False, False), ast.GtE: (True, True, False), ast.Lt: (False, False, True), ast.LtE: (False, True, True)}  # fmt: skip


@dataclass(frozen=True)
class Smoothed:
    """The model that is run, and what became of the primitives of the one that was written."""

    model: Model
    primitives: tuple[Primitive, ...]


def smoothed(model: Model) -> Model:
    """The model with its corners as components; the model itself where there is none."""
    if model.flow is not None or not uses_primitives(model):
        return model
    return smoothing_of(model).model


def smoothing_of(model: Model) -> Smoothed:
    """The same with an account of every primitive that is not smooth, fractional powers included."""
    if model.flow is not None:
        return Smoothed(model, ())
    work = _Smoothing(model)
    result = work.run()
    if len(work.corners) > MOST:
        work = _Smoothing(model, f"the model has {len(work.corners)} corners, more than {MOST}")
        result = work.run()
    return Smoothed(result, work.primitives())


@dataclass(frozen=True)
class _Here:
    """Where a tree stands: in words, the signs that its mode implies, why nothing is to be replaced (or empty)."""

    where: str
    place: Place | None
    signs: Mapping[Family, int] = field(default_factory=dict)
    untouched: str = ""


@dataclass
class _Found:
    """A corner on its way: its component's name, its argument, its variables with their values above and below."""

    name: str
    argument: ast.expr
    sign: int
    values: dict[str, tuple[ast.expr, ast.expr]] = field(default_factory=dict)


class _Smoothing:
    """One pass over one model.

    Parameters
    ----------
    refusal : why no corner is to become a component, if so.
    """

    def __init__(self, model: Model, refusal: str = "") -> None:
        self.model, self.refusal = model, refusal
        self.meanings = Meanings(model)
        self.components = model.all_components()
        self.signs = [[self.meanings.signs(c, mode) for mode in c.modes] for c in self.components]
        self.corners: dict[Family, _Found] = {}
        self.implied: dict[int, dict[str, tuple[ast.expr, ...]]] = {}  # component -> variable -> its values
        self._accounts: dict[tuple[str, str, str], tuple[list[str], Place | None]] = {}
        self._count = 0

    def primitives(self) -> tuple[Primitive, ...]:
        """What became of each primitive, in the order in which they were met."""
        found = self._accounts.items()
        return tuple(Primitive(*key[:1], tuple(where), *key[1:], place) for key, (where, place) in found)

    # -- the model ------------------------------------------------------------------------------------------

    def run(self) -> Model:
        """Rewrite all that is integrated or watched; the model itself where nothing came of it."""
        model = self.model
        surfaces = [c.surface.function.tree for c in self.components if c.surface]
        velocities = self.meanings.reached(surfaces)
        states = tuple(
            replace(state, der=self._rewritten(state.der, _Here(f"state {state.name}", state.place)))
            for state in model.states
        )
        components = [self._component(c) for c in range(len(self.components))]
        monitors = tuple(
            replace(monitor, expr=self._watched(monitor.expr, _Here(f"monitor {monitor.name}", monitor.place)))
            for monitor in model.monitors
        )
        wanted = self.meanings.reached(self._integrated())
        definitions = []
        for name, expr in model.definitions:
            reason = "it is part of a relative velocity" if name in velocities else ""
            here = _Here(f"definition {name}", expr.place, untouched=reason)
            definitions.append((name, self._rewritten(expr, here) if name in wanted else expr))
        if not self._count and not self.corners:
            return model
        made = [self._with_implied(c, component) for c, component in enumerate(components)]
        return replace(
            model,
            states=states,
            definitions=tuple(definitions),
            components=(*made, *map(self._corner_component, self.corners.values())),
            contacts=(),
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
            here = _Here(where, place, signs)
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
            here = _Here(
                f"guard {guard.name} of mode {mode.name} of {component.name}",
                guard.place or component.place,
                {other: sign for other, sign in signs.items() if other != family},
                "it is part of a relative velocity" if is_side else "",
            )
            if not is_side and self._never_negative(guard.expr.tree) and self._has_corner(guard.expr.tree):
                self._note(guard.expr.tree, MODE, "it is never negative, so that the guard never fires", here)
                self._count += 1
                continue
            yield replace(guard, expr=self._rewritten(guard.expr, here))

    def _watched(self, expr: Expression, here: _Here) -> Expression:
        if self._has_corner(expr.tree):
            minus = isinstance(expr.tree, ast.UnaryOp) and isinstance(expr.tree.op, ast.USub)
            if self._never_negative(expr.tree.operand if minus else expr.tree):  # type: ignore[attr-defined]
                self._note(expr.tree, MODE, "it never changes its sign, so that the monitor never fires", here)
                self._count += 1
                return parse(-1 if minus else 1, expr.place)
        return self._rewritten(expr, here)

    def _never_negative(self, node: ast.expr) -> bool:
        return never_negative(node, {}, self.meanings.lookup) is not None

    def _has_corner(self, node: ast.expr) -> bool:
        tree = self.meanings.written_out(node)
        corners = (ast.Call, ast.IfExp)
        return any(_parts(part) is not None for part in ast.walk(tree) if isinstance(part, corners))

    def _with_implied(self, c: int, component: Component) -> Component:
        if c not in self.implied:
            return component
        modes = []
        for m, mode in enumerate(component.modes):
            values = {name: self._expression(rows[m]) for name, rows in self.implied[c].items()}
            modes.append(replace(mode, set=FrozenMap({**mode.set, **values})))
        return replace(component, modes=tuple(modes))

    def _corner_component(self, found: _Found) -> Corner:
        modes = []
        for m, (name, other) in enumerate((("+", "-"), ("-", "+"))):
            side = found.argument if m == 0 else ast.UnaryOp(ast.USub(), found.argument)
            values = {variable: self._expression(pair[m]) for variable, pair in found.values.items()}
            guard = Guard("side", self._expression(side), then=(other,))  # type: ignore[arg-type]
            modes.append(Mode(name, (guard,), set=values))
        return Corner(found.name, tuple(modes), initial="+")

    def _rewritten(self, expr: Expression, here: _Here) -> Expression:
        tree = self._walk(expr.tree, here)
        return expr if tree is expr.tree else self._expression(tree, expr.place)

    def _expression(self, tree: ast.expr, place: Place | None = None) -> Expression:
        return Expression(write(tree), frozenset(names_of(tree)), place, tree)

    # -- trees ----------------------------------------------------------------------------------------------

    def _walk(self, node: ast.expr, here: _Here) -> ast.expr:
        """The tree with what is not smooth replaced; the very same tree where nothing is."""
        if not self.meanings.moves(node):
            return node
        match node:
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[first, second, third, *others]):
                inner = ast.Call(node.func, [first, second], [])
                return self._walk(ast.Call(ast.Name(name, ast.Load()), [inner, third, *others], []), here)
            case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
                here = self._note_power(node, argument, here)
            case ast.Call(func=ast.Name(id="log" | "asin" | "acos" as name)):
                here = replace(here, untouched=here.untouched or f"it stands in {name}, which ends where it does")
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent) if not is_whole(exponent, self.meanings):
                here = self._note_power(node, base, here, exponent)
            case ast.BoolOp() | ast.Compare():
                return node
        parts = _parts(node)
        if parts is not None:
            return self._side(node, parts, here)
        if isinstance(node, ast.IfExp) and self.meanings.moves(node.test):
            return self._kept(node, "its condition is no single comparison by < or >", here)
        changed: list[bool] = []

        def change(part: ast.expr) -> ast.expr:
            new = self._walk(part, here)
            changed.append(new is not part)
            return new

        new = rebuilt(node, change)
        return new if any(changed) else node

    def _note_power(
        self, node: ast.expr, base: ast.expr, here: _Here, exponent: ast.expr | None = None
    ) -> _Here:
        numbers = self.model.parameter_values()
        power = None if exponent is None else number_of(exponent, numbers, self.meanings.lookup)
        if not self.meanings.moves(base) or (power is not None and power == round(power)):
            return here
        if not is_clear_of_zero(base, numbers, self.meanings):
            self._note(node, POWER, f"it has no series where {write(base)} = 0", here)
        return replace(here, untouched=here.untouched or "it stands in a root or a fractional power")

    def _side(self, node: ast.expr, parts: _Parts, here: _Here) -> ast.expr:
        """What a primitive becomes: one of its sides, or a variable that is set to the one that holds."""
        argument, above, below, at_zero = parts
        branches = (above, below) if isinstance(node, ast.IfExp) else ()
        forced = names_of(node) & self.meanings.forced
        family, sign = self.meanings.family(argument)
        if not family:
            return self._walk((below, at_zero, above)[sign + 1], here)
        if here.untouched:
            return self._kept(node, here.untouched, here)
        if any(limited(self.meanings.written_out(branch), self.meanings) for branch in branches):
            return self._kept(node, "one of its sides has no value beyond its border", here)
        if family in here.signs:
            return self._implied(node, (below, at_zero, above)[here.signs[family] * sign + 1], here)
        if self._never_negative(argument):
            return self._implied(node, above, here)
        owner = self._owner(family)
        if owner is not None:
            self._note(node, MODE, f"its side follows from the modes of {self.components[owner].name}", here)
            sides = [self._walk(part, here) for part in (below, at_zero, above)]
            values = tuple(sides[signs[family] * sign + 1] for signs in self.signs[owner])
            return self._variable(self.implied.setdefault(owner, {}), values)
        if forced:
            return self._kept(node, f"it depends on {', '.join(sorted(forced))}, which a mode solves for", here)
        if not self._agrees(node, parts):
            return self._kept(node, "it jumps, as far as its form shows", here)
        if self.refusal:
            return self._kept(node, self.refusal, here)
        found = self.corners.get(family)
        if found is None:
            found = self.corners[family] = _Found(self._title(node), self._walk(argument, here), sign)
        self._note(node, COMPONENT, found.name, here)
        pair = (self._walk(above, here), self._walk(below, here))
        return self._variable(found.values, pair if sign == found.sign else pair[::-1])  # type: ignore[arg-type]

    def _agrees(self, node: ast.expr, parts: _Parts) -> bool:
        argument, above, below, _ = parts
        if isinstance(node, ast.IfExp):
            return is_continuous(self.meanings, argument, above, below)
        return not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sign")

    def _owner(self, family: Family) -> int | None:
        """A component whose every mode implies the side of an expression."""
        for c, modes in enumerate(self.signs):
            if modes and all(family in signs for signs in modes):
                return c
        return None

    def _variable(self, values: dict[str, tuple[ast.expr, ...]], row: tuple[ast.expr, ...]) -> ast.expr:
        texts = [write(tree) for tree in row]
        for name, other in values.items():
            if [write(tree) for tree in other] == texts:
                return ast.Name(name, ast.Load())
        self._count += 1
        name = f"{VARIABLE}{self._count}"
        values[name] = row
        return ast.Name(name, ast.Load())

    def _implied(self, node: ast.expr, side: ast.expr, here: _Here) -> ast.expr:
        self._note(node, MODE, "its side is known here", here)
        self._count += 1
        return self._walk(side, here)

    def _kept(self, node: ast.expr, reason: str, here: _Here) -> ast.expr:
        self._note(node, KEPT, reason, here)
        return node

    def _title(self, node: ast.expr) -> str:
        taken = {component.name for component in self.components} | {c.name for c in self.corners.values()}
        title = write(node)
        while title in taken:
            title += "'"
        return title

    def _note(self, node: ast.expr, became: str, remark: str, here: _Here) -> None:
        where, _ = self._accounts.setdefault((write(node), became, remark), ([], here.place))
        if here.where not in where:
            where.append(here.where)


_Parts = tuple[ast.expr, ast.expr, ast.expr, ast.expr]
"""Argument; the value where it is positive, negative, zero."""


def _parts(node: ast.expr) -> _Parts | None:
    """The sides of a primitive; None for any other node."""
    match node:
        case ast.Call(func=ast.Name(id="abs"), args=[u]):
            return u, u, ast.UnaryOp(ast.USub(), u), u
        case ast.Call(func=ast.Name(id="sign"), args=[u]):
            return u, ast.Constant(1), ast.UnaryOp(ast.USub(), ast.Constant(1)), _ZERO
        case ast.Call(func=ast.Name(id="max"), args=[a, b]):
            return _minus(a, b), a, b, a
        case ast.Call(func=ast.Name(id="min"), args=[a, b]):
            return _minus(a, b), b, a, a
        case ast.IfExp(test=ast.Compare(left=a, ops=[op], comparators=[b]), body=body, orelse=orelse) if (
            type(op) in _HOLDS
        ):
            above, at_zero, below = (body if holds else orelse for holds in _HOLDS[type(op)])
            return _minus(a, b), above, below, at_zero
    return None


def _minus(a: ast.expr, b: ast.expr) -> ast.expr:
    if isinstance(b, ast.Constant) and b.value == 0:
        return a
    return ast.BinOp(a, ast.Sub(), b)
