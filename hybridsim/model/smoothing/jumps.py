"""This module replaces jumps in a flow by switching surfaces, or by events at known times.

`sign(v)`, or a conditional whose branches differ, in a rate becomes a switching surface. The motion on the surface
follows A. F. Filippov's convention (see `SwitchingSurface`).
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction
from zlib import crc32

from hybridsim.expr import of_tree, parse
from hybridsim.expr.grammar import NAME, TIME, is_name
from hybridsim.expr.polynomial import Monomial, Polynomial, polynomial, tree_of
from hybridsim.expr.rebuild import with_names
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.component import Choice, Component, Corner, Guard, Mode
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.switching import ABOVE, BELOW, SwitchingSurface
from hybridsim.model.smoothing.nonsmooth import sides_of
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.smoothing.steps_in_time import lasting

SIGN = "__sign_"  # prefix of the name of a sign; declared names cannot start with two underscores


@dataclass
class Jump:
    """A replaced jump: its component, the variable of its sign, and the expression that changes sign.

    `values` contains variables with their values above, below and on the border. `blended` names the variables that
    jump and are interpolated on the border. `is_timed` is True if the border depends on time alone.
    """

    name: str
    unknown: str
    argument: ast.expr
    sign: int
    is_timed: bool
    values: dict[str, tuple[ast.expr, ...]] = field(default_factory=dict)
    blended: set[str] = field(default_factory=set)

    def signed(self, sign: int) -> ast.expr:
        """Return the sign of an argument as a name, negated if the argument has the opposite sign."""
        unknown = ast.Name(self.unknown, ast.Load())
        return unknown if sign == self.sign else ast.UnaryOp(ast.USub(), unknown)

    def component(self) -> Component:
        """Return the automaton: three modes for a surface, or two alternating modes in time."""
        argument = of_tree(self.argument)
        if self.is_timed:
            minus = of_tree(ast.UnaryOp(ast.USub(), self.argument))
            first = Mode(ABOVE, (Guard("side", argument, (Choice(BELOW),)),), set={self.unknown: parse(1)})
            then = Mode(BELOW, (Guard("side", minus, (Choice(ABOVE),)),), set={self.unknown: parse(-1)})
            made: Component = Corner(self.name, (first, then), initial=ABOVE)
        else:
            made = SwitchingSurface(self.unknown, argument).component()
        modes = []
        for m, mode in enumerate(made.modes):
            values = {name: of_tree(row[m]) for name, row in self.values.items()}
            modes.append(replace(mode, set={**mode.set, **values}))
        return replace(made, name=self.name, modes=tuple(modes))


class Borders:
    """Tests whether components can represent the jumps of a model."""

    def __init__(self, model: Model, meanings: Meanings) -> None:
        self._meanings = meanings
        components = model.all_components()
        self._switched = {name for component in components for name in component.variables}
        rates = {name for component in components for mode in component.modes for name in mode.der}
        self._changed = rates
        self._rates = {state.name: state.der.tree for state in model.states}
        still = {state.name for state in model.states if not polynomial(state.der.tree)} - rates
        self._moving = {state.name for state in model.states} - still
        piecewise_constant = {part.name for part in model.discrete} | {signal.name for signal in model.inputs}
        self._held = still | (piecewise_constant - lasting(model))
        self._surfaces = [
            c.surface.function.tree for c in components if c.surface and not c.surface.is_unilateral
        ]
        gaps = [c.surface.function.tree for c in components if c.surface and c.surface.is_unilateral]
        positions = {name for gap in gaps for name in names_of(meanings.written_out(gap))} & self._moving
        speeds = [names_of(meanings.written_out(s.der.tree)) for s in model.states if s.name in positions]
        self._of_gaps = positions.union(*speeds) & self._moving

    def refusal(self, argument: ast.expr) -> str:
        """Return the reason why a jump at the zeros of an argument is not replaced, or an empty text."""
        tree = self._meanings.written_out(argument)
        names = names_of(tree)
        if names & self._switched:
            return f"the condition depends on {min(names & self._switched)}, which a mode sets"
        if any(sides_of(part) or isinstance(part, ast.IfExp) for part in ast.walk(tree)):  # type: ignore[arg-type]  # others have no sides
            return "the compared expression is not smooth"
        if names & self._changed:
            return f"a mode changes the rate of {min(names & self._changed)}"
        if names & self._of_gaps:
            return f"a closed gap constrains {min(names & self._of_gaps)}"
        if names & self._moving or (TIME in names and not names & self._held):
            return ""
        return "the compared expression may stay at zero, since neither time nor a changing state moves it"

    def is_only_passed(self, argument: ast.expr) -> bool:
        """Return whether an argument can only pass through zero, because no force or jump affects its rate."""
        names = names_of(self._meanings.written_out(argument)) & self._moving
        if names & self._changed:
            return False
        rates = [self._meanings.written_out(self._rates[name]) for name in names]
        return not any(names_of(rate) & self._switched or _jumps(rate) for rate in rates)

    def conflict(self, argument: ast.expr, jumps: Iterable[Jump]) -> str:
        """Return the reason why an argument conflicts with other surfaces and jumps, or an empty text."""
        if self.is_timed(argument) or self.is_only_passed(argument):
            return ""
        others = [*self._surfaces, *(jump.argument for jump in jumps if not jump.is_timed)]
        others = [other for other in others if not self.is_only_passed(other)]
        rows = [self._slopes(other) for other in (*others, argument)]
        for other, row in zip(others, rows[:-1], strict=True):
            if row is not None and rows[-1] is not None and _rank([row, rows[-1]]) < 2:
                return (
                    ""
                    if apart_by(self._meanings, other, argument)[2]
                    else "it may coincide with another surface"
                )
        known = [row for row in rows if row is not None]
        distinct = [row for k, row in enumerate(known) if all(_rank([row, other]) > 1 for other in known[:k])]
        return "two of the surfaces determine a third one" if _rank(distinct) < len(distinct) else ""

    def _slopes(self, argument: ast.expr) -> list[Fraction] | None:
        """Return the coefficients of the states in an argument, or None if the argument is not linear."""
        slopes = dict.fromkeys(sorted(self._moving), Fraction(0))
        for monomial, coefficient in polynomial(self._meanings.written_out(argument)).items():
            moved = [factor for factor in monomial if not self._moving.isdisjoint(NAME.findall(factor[0]))]
            size = coefficient
            for name, power in monomial:
                size *= 1 if (name, power) in moved else (1 + Fraction(crc32(name.encode()), 2**32)) ** power
            if len(moved) > 1 or any(name not in slopes or power > 1 for name, power in moved):
                return None
            for name, _ in moved:
                slopes[name] += size
        return list(slopes.values())

    def is_timed(self, argument: ast.expr) -> bool:
        """Return whether an argument depends on time only."""
        return not names_of(self._meanings.written_out(argument)) & self._moving


def _jumps(tree: ast.expr) -> bool:
    """Return whether a tree may contain a jump."""
    return any(isinstance(part, ast.IfExp) or ast.unparse(part) == "sign" for part in ast.walk(tree))


def _rank(rows: list[list[Fraction]]) -> int:
    """Return the rank of a list of rows, by elimination."""
    left, rank = [row for row in rows if any(row)], 0
    while left:
        first, *others = left
        column = next(k for k, value in enumerate(first) if value)
        reduced = [
            [b - a * row[column] / first[column] for a, b in zip(first, row, strict=True)] for row in others
        ]
        left, rank = [row for row in reduced if any(row)], rank + 1
    return rank


def apart_by(
    meanings: Meanings, first: ast.expr, second: ast.expr
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Return n, d and the constant g = n*first - d*second for parallel expressions, otherwise empty polynomials.

    n and d are numbers times products of parameters, n / d the ratio of the slopes of the second to those of the first.
    """
    p, q = (polynomial(meanings.written_out(argument)) for argument in (first, second))

    def is_constant(one: Polynomial) -> bool:
        return all(is_name(name) and name not in meanings.moving for m in one for name, _ in m)

    moved = [m for m in p if any(name in meanings.moving for name, _ in m)]
    for other in q if moved else ():
        shape = _times(other, moved[0], -1)
        n = {tuple((name, power) for name, power in shape if power > 0): q[other] / p[moved[0]]}
        d = {tuple((name, -power) for name, power in shape if power < 0): Fraction(1)}
        if is_constant(n) and is_constant(d):
            apart: dict[Monomial, Fraction] = {}
            for one, factor, sign in ((p, n, 1), (q, d, -1)):
                ((by, size),) = factor.items()
                for m, c in one.items():
                    product = _times(m, by)
                    apart[product] = apart.get(product, Fraction(0)) + sign * size * c
            apart = {m: c for m, c in apart.items() if c}
            if is_constant(apart):
                return n, d, apart
    return {}, {}, {}


def _times(one: Monomial, other: Monomial, power: int = 1) -> Monomial:
    """Return the product of a monomial and a power of another monomial."""
    powers = dict(one)
    for name, count in other:
        powers[name] = powers.get(name, 0) + power * count
    return tuple(sorted((name, count) for name, count in powers.items() if count))


def product_of_signs(meanings: Meanings, first: ast.expr, second: ast.expr) -> ast.expr | None:
    """Return sign(first)*sign(second) as a linear function of both signs, or None if the arguments are not parallel.

    With n, d and g of `apart_by` and n', d', g' their signs, the product is n' d' - d' g' u + n' g' w. Where n or d has
    the value 0, one border is constant, and has the sign that this gives it.
    """
    found = apart_by(meanings, first, second)
    if not found[0]:
        return None
    signs = [ast.Call(ast.Name("sign", ast.Load()), [tree_of(part)], []) for part in found]
    return with_names(parse("n*d - d*g*u + n*g*w").tree, dict(zip("ndg", signs, strict=True)))


def not_linear(trees: Iterable[tuple[str, ast.expr]], carried: Mapping[str, Set[str]]) -> set[str]:
    """Return the names of sign functions that enter an expression nonlinearly.

    `trees` contains the expressions of names, and of rates without a name. `carried` maps signs, forces and variables
    that jump with them to these signs.
    """
    carried, size, trees = dict(carried), -1, list(trees)
    while size < len(carried):
        size = len(carried)
        for name, tree in trees:
            if name and name not in carried and (inside := names_of(tree) & carried.keys()):
                carried[name] = set().union(*(carried[one] for one in inside))
    found: set[str] = set()
    for _, tree in trees:
        if not names_of(tree) & carried.keys():
            continue
        for monomial in polynomial(tree):
            factors = [factor for factor, power in monomial for _ in range(power)]
            signs = [sign for factor in factors if factor in carried for sign in carried[factor]]
            names_in_factors = {
                word for factor in factors if factor not in carried for word in NAME.findall(factor)
            }
            found.update(*(carried[name] for name in names_in_factors & carried.keys()))
            found.update(sign for sign in signs if signs.count(sign) > 1)
    return found
