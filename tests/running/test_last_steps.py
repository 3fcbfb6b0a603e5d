"""A step that is rejected is followed by a shorter one, at the end of a stretch as well."""

from __future__ import annotations

import hybridsim as hs


def test_the_last_step_is_not_tried_again_and_again() -> None:
    """x4 comes to zero where the run ends: the last ulps are rejected, and no shorter step is left of them."""
    leaves = hs.Guard("g", "max(x4 - 1.44, -x4 - 1.44)", hs.Choice("off", reset={"n": "n + 1"}))
    model = hs.Model(
        "zero-at-the-end",
        states=[
            hs.State("q1", -0.5, "v1"),
            hs.State("v1", -1.2, "-0.2 - (max(-(q1 - 0.36), q1 - 0.36) - min(q1, -q1) - (0.36 + 0.47))*3.0"),
            hs.State("x2", 0.7, "-0.4 - r1*1.9"),
            hs.State("x4", 1.2, "-0.48"),
        ],
        discrete={"n": 0},
        surfaces=[hs.SwitchingSurface("r1", "x2 - 0.14*sin(1.7*t)")],
        components=[hs.Component("auto1", [hs.Mode("on", leaves), hs.Mode("off")], initial="on")],
    )
    sol = hs.simulate(model, (0.0, 2.5), integrator="tsit5", limits={"steps": 10000})
    assert sol.status == "finished"
    assert abs(sol(2.5)[3]) < 1e-14
