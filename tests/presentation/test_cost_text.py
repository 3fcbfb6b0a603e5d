"""The cost of a run names what the run has: a closed form evaluates no right-hand sides."""

from __future__ import annotations

import hybridsim as hs


def test_a_closed_form_states_no_right_hand_sides() -> None:
    closed, stepped = (repr(hs.simulate("dfcs", (0, 0.05), integrator=name)) for name in ("exact", "tsit5"))
    assert "right-hand sides" not in closed and " steps, " in closed
    assert ", 0 right-hand sides" not in stepped and " right-hand sides, " in stepped
