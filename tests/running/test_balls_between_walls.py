"""Balls in a row between two walls: their gaps add up to a constant, so all of them never close at once."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import hybridsim as hs


def row(x: list[float], v: list[float], masses: list[float], e: float, push: str = "") -> hs.Model:
    """Point balls between walls at 0 and 1; gap k is the one before ball k."""
    n = len(x)
    states = []
    for k in range(n):
        states.append(hs.State(f"x{k}", x[k], f"v{k}", nominal=1))
        states.append(hs.State(f"v{k}", v[k], f"(p{k} - p{k + 1} {push})/{masses[k]}", nominal=1))
    gaps = ["x0", *(f"x{k} - x{k - 1}" for k in range(1, n)), f"1 - x{n - 1}"]
    return hs.Model("row", states, impacts=[hs.Impact(f"p{k}", gap, e) for k, gap in enumerate(gaps)])


def exact(
    x: list[float], v: list[float], masses: list[float], e: float, end: int
) -> tuple[list[tuple[float, int]], list[float]]:
    """Times and gaps of all impacts, and the positions and velocities at the end, in fractions."""
    now, hits = Fraction(0), []
    xs, vs, ms = ([Fraction(value) for value in values] for values in (x, v, masses))
    rest, n = Fraction(e), len(xs)
    while True:
        places, speeds = [Fraction(0), *xs, Fraction(1)], [Fraction(0), *vs, Fraction(0)]
        due = [
            (now + (places[k + 1] - places[k]) / (speeds[k] - speeds[k + 1]), k)
            for k in range(n + 1)
            if speeds[k] > speeds[k + 1]
        ]
        first = min((time for time, _ in due), default=Fraction(end + 1))
        xs = [a + b * (min(first, Fraction(end)) - now) for a, b in zip(xs, vs, strict=True)]
        if first > end:
            return hits, [float(value) for pair in zip(xs, vs, strict=True) for value in pair]
        now = first
        for k in sorted(k for time, k in due if time == now):
            hits.append((float(now), k))
            if k in (0, n):
                ball = 0 if k == 0 else n - 1
                vs[ball] = -rest * vs[ball]
            else:
                impulse = (1 + rest) * (vs[k - 1] - vs[k]) / (1 / ms[k - 1] + 1 / ms[k])
                vs[k - 1] -= impulse / ms[k - 1]
                vs[k] += impulse / ms[k]


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize(
    ("x", "v", "masses", "e", "end"),
    [
        ([0.25, 0.75], [1.0, -0.5], [1.0, 2.0], 1.0, 10),
        ([0.25, 0.625], [1.0, -0.5], [1.0, 3.0], 0.75, 6),
        ([0.25, 0.75], [-1.0, 1.0], [1.0, 1.0], 1.0, 4),  # both walls are struck at one instant
        ([0.25, 0.5, 0.875], [1.0, 0.25, -0.5], [1.0, 2.0, 1.0], 1.0, 4),
    ],
)
def test_impacts_are_those_of_fractions(
    x: list[float], v: list[float], masses: list[float], e: float, end: int, integrator: str
) -> None:
    hits, last = exact(x, v, masses, e, end)
    sol = hs.simulate(row(x, v, masses, e), (0, end + 0.001), integrator=integrator)
    found = [(event.t, int(event.component[1:])) for event in sol.events if event.t < end]
    assert len(hits) > 6 and len(found) == len(hits)
    assert sorted(k for _, k in found) == sorted(k for _, k in hits)
    assert [time for time, _ in found] == pytest.approx([time for time, _ in hits], abs=1e-10)
    assert np.allclose(sol(float(end)), last, atol=1e-9)


def test_balls_that_are_pushed_to_a_wall_come_to_rest_there() -> None:
    """A constant force presses both balls to the right wall; the reactions at the end are 1 and 2."""
    sol = hs.simulate(row([0.25, 0.5], [0.0, 0.0], [1.0, 1.0], 0.0, "+ 1"), (0, 3), integrator="exact")
    assert sol.success
    assert sol(3.0).tolist() == [1.0, 0.0, 1.0, 0.0]
    assert [sol.output(name, 3.0) for name in ("p0", "p1", "p2")] == pytest.approx([0.0, 1.0, 2.0])
    left = hs.simulate(row([0.25, 0.5], [0.0, 0.0], [1.0, 1.0], 0.0, "- 1"), (0, 3), integrator="exact")
    assert left(3.0).tolist() == [0.0, 0.0, 0.0, 0.0]
    assert [left.output(name, 3.0) for name in ("p0", "p1", "p2")] == pytest.approx([2.0, 1.0, 0.0])


def test_gaps_that_may_all_close_are_refused() -> None:
    """The same wall twice is still refused, and so is a row whose walls are at one place."""
    x, y = hs.State("x", 0, "v"), hs.State("y", 0, "w")
    twice = [x, hs.State("v", 0, "p0 + p1")]
    shut = [x, hs.State("v", 0, "p0 - p1"), y, hs.State("w", 0, "p1 - p2")]
    for states, gaps in ((twice, ["x", "2*x"]), (shut, ["x", "y - x", "-y"])):
        impacts = [hs.Impact(f"p{k}", gap, 1) for k, gap in enumerate(gaps)]
        with pytest.raises(hs.ModelError, match="are not independent"):
            hs.simulate(hs.Model("same", states, impacts=impacts), (0, 1))
