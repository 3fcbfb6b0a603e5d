"""This module linearises products of unknowns in the rate of a surface.

An unknown is known beforehand, also in sliding, if no other unknown acts on its surface. If at most one of
the other factors holds its surface, the others have the values that their modes declare, and the rate is
linear in that one. With g for these values (0 for a holding factor) every product is replaced by its tangent:
u*w by g_w u + g_u w - g_u g_w. This is the product itself as long as one of the two does not hold. If both
hold, the rates on the sides do not determine the motion, and such modes are not admitted.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.nonlinear import nonlinear
from hybridsim.engine.lowering.program import Assign, Item, Switch


class Products:
    """The values that unknowns have inside products, and the pairs of surfaces that are never held together."""

    def __init__(self, lowering: LoweringState, unknown: dict[int, Any]) -> None:
        self.lowering, self.unknown = lowering, unknown
        self.number = {u: c for c, u in unknown.items()}
        self.pairs: set[tuple[int, int]] = set()
        self.known: set[tuple[int, int]] = set()  # (surface, unknown with a known value in its rate)

    def linear(self, c: int, totals: dict[int, Any], row: dict[int, Any]) -> tuple[dict[int, Any], Any]:
        """Return the effects of all unknowns on the rate of surface `c`, and the rest of the rate.

        totals : the rates of all surfaces as functions of the unknowns. row : the derivatives of this rate by
            the unknowns.
        """
        multiplied: set[int] = set()
        for d, slope in row.items():
            others = {self.number[u] for u in slope.free_symbols & self.number.keys()}
            surfaces = [self.lowering.components[e].surface for e in (d, *others)]
            if d in others or (others and not any(surface.unique for surface in surfaces)):
                raise nonlinear(self.lowering, c, d, slope.free_symbols & self.number.keys())
            multiplied |= others
        known = {d for d in multiplied if totals[d].free_symbols & self.number.keys() <= {self.unknown[d]}}
        self.known |= {(c, d) for d in known}
        slopes = {d: slope.free_symbols & self.number.keys() for d, slope in row.items() if d not in known}
        free = set().union(*slopes.values()) - {self.unknown[d] for d in known}
        self.pairs |= {(d, self.number[u]) for d, factors in slopes.items() for u in factors & free}
        values_by_mode = {u: self._value_by_mode(self.number[u]) for u in free}
        effects = {d: s.subs(values_by_mode) if s.free_symbols & free else s for d, s in row.items()}
        effects |= dict.fromkeys(known, self.lowering.sp.Integer(0))
        rest = totals[c].subs(values_by_mode)
        rest = rest.subs(
            {u: 0 for u in rest.free_symbols & self.number.keys() if self.number[u] not in known}
        )
        return effects, rest - sum(value * effects[self.number[u]] for u, value in values_by_mode.items())

    def items(self) -> list[Item]:
        """Return program items that set the values of unknowns by mode, and the flags of holding modes."""
        found: list[Item] = []
        for d in sorted({d for pair in self.pairs for d in pair}):
            component = self.lowering.components[d]
            found.append(self.lowering.in_modes(d, self._value_by_mode(d).name, self.lowering.sp.Integer(0)))
            holds = [self.lowering.sp.Integer(m.name == component.surface.hold) for m in component.modes]
            found.append(Switch(d, tuple((Assign(self._holds(d).name, value),) for value in holds)))
        return found

    def not_together(self, c: int, pull: Any) -> Any:
        """Return the attraction `pull` of surface `c`, or -1 while another surface in its products is held."""
        for d in sorted({e for pair in self.pairs if c in pair for e in pair} - {c}):
            pull = pull * (1 - self._holds(d)) - self._holds(d)
        return pull

    def diagonal(self, c: int, entry: Any) -> Any:
        """Return the effect of unknown `c` on its own surface, corrected for products of unknowns."""
        return entry + sum(
            self._holds(c) * self._holds(d)
            for d in sorted({e for p in self.pairs if c in p for e in p} - {c})
        )

    def _value_by_mode(self, d: int) -> Any:
        return self.lowering.sp.Symbol(f"from_mode_{d}", real=True)

    def _holds(self, d: int) -> Any:
        return self.lowering.sp.Symbol(f"holds_{d}", real=True)
