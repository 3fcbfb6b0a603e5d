"""This module replaces corners and jumps in the expressions of a model by variables of components."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace

from hybridsim.errors import ModelError
from hybridsim.expr import parse
from hybridsim.expr.rebuild import rebuilt, with_names
from hybridsim.expr.write import write
from hybridsim.model.meanings import Family
from hybridsim.model.parts.switching import blend
from hybridsim.model.smoothing.conditions import TooManyConditions, single_comparisons
from hybridsim.model.smoothing.continuity import has_root_beside_sign, rooted_in, sides_of_product
from hybridsim.model.smoothing.hoisting import jump_inside
from hybridsim.model.smoothing.jumps import SIGN, Jump, product_of_signs
from hybridsim.model.smoothing.nonsmooth import (
    COMPONENT,
    JUMPS,
    MODE,
    POWER,
    SURFACE,
    TIMED,
    UNCHANGED,
    Primitive,
    Sides,
    is_clear_of_zero,
    is_whole,
    limited,
    sides_of,
)
from hybridsim.model.smoothing.one_sided import names_of, number_of
from hybridsim.model.smoothing.rewriting_state import (
    IN_EVENTS,
    IN_VELOCITY,
    Found,
    Here,
    RewritingState,
    resolved,
)
from hybridsim.model.smoothing.steps_in_time import STEP, TimeStep, step_of

_EITHER = parse("p*a + (1 - p)*b").tree
VARIABLE = "__corner_"  # declared names cannot start with two underscores


class Rewriting(RewritingState):
    """Rewrites the expressions of a model once, and stores the corners and jumps."""

    def primitives(self) -> tuple[Primitive, ...]:
        """Return the treatment of each non-smooth function, in order of appearance."""
        found = self._accounts.items()
        return tuple(Primitive(*key[:1], tuple(where), *key[1:], place) for key, (where, place) in found)

    def single_signs(self, tree: ast.expr) -> ast.expr:
        """Return a tree in which signs of products are products of signs."""
        if not self._has_sign:
            return tree
        if id(tree) not in self._single:
            self._single[id(tree)] = tree, self.meanings.with_single_signs(tree)
        return self._single[id(tree)][1]

    def walk(self, node: ast.expr, here: Here) -> ast.expr:
        """Return a tree in which non-smooth parts are replaced, or the same tree if there are none.

        Results are cached, because both sides of a corner contain its argument and nested corners would be visited
        twice per level.
        """
        if not self.meanings.moves(node):
            return node
        key = (id(node), id(here.signs), here.where, here.untouched, here.jumps, here.times, here.rooted)
        if key not in self._walked:
            self._walked[key] = (
                node,
                here,
                self._walk(node, here),
            )  # keep both alive, since the key uses their ids
        return self._walked[key][-1]

    def _walk(self, node: ast.expr, here: Here) -> ast.expr:
        is_choice = isinstance(node, ast.IfExp) or ast.unparse(node).startswith("sign(")
        if not is_choice and (border := jump_inside(self, node, here)):
            return self._hoisted(node, border, here)
        match node:
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[first, second, third, *others]):
                inner = ast.Call(node.func, [first, second], [])
                return self.walk(ast.Call(ast.Name(name, ast.Load()), [inner, third, *others], []), here)
            case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
                here = self._note_power(node, argument, here)
            case ast.Call(func=ast.Name(id="log" | "asin" | "acos" as name)):
                here = replace(
                    here,
                    untouched=here.untouched or f"it is the argument of {name}, which has a limited domain",
                )
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent) if not is_whole(exponent, self.meanings):
                here = self._note_power(node, base, here, exponent)
            case ast.BoolOp() | ast.Compare():
                return node
            case ast.IfExp() if self.meanings.moves(node.test):
                if (taken_apart := self._taken_apart(node, here)) is not node:
                    return taken_apart
            case ast.Call(func=ast.Name(id="sign"), args=[argument]) if self.meanings.moves(argument):
                if (of_sign := self._sign_taken_apart(argument, here)) is not None:
                    return of_sign
            case ast.BinOp(op=ast.Mult() | ast.Div()) if self._has_sign:
                if rooted := rooted_in(self.meanings, node):
                    here = replace(here, rooted=here.rooted | rooted)
                elif has_root_beside_sign(self.meanings, node) and not here.rooted:
                    here = replace(here, jumps=here.jumps or "it is multiplied by a root that is zero there")
                if product := sides_of_product(self.meanings, node, here.rooted):
                    return self._side(node, product, here)
        parts = sides_of(node)
        if parts is not None and self.meanings.moves(parts[0]):
            return self._side(node, parts, here)
        if isinstance(node, ast.IfExp) and self.meanings.moves(node.test):
            return self._unchanged(node, f"{JUMPS}: its condition is an equality", here)
        changed: list[bool] = []

        def change(part: ast.expr) -> ast.expr:
            new = self.walk(part, here)
            changed.append(new is not part)
            return new

        new = rebuilt(node, change)
        return new if any(changed) else node

    def _taken_apart(self, node: ast.IfExp, here: Here) -> ast.expr:
        """Return the replacement of a conditional with several comparisons, or the node itself."""
        try:
            single = single_comparisons(self.meanings, node)
        except TooManyConditions:
            return self._unchanged(node, f"{JUMPS}: its condition has too many comparisons", here)
        return node if single is node else self.walk(single, here)

    def _sign_taken_apart(self, argument: ast.expr, here: Here) -> ast.expr | None:
        """Return the replacement of the sign of a non-smooth expression, or None for a smooth expression."""
        minus = ast.UnaryOp(ast.USub(), ast.Constant(1))
        node = ast.IfExp(ast.Compare(argument, [ast.Gt()], [ast.Constant(0)]), ast.Constant(1), minus)
        if self.never_negative(argument) or self._owner(self.meanings.family(argument)[0]) is not None:
            return None
        found = self._taken_apart(node, here)
        return None if found is node else found

    def _hoisted(self, node: ast.expr, border: ast.expr, here: Here) -> ast.expr:
        """Return the replacement of an expression that depends nonlinearly on a jump."""
        whole = self.meanings.written_out(node)
        made = ast.IfExp(ast.Compare(border, [ast.Gt()], [ast.Constant(0)]), whole, whole)
        return self._side(made, (border, whole, whole, whole), here)

    def is_smooth(self, argument: ast.expr) -> bool:
        """Return whether the form of an expression shows that it has neither corners nor jumps."""
        parts = ast.walk(self.meanings.written_out(argument))
        return not any(isinstance(part, ast.IfExp) or sides_of(part) for part in parts)  # type: ignore[arg-type]  # others have none

    def _signs(self, here: Here, family: Family, sign: int) -> Mapping[Family, int]:
        """Return the known signs, with one more expression whose sign is known."""
        known = {**here.signs, family: sign}
        return self._known_signs.setdefault(frozenset(known.items()), known)

    def _note_power(
        self, node: ast.expr, base: ast.expr, here: Here, exponent: ast.expr | None = None
    ) -> Here:
        numbers = self.model.parameter_values()
        power = None if exponent is None else number_of(exponent, numbers, self.meanings.lookup)
        if not self.meanings.moves(base):
            return here
        is_fraction = power is None or power != round(power)
        if is_fraction and not is_clear_of_zero(base, numbers, self.meanings):
            self.note(node, POWER, f"the power has no Taylor series where {write(base)} = 0", here)
        return replace(here, untouched=here.untouched or "it is in a root or a fractional power")

    def _side(self, node: ast.expr, parts: Sides, here: Here) -> ast.expr:
        """Return the replacement of a non-smooth function: one of its branches, or a variable."""
        argument, above, below, on_border = parts
        if here.signs and not self.is_smooth(argument):
            argument = resolved(self.meanings, argument, here.signs)
        branches = (above, below) if isinstance(node, ast.IfExp) else ()
        forced = names_of(node) & self.meanings.forced
        family, sign = self.meanings.family(argument)
        if not family:
            return self.walk((below, on_border, above)[sign + 1], here)
        agrees = self.agrees(node, parts)
        if family in here.signs and not agrees:
            return self._implied(node, (below, on_border, above)[here.signs[family] * sign + 1], here)
        if family in here.rooted and not agrees:
            return self._unchanged(node, "its product with a root or power is continuous", here)
        if self._is_step(family, argument, here, agrees) and (step := self._step(family, argument)):
            return self._stepped(node, step, parts, family, sign, here)
        if here.untouched == IN_VELOCITY and here.where and (not agrees or self.borders.is_timed(argument)):
            self.faults.append(self._fault_in_velocity(node, argument, here))
        if here.untouched:
            return self._unchanged(node, here.untouched if agrees else f"{JUMPS}: {here.untouched}", here)
        if any(
            self._is_limited(side, argument, family, s)
            for side, s in zip(branches, (sign, -sign), strict=False)
        ):
            reason = "the expression for one sign is undefined for the other sign"
            return self._unchanged(node, reason if agrees else f"{JUMPS}: {reason}", here)
        if family in here.signs:
            return self._implied(node, (below, on_border, above)[here.signs[family] * sign + 1], here)
        if self.never_negative(argument):
            return self._implied(node, above, here)
        owner = self._owner(family)
        if owner is not None:
            self.note(node, MODE, f"the mode of {self.components[owner].name} selects the branch", here)
            sides = [self.walk(part, here) for part in (below, on_border, above)]
            values = tuple(sides[signs[family] * sign + 1] for signs in self.signs[owner])
            return self._variable(self.implied.setdefault(owner, {}), values)
        if not agrees:
            return self._jump(node, (argument, above, below, on_border), family, sign, here)
        if forced:
            return self._unchanged(
                node, f"it depends on {', '.join(sorted(forced))}, which the solver computes in a mode", here
            )
        if self.refusal:
            return self._unchanged(node, self.refusal, here)
        inside = replace(here, signs=self._signs(here, family, sign))  # on one side of the node
        if isinstance(node, ast.IfExp) and (border := jump_inside(self, node, inside)):
            return self._hoisted(node, border, here)
        here = replace(here, jumps=IN_EVENTS, is_passing=False)
        pair = self._pair(above, below, family, sign, here)
        if family in self.shared:
            jump = self._jump_at(family, argument, sign)
            self.note(node, MODE, f"the mode of {jump.name} selects the branch", here)
            row = (*(pair if sign == jump.sign else pair[::-1]), self.walk(on_border, here))
            return self._variable(jump.values, row)
        found = self.corners.get(family)
        if found is None:
            found = self.corners[family] = Found(self._title(node), self.walk(argument, here), sign)
        self.note(node, COMPONENT, found.name, here)
        return self._variable(found.values, pair if sign == found.sign else pair[::-1])

    def _fault_in_velocity(self, node: ast.expr, argument: ast.expr, here: Here) -> ModelError:
        """Return the error for a jump in an expression that a contact, gap or surface holds at zero."""
        border = write(argument)
        if self.borders.is_timed(argument):
            remedy = (
                f"declare it as an input (table or wave), since the zeros of {border} in time are unknown"
            )
        else:
            remedy = (
                f"use a discrete state instead, and reset it by a monitor of '{border}', or by a transition where "
                f"'{border}' changes its sign"
            )
        return ModelError(
            f"'{write(node)}' jumps in {here.where}, but a mode must hold this expression at zero",
            place=here.place,
            remedy=remedy,
        )

    def _pair(
        self, above: ast.expr, below: ast.expr, family: Family, sign: int, here: Here
    ) -> tuple[ast.expr, ast.expr]:
        """Rewrite both branches of a non-smooth function; in each branch the sign of the argument is known.

        Signs without influence are dropped, because corners nested twenty times would otherwise be visited a million
        times.
        """
        first, second = (
            self.walk(
                side,
                replace(here, signs=self._signs(here, family, s)) if self._is_met(family, side) else here,
            )
            for side, s in ((above, sign), (below, -sign))
        )
        return first, second

    def _is_met(self, family: Family, node: ast.expr) -> bool:
        """Return whether a tree contains a jump, or a corner at which a given expression is zero."""
        return None in (met := self._borders_in(node)) or family in met

    def _borders_in(self, node: ast.expr) -> frozenset[Family | None]:
        """Return the arguments of the corners in a tree, and None for each jump."""
        if id(node) not in self._met:
            found: set[Family | None] = set()
            is_jump = isinstance(node, ast.IfExp | ast.Compare | ast.BoolOp)
            if is_jump or (isinstance(node, ast.Call) and ast.unparse(node.func) == "sign"):
                found.add(None)
            elif (parts := sides_of(node)) is not None:
                found.add(self.meanings.family(parts[0])[0])
            if isinstance(node, ast.Name) and (behind := self.meanings.lookup(node.id)) is not None:
                found |= self._borders_in(behind)
            for part in ast.iter_child_nodes(node):
                if isinstance(part, ast.expr):
                    found |= self._borders_in(part)
            self._met[id(node)] = node, frozenset(found)
        return self._met[id(node)][1]

    def _is_limited(self, branch: ast.expr, argument: ast.expr, family: Family, sign: int) -> bool:
        """Return whether the expression for one sign, such as a root, may be undefined for the other sign."""
        border = names_of(self.meanings.written_out(argument)) & self.meanings.moving
        side = resolved(self.meanings, branch, {family: sign})
        return any(names_of(base) & border for base in limited(side, self.meanings))

    def _is_step(self, family: Family, argument: ast.expr, here: Here, agrees: bool) -> bool:
        """Return whether a signal can represent a condition on time at this place of the model."""
        may_be_timed = here.untouched or (here.times and not agrees) or family in self.timed
        return bool(may_be_timed) and self.borders.is_timed(argument) and not self.borders.refusal(argument)

    def _step(self, family: Family, argument: ast.expr) -> TimeStep | None:
        """Return the step signal of a condition on time, or None if the times of its changes cannot be computed."""
        if family not in self.steps:
            tree = self.meanings.written_out(argument)
            found = step_of(f"{STEP}{len(self.steps) + 1}", tree, self._parameters, write(argument))
            if found is None:
                return None
            self.steps[family] = found, self.meanings.family(argument)[1]
            self.count += 1
        return self.steps[family][0]

    def timed_by_form(self) -> set[Family]:
        """Return the keys of jumps and corners whose sign depends on time alone and can be given by a signal."""
        found = {family: one.argument for family, one in self.jumps.items()}
        found |= {family: one.argument for family, one in self.corners.items()}
        return {f for f, border in found.items() if self.borders.is_timed(border) and self._step(f, border)}

    def _stepped(
        self, node: ast.expr, step: TimeStep, parts: Sides, family: Family, sign: int, here: Here
    ) -> ast.expr:
        """Return a condition on time as the sum of its two values, weighted by a step signal."""
        self.note(node, TIMED, step.title, here)
        pair = self._pair(parts[1], parts[2], family, sign, here)
        pair = pair if sign == self.steps[family][1] else pair[::-1]
        names = {"a": pair[0], "b": pair[1], "p": ast.Name(step.name, ast.Load())}
        return with_names(_EITHER, names)

    def _jump(self, node: ast.expr, parts: Sides, family: Family, sign: int, here: Here) -> ast.expr:
        """Return the replacement of a non-smooth function that jumps where its argument is zero."""
        argument, above, below, _ = parts
        if self.borders.is_timed(argument):
            reason = (
                here.times or self.refusal or self.refused.get(family, "") or self._border(family, argument)
            )
        else:
            reason = self._left(family, argument, here)
        if reason:
            return self._unchanged(node, f"{JUMPS}: {reason}", here)
        jump = self._jump_at(family, argument, sign)
        is_whole = isinstance(node, ast.IfExp) and node.body is node.orelse  # made by _hoisted
        self.note(above if is_whole else node, SURFACE, jump.name, here)
        if isinstance(node, ast.Call):
            return jump.signed(sign)
        for nested, other, way in ((above, below, 1), (below, above, -1)):
            if stairs := self._stairs(jump, argument, nested, other, way, here):
                return stairs
        pair = self._pair(above, below, family, sign, here)
        pair = pair if sign == jump.sign else pair[::-1]
        name = self._variable(jump.values, (*pair, blend(*pair, jump.unknown)))
        jump.blended.add(name.id)
        return name

    def _stairs(
        self, jump: Jump, argument: ast.expr, nested: ast.expr, other: ast.expr, way: int, here: Here
    ) -> ast.expr | None:
        """Return nested jumps between constants as a sum of signs, or None if their arguments are not parallel.

        `way` is the side (1 or -1) of the first border on which the second border is.
        """
        inner = sides_of(nested)
        if inner is None or any(map(self.meanings.moves, (*inner[1:], other))):
            return None
        product = product_of_signs(self.meanings, argument, inner[0])
        family, sign = self.meanings.family(inner[0])
        if product is None or jump.is_timed or self.refused.get(family) or self._border(family, inner[0]):
            return None
        second = self._jump_at(family, inner[0], sign)
        self.note(nested, SURFACE, second.name, here)
        first = self.meanings.family(argument)[1]
        signs = [one.signed(s) for one, s in ((jump, first), (second, sign))]
        parts = {"a": inner[1], "b": inner[2], "o": other, "u": signs[0], "w": signs[1]}
        text = f"(o + (a + b)/2)/2 + {way}*(u*((a + b)/2 - o)/2 + (a - b)/4*uw) + (a - b)/4*w"
        return with_names(parse(text).tree, {**parts, "uw": with_names(product, parts)})

    def _jump_at(self, family: Family, argument: ast.expr, sign: int) -> Jump:
        if family not in self.jumps:
            self.count += 1
            name = self._title(ast.Call(ast.Name("sign", ast.Load()), [argument], []))
            timed = self.borders.is_timed(argument)
            self.jumps[family] = Jump(name, f"{SIGN}{self.count}", argument, sign, timed)
        return self.jumps[family]

    def _variable(self, values: dict[str, tuple[ast.expr, ...]], row: tuple[ast.expr, ...]) -> ast.Name:
        texts = [write(tree) for tree in row]
        for name, other in values.items():
            if [write(tree) for tree in other] == texts:
                return ast.Name(name, ast.Load())
        self.count += 1
        name = f"{VARIABLE}{self.count}"
        values[name] = row
        return ast.Name(name, ast.Load())

    def _implied(self, node: ast.expr, side: ast.expr, here: Here) -> ast.expr:
        self.note(node, MODE, "the branch follows from signs that are already known", here)
        self.count += 1
        return self.walk(side, here)

    def _unchanged(self, node: ast.expr, reason: str, here: Here) -> ast.expr:
        self.note(node, UNCHANGED, reason, here)
        return node

    def _title(self, node: ast.expr) -> str:
        taken = {component.name for component in self.components} | {c.name for c in self.corners.values()}
        taken |= {jump.name for jump in self.jumps.values()}
        title = write(with_names(node, self.shown))
        while title in taken:
            title += "'"
        return title

    def note(self, node: ast.expr, became: str, remark: str, here: Here) -> None:
        if not here.where:
            return
        where, _ = self._accounts.setdefault(
            (write(with_names(node, self.shown)), became, remark), ([], here.place)
        )
        if here.where not in where:
            where.append(here.where)
