"""This module contains test cases of events that accumulate in finite time."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of accumulating events."""
    return *_ball(), _twisting(), *_tanks()


def _twisting() -> Scene:
    """Return the test case of a twisting motion, in which each half turn is 1/sqrt(3) as long as the previous one."""
    half, end = 4 * math.sqrt(2) / 3, 4 * math.sqrt(2) / 3 / (1 - 1 / math.sqrt(3))
    first, second = half, half * (1 + 1 / math.sqrt(3))

    def rests(solution: Any) -> list[str]:
        if solution.t_end < 5.0:
            return []  # a stop with a stated reason is not misleading, but the run does not continue
        x, v = solution(5.0)
        rest = abs(x) + abs(v) < 1e-6
        return [] if rest else [f"x is {x:.3g} and v is {v:.3g} at t = 5, where all has come to rest"]

    def begins(solution: Any) -> list[str]:
        held = [event.t for event in solution.events if event.target == "sliding"]
        late = [t for t in held if abs(t - end) > 1e-9 * end]
        return (
            [f"sliding begins {at_times(held)} instead of {end!r} along both surfaces"]
            if late or len(held) != 2
            else []
        )

    states = ((1.0, (0.5, -1.0)), (first, (-1 / 3, 0.0)), (second, (1 / 9, 0.0)))
    return named(
        "twisting",
        (0.0, 5.0),
        Truth(None, states, checks=(("", rests), ("located", begins))),
        needs("sliding", "accumulation"),
        tol_x=1e-8,
    )


def _tanks() -> tuple[Scene, ...]:
    """Return test cases of two water tanks, in which each visit of the hose is half as long as the previous one."""
    t, x = 2.0, [0.5, 0.0]  # the second tank is low
    events, low, left = [(t, "hose:second")], 1, 1e-4
    states = [(1.0, (0.25, 0.5)), (3.0, (0.0, 0.25))]
    while True:
        other = 1 - low
        lasts = x[other] / 0.5
        t, x[low], x[other], low = t + lasts, x[low] + 0.25 * lasts, 0.0, other
        if sum(x) <= left:
            break
        events.append((t, "hose:second" if low == 1 else "hose:first"))
    events.append((t, "hose:off"))

    def dry(solution: Any) -> list[str]:
        last = solution.events[-1]
        right = last.target == "off" and abs(last.t - 4.0) <= 4e-9
        return (
            []
            if right
            else [f"the last change is hose:{last.target} at t = {last.t!r} instead of hose:off at 4"]
        )

    common: dict[str, Any] = {"unit": 4.0, "tol_t": 1e-9, "tol_x": 1e-9}
    return (
        named("water-tanks", (0.0, 4.4), Truth(tuple(events), tuple(states)), needs("transitions"), **common),
        Scene(
            "water-tanks-endless",
            "water-tanks",
            (0.0, 4.4),
            Truth(None, (*states, (4.2, (0.0, 0.0))), checks=(("", dry),)),
            needs("transitions", "accumulation", "adaptive"),  # a fixed step passes the limit
            params={"left": 0.0},
            **common,
        ),
    )


def _ball() -> tuple[Scene, ...]:
    """Return the bouncing ball with and without a rule for rest."""
    p = CASES["FMI-ball"]["params"]
    g, e, v_min = p["g"], p["e"], p["v_min"]
    fall = math.sqrt(2 / g)
    speed, times, states = g * fall, [fall], [(0.2, (1 - g * 0.02, -g * 0.2))]
    while e * speed >= v_min:
        speed *= e
        states.append((times[-1] + 0.3 * speed / g, (0.3 * speed**2 / g * (1 - 0.15), 0.7 * speed)))
        times.append(times[-1] + 2 * speed / g)
    events = [(t, "mode:flight") for t in times[:-1]] + [(times[-1], "mode:rest")]
    at_rest = (("", equals(times[-1] + 0.1, h=0.0, w=0.0)), ("", equals(3.0, h=0.0, w=0.0)))
    bouncing = Scene(
        "FMI-ball",
        "ball",
        (0.0, 3.0),
        Truth(tuple(events), (*states, (3.0, (0.0, 0.0))), checks=at_rest),
        needs("transitions"),
        tol_t=1e-9,
        tol_x=1e-9,
        speed=4.0,
    )
    endless = Scene(
        "ball-accumulation",
        "ball",
        (0.0, 3.0),
        Truth(None, ((0.2, states[0][1]),), status="accumulation", end=fall * (1 + e) / (1 - e)),
        needs("transitions", "accumulation"),
        params={"v_min": 0.0},
        speed=4.0,
    )
    return bouncing, endless
