"""Choose how holding modes keep constraints: solve a constraint for one state, or project the states."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.lowering.elimination import eliminated, never_all_zero
from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program import Assign, Item, Switch
from hybridsim.errors import ModelError
from hybridsim.expr.simplify import simplified

# From an error of 1e-3, the largest tolerance, Newton's method reaches rounding after two corrections. The
# third correction is for stages of a step, which may be farther away.
_CORRECTIONS = 3

Held = tuple[int, int]
"""A constraint: its component, and 0 for the surface function or 1 for the rate of a gap."""


class HeldStates:
    """The states that held surfaces determine, and the program items that compute them.

    Parameters
    ----------
    surfaces : functions of states, t and parameters that holding modes keep at zero; only those that a mode
        can hold.

    Attributes
    ----------
    pins : maps a constraint to the index of the one state that is evaluated from it, if the constraint is
        linear in that state with a coefficient free of states. The evaluation is then exact. Two constraints
        that never hold at the same time, such as two stops of one body, may share a state.
    projected : maps any other constraint to the indices of its states. They are moved along the gradients of
        the held constraints by Newton's method. Constraints that share a state with one of these are
        projected, too.
    """

    def __init__(self, lowering: LoweringState, surfaces: dict[Held, Any]) -> None:
        self.lowering, self.surfaces = lowering, surfaces
        self.states: list[Any] = lowering.states
        self._of_gaps = {x for c, k in surfaces if k == 1 for x in surfaces[c, 0].free_symbols}
        choices = {c: self._linear_in(c) for c in surfaces}
        free = self._without_choice(choices)
        pins = self._chosen(choices, free)
        if pins is None:
            loose = never_all_zero(lowering, surfaces)
            if loose is None:
                raise self._dependent(list(choices))
            loose |= {c for c in choices if lowering.components[c[0]].surface.unique}
            choices = {c: [] if c in loose else i for c, i in choices.items()}
            free = self._without_choice(choices)
            pins = self._chosen(choices, free)
        if pins is None:
            raise self._circle(list(choices))
        self.pins = pins
        self.projected = {c: self._uses(c) for c in surfaces if c in free}
        self._lengths: dict[Held, Any] = {c: lowering.sp.Integer(0) for c in self.projected}

    def by_component(self, states: dict[Held, Any]) -> dict[int, tuple[int, ...]]:
        """Return the sorted indices of the states that the constraints of each component determine, by component."""
        found: dict[int, tuple[int, ...]] = {}
        for (c, _), i in states.items():
            found[c] = tuple(sorted({*found.get(c, ()), *(i if isinstance(i, tuple) else (i,))}))
        return found

    # -- which ----------------------------------------------------------------------------------------------

    def _linear_in(self, c: Held) -> list[int]:
        """Return the states for which a constraint can be solved, with the preferred state first.

        For the rate of a gap, velocities come before positions.
        """
        fixed, found = set(self.states), []
        for i, slope in self.lowering.gradient(self.surfaces[c]).items():
            x = self.states[i]
            if slope != 0 and not slope.free_symbols & fixed:
                found.append((c[1] == 1 and x in self._of_gaps, 0 if abs(slope) == 1 else 1, i))
        return [i for *_, i in sorted(found)]

    def _uses(self, c: Held) -> tuple[int, ...]:
        return tuple(self.lowering.gradient(self.surfaces[c]))

    def _without_choice(self, choices: dict[Held, list[int]]) -> set[Held]:
        """Return the constraints that need projection: they are nonlinear, or share states with a nonlinear one."""
        found = {c for c, states in choices.items() if not states}
        for c in found:
            surface = self.lowering.components[c[0]].surface
            if not (surface.unique or surface.is_unilateral):
                raise ModelError(
                    f"{self.lowering.components[c[0]].name}: the relative velocity "
                    f"'{self.lowering.written(c[0])}' is not linear in any state",
                    place=self.lowering.place(c[0]),
                    remedy="declare the relative velocity as a state",
                )
        size = -1
        while found and len(found) > size:
            size = len(found)
            moved = {i for c in found for i in self._uses(c)}
            found |= {c for c in choices if moved & set(self._uses(c))}
        return found

    def _chosen(self, choices: dict[Held, list[int]], free: set[Held]) -> dict[Held, int] | None:
        """Return a different state for each constraint without projection, or None if there is no such choice."""
        pinned = {c: found for c, found in choices.items() if c not in free}
        return self._match(list(pinned), pinned, {})

    def _dependent(self, held: list[Held]) -> ModelError:
        lowering = self.lowering
        components = list(dict.fromkeys(c for c, _ in held))
        titles = dict.fromkeys(lowering.title(c, plural=True) for c in components)
        remedy = "merge contacts that share one relative velocity, and surfaces that coincide"
        kinds = [lowering.components[c].surface for c in components]
        if any(surface.is_unilateral for surface in kinds):
            remedy += "; if two gaps are never zero together, write them in the form x and 1 - x, or as modes"
        if not any(surface.unique for surface in kinds):
            remedy += "; or declare the structure with its matrices as an hs.MechanicalSystem, which accepts "
            remedy += "redundant contacts"
        return ModelError(
            f"the {' and '.join(titles)} of "
            + ", ".join(lowering.components[c].name for c in components)
            + " are not independent: they cannot all be kept at zero, each by a different state",
            place=lowering.place(components[0]),
            remedy=remedy,
        )

    def _circle(self, held: list[Held]) -> ModelError:
        components = list(dict.fromkeys(c for c, _ in held))
        names = ", ".join(self.lowering.components[c].name for c in components)
        titles = dict.fromkeys(self.lowering.title(c, plural=True) for c in components)
        return ModelError(
            f"the {' and '.join(titles)} of {names} depend on each other in a circle: they cannot be solved "
            "one after the other, each for a different state",
            place=self.lowering.place(components[0]),
            remedy=f"declare one of the {' or '.join(titles)} as a state, or use an hs.MechanicalSystem",
        )

    def _match(
        self, open_: list[Held], choices: dict[Held, list[int]], taken: dict[Held, int]
    ) -> dict[Held, int] | None:
        if not open_:
            return taken if self._acyclic(taken) else None
        for i in choices[open_[0]]:
            if all(self._may_share(open_[0], d) for d, j in taken.items() if i == j):
                result = self._match(open_[1:], choices, taken | {open_[0]: i})
                if result is not None:
                    return result
        return None

    def _may_share(self, one: Held, other: Held) -> bool:
        """Return whether two constraints may determine the same state: they are equal, or never held together."""
        rates = {one, other}
        tied = any(rates == {(tie.gap, 1), (tie.along, 0)} for tie in self.lowering.stop_couplings)
        return tied or self._exclude(one[0], other[0])

    def _exclude(self, c: int, d: int) -> bool:
        """Return whether two surfaces are parallel at a constant distance, and so never both zero."""
        is_gap, is_other = (self.lowering.components[i].surface.is_unilateral for i in (c, d))
        if c == d or is_gap != is_other:
            return False
        sp, one, other = self.lowering.sp, self.surfaces[c, 0], self.surfaces[d, 0]
        ratio = sp.Integer(-1)  # for gaps: one grows by as much as the other shrinks
        if not is_gap:
            if self._uses((c, 0)) != self._uses((d, 0)):
                return False
            x = self.states[self._uses((c, 0))[0]]
            ratio = sp.diff(one, x) / sp.diff(other, x)
        apart = simplified(one - ratio * other)
        return bool(apart != 0) and (apart.free_symbols | ratio.free_symbols) <= self.lowering.parameters

    def _acyclic(self, pins: dict[Held, int]) -> bool:
        remaining = dict(pins)
        while remaining:
            free = [
                c
                for c, i in remaining.items()
                if not self.surfaces[c].free_symbols
                & {self.states[j] for d, j in remaining.items() if d != c and j != i}
            ]
            if not free:
                return False
            for c in free:
                del remaining[c]
        return True

    # -- how ------------------------------------------------------------------------------------------------

    def items(self) -> list[Item]:
        """Return program items that compute held states from constraints, and copy the integrated states."""
        sp = self.lowering.sp
        moved = {i for states in self.projected.values() for i in states}
        items: list[Item] = self._projection(sorted(moved)) if moved else []
        for i, x in enumerate(self.states):
            raw = _raw(sp, i)
            holding = [c for c, j in self.pins.items() if i == j]
            if not holding and i not in moved:
                items.append(Assign(x.name, raw))
            before = raw
            for c in holding:  # at most one of them holds at a time
                name = x.name if c == holding[-1] else f"pinned_{i}_{c[0]}"
                items.append(self._pinned(c, x, name, raw, before))
                before = sp.Symbol(name, real=True)
        return items

    def _pinned(self, c: Held, x: Any, name: str, raw: Any, before: Any) -> Switch:
        sp, s = self.lowering.sp, self.surfaces[c]
        value = simplified(-s.subs(x, 0) / sp.diff(s, x))
        return self._in_hold(c[0], name, _where_pinned(sp, value, raw), before)

    def holding(self, i: int) -> list[int]:
        """Return the components whose holding modes determine states."""
        return [c for (c, _), j in self.pins.items() if i == j]

    def _in_hold(self, c: int, name: str, value: Any, otherwise: Any) -> Switch:
        component = self.lowering.components[c]
        hold = component.surface.hold
        return Switch(
            c, tuple((Assign(name, value if m.name == hold else otherwise),) for m in component.modes)
        )

    def _projection(self, moved: list[int]) -> list[Item]:
        """Return program items that project the states onto nonlinear surfaces by Newton corrections."""
        sp, states = self.lowering.sp, self.states
        items: list[Item] = []
        order = list(self.projected)
        at = {states[i]: _raw(sp, i) for i in moved}
        for k in range(_CORRECTIONS):
            matrix: dict[tuple[Held, Held], Any] = {}
            right: dict[Held, Any] = {}
            slopes: dict[tuple[Held, int], Any] = {}
            for c in order:
                s = self.surfaces[c]
                for i in self.projected[c]:
                    name = f"normal_{k}_{_label(c)}_{i}"
                    items.append(Assign(name, sp.diff(s, states[i]).subs(at, simultaneous=True)))
                    slopes[c, i] = sp.Symbol(name, real=True)
                name = f"miss_{k}_{_label(c)}"
                items.append(self._in_hold(c[0], name, s.subs(at, simultaneous=True), sp.Integer(0)))
                right[c] = sp.Symbol(name, real=True)
            for c in order:
                for d in order:
                    both = [i for i in self.projected[c] if i in self.projected[d]]
                    if both:
                        name = f"metric_{k}_{_label(c)}_{_label(d)}"
                        value = sp.Add(*(slopes[c, i] * slopes[d, i] for i in both))
                        items.append(self._in_hold(c[0], name, value, sp.Integer(1 if c == d else 0)))
                        matrix[c, d] = sp.Symbol(name, real=True)
            length = {c: sp.Symbol(f"length_{k}_{_label(c)}", real=True) for c in order}
            items += eliminated(order, length, matrix, right, f"p{k}_", _label)
            self._lengths = {c: self._lengths[c] + length[c] for c in order}
            after = {}
            for i in moved:
                name = f"moved_{k}_{i}"
                off = [length[c] * slopes[c, i] for c in order if (c, i) in slopes]
                items.append(Assign(name, at[states[i]] - sp.Add(*off)))
                after[states[i]] = sp.Symbol(name, real=True)
            at = after
        for i in moved:
            items.append(Assign(states[i].name, _where_pinned(sp, at[states[i]], _raw(sp, i))))
        return items

    def turned(self, derivatives: list[str]) -> tuple[list[Item], list[str]]:
        """Return the rates of the integrated states, corrected for the rotation of surface normals.

        The projection of x + sum of l_c grad s_c(x) is x. The integrated point is off the surface by its
        errors and moves by x' + sum of l_c d(grad s_c)/dt with constant l_c. Its projection then moves by x'
        to first order.
        """
        sp, states = self.lowering.sp, self.states
        items: list[Item] = []
        names = list(derivatives)
        for i in sorted({i for held in self.projected.values() for i in held}):
            rate = sp.Symbol(derivatives[i], real=True)
            for c, held in self.projected.items():
                normal = sp.diff(self.surfaces[c], states[i])
                turning = sp.diff(normal, self.lowering.s) + sp.diff(normal, self.lowering.t)
                for j in held:
                    turning += sp.diff(normal, states[j]) * sp.Symbol(derivatives[j], real=True)
                rate += self._lengths[c] * turning
            names[i] = f"turned_{i}"
            items.append(Assign(names[i], rate))
        return items, names


def _label(c: Held) -> str:
    """Return the name of a constraint inside the generated program."""
    return f"{c[0]}" if c[1] == 0 else f"{c[0]}r"


def _raw(sp: Any, i: int) -> Any:
    """Return the symbol of the integrated value of a state."""
    return sp.Symbol(f"raw_{i}", real=True)


def _where_pinned(sp: Any, value: Any, raw: Any) -> Any:
    """Return an expression that selects the evaluated or the integrated value of a held state."""
    return sp.Piecewise((value, sp.Symbol("pin", real=True) > 0), (raw, True))
