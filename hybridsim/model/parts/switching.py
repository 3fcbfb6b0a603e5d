"""This module defines switching surfaces, at which rates jump, with Filippov sliding."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from hybridsim.expr import Expression, of_tree, parse, substitute
from hybridsim.expr.rebuild import with_names
from hybridsim.model.parts.component import Component, Guard, Mode, Surface
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap

ABOVE, BELOW, SLIDING = "above", "below", "sliding"
_BLEND = parse("(above + below)/2 + u*(above - below)/2").tree
ATTRACTION = (
    "__attraction_"  # prefix of the unknown's name in the guard that tests whether both sides point to it
)


@dataclass(frozen=True)
class SwitchingSurface(Declared):
    """A surface expr = 0 at which rates jump; its name is a variable u that rates contain.

    ::

        u = +1            for expr > 0
        u = -1            for expr < 0
        -1 <= u <= +1     while the motion slides along expr = 0, from d(expr)/dt = 0

    A rate that contains u therefore equals (1 + u)/2 times the rate above plus (1 - u)/2 times the rate below. This is
    Filippov's convex combination, or Utkin's equivalent control. u must enter the rates linearly.

    The motion crosses the surface if the rates on both sides point the same way, slides if both point to the surface,
    and leaves it when u reaches +1 or -1. If both point away (a start on a repelling surface), the run ends with status
    ``nonunique``.

    Parameters
    ----------
    name : str
        Name of the variable u.
    expr : str or float
        The switching function h(t, x), smooth, in any unit.
    above, below : mapping of str to str or float, optional
        Values of further variables on each side, with the same names in both. In sliding they are (1 + u)/2 above +
        (1 - u)/2 below. Use them for fields that are not written with a sign.
    place : Place, optional
        Place of the declaration, for error messages.

    Raises
    ------
    UsageError
        For a variable with a value on one side only.

    Notes
    -----
    Use it for relays, variable-structure controllers and fields that differ on the two sides of a surface. For dry
    friction use a `Contact`, which includes static friction; for hysteresis a `Component`; for continuous corners `abs`
    or `max`.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides (Kluwer, 1988),
    doi:10.1007/978-94-015-7793-9.

    V. I. Utkin, IEEE Trans. Autom. Control 22 (1977) 212, doi:10.1109/TAC.1977.1101446.

    Examples
    --------
    >>> SwitchingSurface("u", "x + 2*v").component().modes[0].guards[0].expr
    Expression(text='x + 2*v')
    """

    name: str
    expr: Expression
    above: Mapping[str, Expression] = field(default_factory=FrozenMap)
    below: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("expr")
        self._maps("above", "below")
        if single := sorted(set(self.above) ^ set(self.below)):
            side, other = ("above", "below") if single[0] in self.above else ("below", "above")
            raise self._fault(
                f"'{single[0]}' is set in `{side}` but not in `{other}`",
                f"set '{single[0]}' in `{other}` too",
            )

    def component(self) -> Component:
        """Return the automaton, with the modes ``above``, ``below`` and ``sliding``."""
        return self._component

    @cached_property
    def _component(self) -> Component:
        sides = {BELOW: "-1", ABOVE: "1"}
        one = {side: FrozenMap({self.name: parse(value)}) for side, value in sides.items()}
        unknown, pull = (ast.Name(name, ast.Load()) for name in (self.name, ATTRACTION + self.name))
        upper = Guard("upper", of_tree(ast.BinOp(ast.Constant(1), ast.Sub(), unknown)))
        lower = Guard("lower", of_tree(ast.BinOp(ast.Constant(1), ast.Add(), unknown)))
        attracts = Guard("attracts", of_tree(pull))
        minus = substitute(parse("-h", self.expr.place), {"h": self.expr})
        modes = (
            Mode(ABOVE, (Guard("side", self.expr),), set={**one[ABOVE], **self.above}),
            Mode(BELOW, (Guard("side", minus),), set={**one[BELOW], **self.below}),
            Mode(SLIDING, (upper, lower, attracts), set=self.blends()),
        )
        nothing = parse(0)
        surface = Surface(self.expr, self.name, ABOVE, BELOW, SLIDING, nothing, nothing, unique=True)
        return Component(self.name, modes, surface=surface, place=self.place)

    def blends(self) -> dict[str, Expression]:
        """Return the variables of the two sides as functions of u, equal to the sides for u = +1 and -1."""
        return {
            name: of_tree(blend(value.tree, self.below[name].tree, self.name), self.place)
            for name, value in self.above.items()
        }


def blend(above: ast.expr, below: ast.expr, unknown: str) -> ast.expr:
    """Return the expression that interpolates linearly between the values below and above."""
    return with_names(_BLEND, {"above": above, "below": below, "u": ast.Name(unknown, ast.Load())})
