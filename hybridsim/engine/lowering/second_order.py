"""This module handles relays that act on the second derivative of their function.

If du/dt = k w for the functions u and w of two relays and a number k, a motion that stays at u = 0 also stays
at w = 0. There dw/dt = a + b U + c W with both relays anywhere between -1 and 1. Filippov's rates hold both
at zero as long as |a| <= |b| + |c|. This is sliding of second order, as in a twisting controller (A. Levant,
Int. J. Control 58 (1993) 1247, doi:10.1080/00207179308923053). The condition determines only the sum of both
relays. Here both take the same fraction of their largest effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program import Assign, Item, Switch
from hybridsim.engine.lowering.program_names import user
from hybridsim.expr.simplify import simplified
from hybridsim.model.parts.switching import ATTRACTION


@dataclass(frozen=True)
class Partner:
    """A relay whose surface w is proportional to the rate of another relay's function u: du/dt = factor * w.

    Parameters
    ----------
    component : component of w.
    factor : k, a non-zero number.
    """

    component: int
    factor: Any

    def share(self, c: int, d: int, sp: Any) -> Any:
        """Return the coefficient of relay `d` in the condition that relay `c` and its partner have equal weights."""
        if d == c:
            return sp.Integer(1)
        return -sp.sign(self.factor) if d == self.component else sp.Integer(0)


def partners(
    lowering: LoweringState,
    surfaces: dict[int, Any],
    rate: dict[int, Any],
    effect: dict[tuple[int, int], Any],
) -> dict[int, Partner]:
    """Return the partners of the relays that do not affect the rate of their own function.

    A relay without action and without a partner can never be held. rate : rate of each surface's function
    without any relay. effect : effect of each relay (second) on each such rate (first).
    """
    found = {}
    for c in sorted(lowering.never_held):
        if any(effect[c, d] != 0 for d in surfaces):
            continue
        written_out = lowering.inline(rate[c], lowering.definitions)
        for d in surfaces:
            is_relay = lowering.components[d].surface.unique
            if not is_relay or d in lowering.never_held or effect[d, c] == 0:
                continue
            factor = simplified(written_out / surfaces[d])
            if factor.is_number and factor.is_real and factor != 0:
                found[c] = Partner(d, factor)
                break
    return found


def attraction(lowering: LoweringState, c: int, partner: Partner, effect: dict[tuple[int, int], Any]) -> Item:
    """Return a program item for the attraction of relay `c` while its partner is held."""
    sp, other = lowering.sp, lowering.components[partner.component]
    name = user(ATTRACTION + lowering.components[c].surface.unknown)
    pull = -partner.factor * effect[partner.component, c]
    branches = [pull if m.name == other.surface.hold else sp.Integer(-1) for m in other.modes]
    return Switch(partner.component, tuple((Assign(name, value),) for value in branches))
