"""Trees of a model's expressions rewritten: corners become names that components set, implied sides are put in."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from hybridsim.errors import Place
from hybridsim.expr.rebuild import rebuilt
from hybridsim.expr.write import write
from hybridsim.model.continuity import is_continuous
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.nonsmooth import (
    COMPONENT,
    JUMPS,
    KEPT,
    MODE,
    POWER,
    Primitive,
    Sides,
    is_clear_of_zero,
    is_whole,
    limited,
    sides_of,
)
from hybridsim.model.one_sided import names_of, never_negative, number_of

if TYPE_CHECKING:
    from hybridsim.model.model import Model

VARIABLE = "__corner_"  # names of a model do not begin with two underscores


@dataclass(frozen=True)
class Here:
    """Where a tree stands: in words, the signs that its mode implies, why nothing is to be replaced (or empty)."""

    where: str
    place: Place | None
    signs: Mapping[Family, int] = field(default_factory=dict)
    untouched: str = ""


@dataclass
class Found:
    """A corner on its way: its component's name, its argument, its variables with their values above and below."""

    name: str
    argument: ast.expr
    sign: int
    values: dict[str, tuple[ast.expr, ast.expr]] = field(default_factory=dict)


class Rewriting:
    """One pass over the expressions of one model; what it found is in `corners`, `implied` and `primitives`.

    Parameters
    ----------
    refusal : why no corner is to become a component, if so.
    """

    def __init__(self, model: Model, refusal: str = "") -> None:
        self.model, self.refusal = model, refusal
        self.meanings = Meanings(model)
        self.components = model.all_components()
        self.signs = [[self.meanings.signs(c, mode) for mode in c.modes] for c in self.components]
        self.corners: dict[Family, Found] = {}
        self.implied: dict[int, dict[str, tuple[ast.expr, ...]]] = {}  # component -> variable -> its values
        self._accounts: dict[tuple[str, str, str], tuple[list[str], Place | None]] = {}
        self.count = 0
        self._walked: dict[tuple[object, ...], tuple[ast.expr, Here, ast.expr]] = {}

    def primitives(self) -> tuple[Primitive, ...]:
        """What became of each primitive, in the order in which they were met."""
        found = self._accounts.items()
        return tuple(Primitive(*key[:1], tuple(where), *key[1:], place) for key, (where, place) in found)

    def walk(self, node: ast.expr, here: Here) -> ast.expr:
        """The tree with what is not smooth replaced; the very same tree where nothing is.

        Both sides of a corner hold its argument, so that what is nested is met twice at each level: it is done once.
        """
        if not self.meanings.moves(node):
            return node
        key = (id(node), id(here.signs), here.where, here.untouched)
        if key not in self._walked:
            self._walked[key] = node, here, self._walk(node, here)  # kept alive, as their numbers are the key
        return self._walked[key][-1]

    def _walk(self, node: ast.expr, here: Here) -> ast.expr:
        match node:
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[first, second, third, *others]):
                inner = ast.Call(node.func, [first, second], [])
                return self.walk(ast.Call(ast.Name(name, ast.Load()), [inner, third, *others], []), here)
            case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
                here = self._note_power(node, argument, here)
            case ast.Call(func=ast.Name(id="log" | "asin" | "acos" as name)):
                here = replace(
                    here, untouched=here.untouched or f"it stands in {name}, which ends where it does"
                )
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent) if not is_whole(exponent, self.meanings):
                here = self._note_power(node, base, here, exponent)
            case ast.BoolOp() | ast.Compare():
                return node
        parts = sides_of(node)
        if parts is not None and self.meanings.moves(parts[0]):
            return self._side(node, parts, here)
        if isinstance(node, ast.IfExp) and self.meanings.moves(node.test):
            return self._kept(node, "its condition is no single comparison by < or >", here)
        changed: list[bool] = []

        def change(part: ast.expr) -> ast.expr:
            new = self.walk(part, here)
            changed.append(new is not part)
            return new

        new = rebuilt(node, change)
        return new if any(changed) else node

    def _note_power(
        self, node: ast.expr, base: ast.expr, here: Here, exponent: ast.expr | None = None
    ) -> Here:
        numbers = self.model.parameter_values()
        power = None if exponent is None else number_of(exponent, numbers, self.meanings.lookup)
        if not self.meanings.moves(base):
            return here
        is_fraction = power is None or power != round(power)
        if is_fraction and not is_clear_of_zero(base, numbers, self.meanings):
            self.note(node, POWER, f"it has no series where {write(base)} = 0", here)
        return replace(here, untouched=here.untouched or "it stands in a root or a fractional power")

    def _side(self, node: ast.expr, parts: Sides, here: Here) -> ast.expr:
        """What a primitive becomes: one of its sides, or a variable that is set to the one that holds."""
        argument, above, below, at_zero = parts
        branches = (above, below) if isinstance(node, ast.IfExp) else ()
        forced = names_of(node) & self.meanings.forced
        family, sign = self.meanings.family(argument)
        if not family:
            return self.walk((below, at_zero, above)[sign + 1], here)
        if here.untouched:
            return self._kept(node, here.untouched, here)
        if any(limited(self.meanings.written_out(branch), self.meanings) for branch in branches):
            return self._kept(node, "one of its sides has no value beyond its border", here)
        if family in here.signs:
            return self._implied(node, (below, at_zero, above)[here.signs[family] * sign + 1], here)
        if self.never_negative(argument):
            return self._implied(node, above, here)
        owner = self._owner(family)
        if owner is not None:
            self.note(node, MODE, f"its side follows from the modes of {self.components[owner].name}", here)
            sides = [self.walk(part, here) for part in (below, at_zero, above)]
            values = tuple(sides[signs[family] * sign + 1] for signs in self.signs[owner])
            return self._variable(self.implied.setdefault(owner, {}), values)
        if forced:
            return self._kept(
                node, f"it depends on {', '.join(sorted(forced))}, which a mode solves for", here
            )
        if not self._agrees(node, parts):
            return self._kept(node, JUMPS, here)
        if self.refusal:
            return self._kept(node, self.refusal, here)
        found = self.corners.get(family)
        if found is None:
            found = self.corners[family] = Found(self._title(node), self.walk(argument, here), sign)
        self.note(node, COMPONENT, found.name, here)
        pair = (self.walk(above, here), self.walk(below, here))
        return self._variable(found.values, pair if sign == found.sign else pair[::-1])  # type: ignore[arg-type]  # a slice of two is two

    def _agrees(self, node: ast.expr, parts: Sides) -> bool:
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
        self.count += 1
        name = f"{VARIABLE}{self.count}"
        values[name] = row
        return ast.Name(name, ast.Load())

    def _implied(self, node: ast.expr, side: ast.expr, here: Here) -> ast.expr:
        self.note(node, MODE, "its side is known here", here)
        self.count += 1
        return self.walk(side, here)

    def _kept(self, node: ast.expr, reason: str, here: Here) -> ast.expr:
        self.note(node, KEPT, reason, here)
        return node

    def _title(self, node: ast.expr) -> str:
        taken = {component.name for component in self.components} | {c.name for c in self.corners.values()}
        title = write(node)
        while title in taken:
            title += "'"
        return title

    def note(self, node: ast.expr, became: str, remark: str, here: Here) -> None:
        where, _ = self._accounts.setdefault((write(node), became, remark), ([], here.place))
        if here.where not in where:
            where.append(here.where)

    def never_negative(self, node: ast.expr) -> bool:
        """Whether the form of a tree shows that it is never negative, whatever the parameters are."""
        return never_negative(node, {}, self.meanings.lookup) is not None
