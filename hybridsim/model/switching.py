"""A switching surface: fields that differ on its sides, crossed or slid along by Filippov's convention."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from hybridsim.expr import Expression, of_tree, parse, substitute
from hybridsim.expr.rebuild import with_names
from hybridsim.model.component import Component, Guard, Mode, Surface
from hybridsim.model.declared import Declared
from hybridsim.model.frozen_map import FrozenMap

ABOVE, BELOW, SLIDING = "above", "below", "sliding"
_BLEND = parse("(above + below)/2 + u*(above - below)/2").tree
ATTRACTION = "__attraction_"  # before the unknown: how strongly it pulls towards its surface; no model's name begins so


@dataclass(frozen=True)
class SwitchingSurface(Declared):
    """A surface expr = 0 on which rates jump; its name u is the sign of expr, and the weight of the sides in sliding.

    ::

        u = +1            where expr > 0
        u = -1            where expr < 0
        -1 <= u <= +1     while the motion slides along expr = 0, solved for from d(expr)/dt = 0

    A rate that uses u is so (1 + u)/2 times the rate above plus (1 - u)/2 times the one below: Filippov's convex
    combination of the two, Utkin's equivalent control. u has to enter the rates linearly.

    The motion crosses where both sides lead the same way, slides where both lead to the surface, and leaves where u
    comes to +1 or -1. Where both lead away (a start on a surface that repels) the run ends with status ``nonunique``.

    Parameters
    ----------
    name : str
        Of the variable u.
    expr : str or float
        The switching function h(t, x), smooth, in any unit.
    above, below : mapping of str to str or float, optional
        Values of further variables on either side, with the same names in both; in sliding (1 + u)/2 above +
        (1 - u)/2 below. For whole fields that are not written with a sign.
    place : Place, optional
        Where it is written, for the messages of errors.

    Raises
    ------
    UsageError
        For names on one side only.

    Notes
    -----
    For a relay, a controller of variable structure, a field given on each side of a border. For dry friction
    a `Contact`, which knows static friction; for hysteresis a `Component`; for a corner, at which nothing
    jumps, `abs` and `max`.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides (Kluwer, 1988),
    doi:10.1007/978-94-015-7793-9.

    V. I. Utkin, IEEE Trans. Autom. Control 22 (1977) 212, doi:10.1109/TAC.1977.1101446.

    Examples
    --------
    >>> SwitchingSurface("u", "x + 2*v").component().modes[0].guards
    (Guard(name='side', expr=Expression(text='x + 2*v'), then=(), fatal=None),)
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
                f"'{single[0]}' has a value {side} and none {other}", f"write {single[0]} = ... in {other}"
            )

    def component(self) -> Component:
        """Its automaton, of the modes ``above``, ``below`` and ``sliding``."""
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
        """Its further variables as they are in sliding; with u = +1 and -1 these are their values on the sides."""
        return {
            name: of_tree(blend(value.tree, self.below[name].tree, self.name), self.place)
            for name, value in self.above.items()
        }


def blend(above: ast.expr, below: ast.expr, unknown: str) -> ast.expr:
    """What is above where the unknown is 1, below where it is -1, and in proportion between."""
    return with_names(_BLEND, {"above": above, "below": below, "u": ast.Name(unknown, ast.Load())})
