"""This module contains test cases of guards that coincide, are flat, or become zero by a reset."""

from __future__ import annotations

from typing import Any

from hybridsim.testing.checks import at_times, equals, says
from hybridsim.testing.scene import END, Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of guards that coincide, are zero at the start, are flat, or become zero by a reset."""
    after = ("a:after", "b:after")
    return (
        Scene(
            "same-guard-twice",
            "twice",
            (0.0, 3.0),
            Truth(((1.0, "one"), (1.0, "two"), *((2.0, name) for name in after)), ((3.0, (3.0,)),)),
            needs("monitors", "transitions"),
            tol_t=1e-12,
        ),
        Scene(
            "events-at-the-end",
            "end-of-run",
            (0.0, 1.1),
            Truth(
                ((1.1, "ramp:down"), (1.1, "stop:stick")),
                ((END, (0.5, 0.0, 5.0 - 0.4 * 0.33 * 1.1 / 2.0, 0.0)),),
                end=1.1,
                checks=(("", equals(1.1, n=1.0)),),
            ),
            needs("transitions", "contacts", "adaptive"),
            tol_t=1e-12,
        ),
        Scene(
            "two-ulp-apart",
            "near-pair",
            (0.0, 2.0),
            Truth(((1.0, "a:near"), (1.0, "b:near")), ((2.0, (2.0,)),)),
            needs("transitions"),
            tol_t=1e-12,
        ),
        named(
            "past-the-guard",
            (0.0, 1.0),
            Truth(((0.0, "mode:rest"),), ((1.0, (1.0, 0.0)),), checks=(("", equals(1.0, h=1.0, w=0.0)),)),
            needs("transitions"),
        ),
        named(
            "flat-guard",
            (0.0, 2.0),
            Truth(None, ((0.5, (0.0,)), (2.0, (-1.0,))), checks=(("", left_once),)),
            needs("transitions", "monitors", "scheduled"),
        ),
        Scene(
            "reset-onto-a-guard",
            "chain",
            (0.0, 2.0),
            Truth(((1.0, "mode:second"), (1.0, "mode:third")), ((0.5, (0.5,)), (2.0, (4.0,)))),
            needs("transitions"),
            tol_t=1e-12,
        ),
        Scene(
            "reset-across-itself",
            "flip",
            (0.0, 6.0),
            Truth(
                ((1.0, "edge"), (3.0, "edge"), (5.0, "edge")), ((2.0, (0.0,)), (6.0, (0.0,)), (0.5, (0.5,)))
            ),
            needs("monitors"),
            tol_t=1e-12,
        ),
        Scene(
            "u-and-its-cube",
            "powers",
            (0.0, 3.0),
            Truth(((1.0, "u"), (1.0, "cube"), *((2.0, name) for name in after)), ((3.0, (3.0,)),)),
            needs("monitors", "transitions"),
            # a triple root is known to the cube root of the rounding, 6e-6
            tol_t=1e-5,
            floor=1e-5,
        ),
        Scene(
            "clock-and-guard-at-once",
            "same-instant",
            (0.0, 2.0),
            Truth(
                ((1.0, "tick"), (1.0, "mode:falling")),
                ((0.5, (0.5,)), (2.0, (0.0,))),
                checks=(("", equals(2.0, ticks=1.0)),),
            ),
            needs("transitions", "scheduled"),
            count_scheduled=True,
            tol_t=1e-12,
        ),
        Scene(
            "exchange",
            "swap",
            (0.0, 2.0),
            Truth(((1.0, "one"), (1.0, "two")), ((0.5, (0.5, 1.0, 2.0)), (2.0, (2.0, 2.0, 1.0)))),
            needs("monitors"),
            tol_t=1e-12,
        ),
        Scene(
            "endless-cascade",
            "cascade",
            (0.0, 2.0),
            Truth(
                None, ((0.5, (0.5,)),), status="cascade", end=1.0, checks=(("", says("mode.edge", "back")),)
            ),
            needs("transitions"),
        ),
    )


def left_once(solution: Any) -> list[str]:
    """Check that a flat guard causes one transition and at most one monitor event, both at t = 1."""
    changes = [event.t for event in solution.events if event.kind == "transition"]
    wrong = [] if changes == [1.0] else [f"the mode changes {at_times(changes)} instead of once, at t = 1"]
    crossed = [event.t for event in solution.events if event.component == "down"]
    return wrong + (
        [] if crossed in ([], [1.0]) else [f"the monitor fires {at_times(crossed)} instead of once, at t = 1"]
    )
