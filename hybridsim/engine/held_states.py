"""How a holding mode keeps its surface at zero: one state evaluated from the constraint, or a projection onto it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hybridsim.engine.program import Assign, Item, Switch
from hybridsim.errors import ModelError

if TYPE_CHECKING:
    from hybridsim.engine.lower import Lowering

# Newton's method from a step's error of 1e-3, which no tolerance is above, is at rounding after two corrections; the
# third is for stages of a step, which may be further away.
_CORRECTIONS = 3


class HeldStates:
    """Which states the surfaces of a model hold, and the items that evaluate them.

    Parameters
    ----------
    surfaces : component to its s over states, t and parameters; those alone that a mode can hold.

    Attributes
    ----------
    pins : component to the index of the one state that is evaluated, where s is linear in it with a coefficient that no
        state changes: it is exact then.
    projected : component to the indices of the states of its s, for any other: they are moved along the gradients of
        the surfaces that are held, by Newton's method. So are surfaces that share a state with one of these.
    """

    def __init__(self, lowering: Lowering, surfaces: dict[int, Any]) -> None:
        self.lowering, self.surfaces = lowering, surfaces
        self.states: list[Any] = lowering.states
        choices = {c: self._linear_in(s) for c, s in surfaces.items()}
        free = self._without_choice(choices)
        pins = self._chosen(choices, free)
        if pins is None:
            self._refuse_dependent(list(choices))
            choices = {c: [] if lowering.components[c].surface.unique else i for c, i in choices.items()}
            free = self._without_choice(choices)
            pins = self._chosen(choices, free)
        if pins is None:
            raise self._dependent(list(choices))
        self.pins = pins
        self.projected = {c: self._uses(c) for c in surfaces if c in free}
        self._lengths: dict[int, Any] = {c: lowering.sp.Integer(0) for c in self.projected}

    # -- which ----------------------------------------------------------------------------------------------

    def _linear_in(self, s: Any) -> list[int]:
        """States in which s is linear with a coefficient free of states, the plainest first."""
        sp, fixed = self.lowering.sp, set(self.states)
        found = []
        for i, x in enumerate(self.states):
            slope = sp.diff(s, x)
            if slope != 0 and not slope.free_symbols & fixed:
                found.append((0 if abs(slope) == 1 else 1, i))
        return [i for _, i in sorted(found)]

    def _uses(self, c: int) -> tuple[int, ...]:
        return tuple(i for i, x in enumerate(self.states) if x in self.surfaces[c].free_symbols)

    def _without_choice(self, choices: dict[int, list[int]]) -> set[int]:
        """Components that are projected: those linear in no state, and what shares states with them."""
        found = {c for c, states in choices.items() if not states}
        for c in found:
            if not self.lowering.components[c].surface.unique:
                raise ModelError(
                    f"{self.lowering.components[c].name}: its relative velocity '{self.lowering.written(c)}' is linear "
                    "in no state",
                    place=self.lowering.place(c),
                    remedy="introduce the relative velocity as a state of its own",
                )
        size = -1
        while found and len(found) > size:
            size = len(found)
            moved = {i for c in found for i in self._uses(c)}
            found |= {c for c in choices if moved & set(self._uses(c))}
        return found

    def _chosen(self, choices: dict[int, list[int]], free: set[int]) -> dict[int, int] | None:
        """One state for each surface that is not projected, no two alike, no circle; None where there is none."""
        pinned = {c: found for c, found in choices.items() if c not in free}
        return self._match(list(pinned), pinned, {})

    def _refuse_dependent(self, linear: list[int]) -> None:
        """Refuse surfaces of which one is zero where the others are."""
        sp = self.lowering.sp
        slopes = sp.Matrix([[sp.diff(self.surfaces[c], x) for x in self.states] for c in linear])
        if not slopes.free_symbols & set(self.states) and slopes.rank() < len(linear):
            raise self._dependent(linear)

    def _dependent(self, components: list[int]) -> ModelError:
        lowering = self.lowering
        titles = dict.fromkeys(lowering.title(c, plural=True) for c in components)
        return ModelError(
            f"the {' and '.join(titles)} of "
            + ", ".join(lowering.components[c].name for c in components)
            + " are not independent: holding all of them at zero leaves no state for each",
            place=lowering.place(components[0]),
            remedy="merge contacts that share one relative velocity, and surfaces that are one",
        )

    def _match(
        self, open_: list[int], choices: dict[int, list[int]], taken: dict[int, int]
    ) -> dict[int, int] | None:
        if not open_:
            return taken if self._acyclic(taken) else None
        for i in choices[open_[0]]:
            if i not in taken.values():
                result = self._match(open_[1:], choices, taken | {open_[0]: i})
                if result is not None:
                    return result
        return None

    def _acyclic(self, pins: dict[int, int]) -> bool:
        remaining = dict(pins)
        while remaining:
            free = [
                c
                for c, i in remaining.items()
                if not self.surfaces[c].free_symbols
                & {self.states[j] for d, j in remaining.items() if d != c}
            ]
            if not free:
                return False
            for c in free:
                del remaining[c]
        return True

    # -- how ------------------------------------------------------------------------------------------------

    def items(self) -> list[Item]:
        """Effective states: a held one from its constraint, every other as integrated."""
        sp = self.lowering.sp
        by_state = {i: c for c, i in self.pins.items()}
        moved = {i for states in self.projected.values() for i in states}
        items: list[Item] = self._projection(sorted(moved)) if moved else []
        for i, x in enumerate(self.states):
            raw = _raw(sp, i)
            if i in by_state:
                items.append(self._pinned(by_state[i], x, raw))
            elif i not in moved:
                items.append(Assign(x.name, raw))
        return items

    def _pinned(self, c: int, x: Any, raw: Any) -> Switch:
        sp, s = self.lowering.sp, self.surfaces[c]
        value = sp.simplify(-sp.expand(s).coeff(x, 0) / sp.diff(s, x))
        return self._in_hold(c, x.name, _where_pinned(sp, value, raw), raw)

    def _in_hold(self, c: int, name: str, value: Any, otherwise: Any) -> Switch:
        component = self.lowering.components[c]
        hold = component.surface.hold
        return Switch(
            c, tuple((Assign(name, value if m.name == hold else otherwise),) for m in component.modes)
        )

    def _projection(self, moved: list[int]) -> list[Item]:
        """Corrections x -= sum over held c of l_c grad s_c, with sum over d of (grad s_c . grad s_d) l_d = s_c."""
        sp, states = self.lowering.sp, self.states
        items: list[Item] = []
        order = list(self.projected)
        at = {states[i]: _raw(sp, i) for i in moved}
        for k in range(_CORRECTIONS):
            matrix: dict[tuple[int, int], Any] = {}
            right: dict[int, Any] = {}
            slopes: dict[tuple[int, int], Any] = {}
            for c in order:
                s = self.surfaces[c]
                for i in self.projected[c]:
                    name = f"normal_{k}_{c}_{i}"
                    items.append(Assign(name, sp.diff(s, states[i]).subs(at, simultaneous=True)))
                    slopes[c, i] = sp.Symbol(name, real=True)
                name = f"miss_{k}_{c}"
                items.append(self._in_hold(c, name, s.subs(at, simultaneous=True), sp.Integer(0)))
                right[c] = sp.Symbol(name, real=True)
            for c in order:
                for d in order:
                    both = [i for i in self.projected[c] if i in self.projected[d]]
                    if both:
                        name = f"metric_{k}_{c}_{d}"
                        value = sp.Add(*(slopes[c, i] * slopes[d, i] for i in both))
                        items.append(self._in_hold(c, name, value, sp.Integer(1 if c == d else 0)))
                        matrix[c, d] = sp.Symbol(name, real=True)
            length = {c: sp.Symbol(f"length_{k}_{c}", real=True) for c in order}
            items += self.lowering.eliminate(order, length, matrix, right, prefix=f"p{k}_")
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
        """Rates of the states as they are integrated, from those on the surfaces: the normals turn on the way.

        The projection of x + sum of l_c grad s_c(x) is x, so that what is integrated, off the surface by its errors,
        moves by x' + sum of l_c d(grad s_c)/dt with the l_c as they are: its projection moves by x' then, to first
        order.
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


def _raw(sp: Any, i: int) -> Any:
    """A state as it is integrated."""
    return sp.Symbol(f"raw_{i}", real=True)


def _where_pinned(sp: Any, value: Any, raw: Any) -> Any:
    """A value where states are to be held, the state as integrated where they are wanted as they are."""
    return sp.Piecewise((value, sp.Symbol("pin", real=True) > 0), (raw, True))
