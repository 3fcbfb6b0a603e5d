"""This module defines the data of a rewriting, and the rules on which jumps a surface may represent."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from types import MappingProxyType

from hybridsim.errors import ModelError, Place
from hybridsim.expr.rebuild import rebuilt
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.parts.component import WholeNumber
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.continuity import is_continuous
from hybridsim.model.smoothing.jumps import Borders, Jump
from hybridsim.model.smoothing.nonsmooth import Sides, sides_of, uses_conditions, uses_sign
from hybridsim.model.smoothing.one_sided import never_negative
from hybridsim.model.smoothing.steps_in_time import TimeStep, lasting

IN_VELOCITY = "it is part of a relative velocity"
IN_EVENTS = "a guard, a monitor or another corner depends on it"


@dataclass(frozen=True)
class Here:
    """The context of a tree: its place in the model, the known signs, and the allowed replacements.

    `untouched` is the reason why nothing may be replaced here, or empty. `jumps` is the reason why jumps of states are
    kept; it is empty in a rate, where a motion may slide along a jump. `is_passing` allows jumps that a motion can only
    cross. `times` is the reason why a jump in time becomes a signal and not a component; it is empty in a rate.
    """

    where: str
    place: Place | None
    signs: Mapping[Family, int] = field(default_factory=dict)
    untouched: str = ""
    jumps: str = IN_EVENTS
    is_passing: bool = False
    times: str = IN_EVENTS
    rooted: frozenset[Family] = frozenset()


@dataclass
class Found:
    """A replaced corner: its component, its argument, and its variables with their values."""

    name: str
    argument: ast.expr
    sign: int
    values: dict[str, tuple[ast.expr, ...]] = field(default_factory=dict)


class RewritingState:
    """The corners and jumps of a model that a rewriting has found so far.

    Parameters
    ----------
    refusal : reason why no corner or jump may become a component, or empty.
    refused : reasons for single borders.
    shared : borders with jumps and corners.
    timed : borders in time that must be signals everywhere, because they occur in a contact or a guard.
    """

    def __init__(
        self,
        model: Model,
        refusal: str = "",
        refused: Mapping[Family, str] = MappingProxyType({}),
        shared: Set[Family] = frozenset(),
        timed: Set[Family] = frozenset(),
    ) -> None:
        self.model, self.refusal, self.refused, self.shared, self.timed = (
            model,
            refusal,
            refused,
            shared,
            timed,
        )
        self.meanings = Meanings(model)
        self.borders, self._has_sign = Borders(model, self.meanings), uses_sign(model)
        self.has_jumps = self._has_sign or uses_conditions(model)
        self._parameters = {parameter.name for parameter in model.parameters} | lasting(model)
        self.components = model.all_components()
        # whole numbers by name, as titles show them
        self.shown = {
            c.number: ast.Call(ast.Name("floor", ast.Load()), [c.argument.tree], [])
            for c in self.components
            if isinstance(c, WholeNumber)
        }
        self.signs = [[self.meanings.signs(c, mode) for mode in c.modes] for c in self.components]
        self.corners: dict[Family, Found] = {}
        self.jumps: dict[Family, Jump] = {}
        self.faults: list[ModelError] = []
        self._single: dict[int, tuple[ast.expr, ast.expr]] = {}
        self.steps: dict[Family, tuple[TimeStep, int]] = {}  # with the sign of the expression in its family
        self._known_signs: dict[frozenset[tuple[Family, int]], Mapping[Family, int]] = {}
        self.implied: dict[int, dict[str, tuple[ast.expr, ...]]] = {}  # component -> variable -> its values
        self._accounts: dict[tuple[str, str, str], tuple[list[str], Place | None]] = {}
        self.count = 0
        self._met: dict[int, tuple[ast.expr, frozenset[Family | None]]] = {}
        self._walked: dict[tuple[object, ...], tuple[ast.expr, Here, ast.expr]] = {}

    def is_open(self, family: Family, argument: ast.expr, here: Here) -> bool:
        """Return whether a switching surface may represent a jump at this place of the model."""
        return bool(
            family
            and not self.never_negative(argument)
            and self._owner(family) is None
            and family not in here.rooted
            and not self.borders.is_timed(argument)
            and not self._left(family, argument, here)
        )

    def _left(self, family: Family, argument: ast.expr, here: Here) -> str:
        """Return the reason why a jump is not replaced, or an empty text if it can be replaced."""
        reason = here.jumps
        if here.is_passing and self.borders.is_only_passed(argument):
            reason = ""
        return reason or self.refusal or self.refused.get(family, "") or self._border(family, argument)

    def _border(self, family: Family, argument: ast.expr) -> str:
        """Return the reason why an argument cannot become a switching surface, or an empty text."""
        if family in self.jumps:
            return ""
        return self.borders.refusal(argument) or self.borders.conflict(argument, self.jumps.values())

    def agrees(self, node: ast.expr, parts: Sides) -> bool:
        """Return whether a non-smooth function is continuous where its argument is zero."""
        argument, above, below, _ = parts
        if isinstance(node, ast.IfExp):
            family, sign = self.meanings.family(argument)
            sides = ((above, sign), (below, -sign))
            first, second = (resolved(self.meanings, tree, {family: s}) for tree, s in sides)
            return is_continuous(self.meanings, argument, first, second)
        return not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sign")

    def _owner(self, family: Family) -> int | None:
        """Return the number of a component whose modes determine the sign of an expression, or None."""
        for c, modes in enumerate(self.signs):
            if modes and all(family in signs for signs in modes):
                return c
        return None

    def never_negative(self, node: ast.expr) -> bool:
        """Return whether a tree is never negative for all values of the parameters."""
        return never_negative(node, {}, self.meanings.lookup) is not None


def resolved(meanings: Meanings, node: ast.expr, signs: Mapping[Family, int]) -> ast.expr:
    """Return a tree with definitions inserted and with the branches selected by known signs."""

    def side(part: ast.expr) -> ast.expr:
        sides = sides_of(part)
        if sides is not None and meanings.moves(sides[0]):
            family, own = meanings.family(sides[0])
            if family in signs:
                return side(sides[(3, 1, 2)[own * signs[family]]])
        return rebuilt(part, side)

    return side(meanings.written_out(node))
