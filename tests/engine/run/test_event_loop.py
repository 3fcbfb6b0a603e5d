"""The compiled mode loop: first exits of polynomials against known roots, compiled runs against the general way."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN, first_exit, to_bernstein
from hybridsim.engine.run import mode_loop
from hybridsim.integrators.taylor.method import Taylor
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.measuring import load
from hybridsim.testing.scene import Scene

PERIOD = 2 * math.pi / hs.load("dfcs").parameter_values()["omega"]
# How many crossings of `twisting` are told apart before their limit is chance; `long-swing` is seen at zeros of
# v alone, which have no scale. Both are judged by their truths, as all scenes are.
SAME_TO_ROUNDING = [s for s in SCENES if "stiff" not in s.needs and s.name not in ("twisting", "long-swing")]


def exit_of(a: list[float], error: float = 1e-14, order: int = 0, floor: float = 0.0) -> tuple[int, float]:
    values = np.array(a)
    outcome, theta = first_exit(values, error, floor, order, np.empty(len(a)), np.empty((64, len(a) + 2)), 0)
    return int(outcome), float(theta)


def from_roots(roots: list[Fraction], degree: int) -> list[Fraction]:
    """Coefficients of a product of (1 - theta/root), padded to a degree."""
    a = [Fraction(1)]
    for root in roots:
        shifted = [Fraction(0), *(-c / root for c in a)]
        a = [x + y for x, y in zip([*a, Fraction(0)], shifted, strict=True)]
    return a + [Fraction(0)] * (degree + 1 - len(a))


def test_bernstein_coefficients() -> None:
    """Against the sum that defines them, in fractions."""
    draw = random.Random(1)
    a = [Fraction(draw.randint(-99, 99)) for _ in range(9)]
    expected = [
        sum(Fraction(math.comb(j, k), math.comb(8, k)) * a[k] for k in range(j + 1)) for j in range(9)
    ]
    b = np.empty(9)
    to_bernstein(np.array([float(c) for c in a]), b)
    assert b == pytest.approx([float(c) for c in expected], rel=1e-13, abs=1e-12)


def test_first_roots_of_random_polynomials() -> None:
    """Up to five roots in and around the step, pairs among them; the first one inside is where the sign goes."""
    draw = random.Random(2)
    missed = 0
    for _ in range(3000):
        roots = sorted(Fraction(draw.uniform(0.02, 1.7)) for _ in range(draw.randint(0, 5)))
        if len(roots) > 1 and draw.random() < 0.3:
            roots[1] = roots[0] + Fraction(draw.choice([1e-2, 1e-4, 1e-6]))
        roots.sort()
        a = from_roots(roots, 8)
        inside = [root for root in roots if root < 1]
        outcome, theta = exit_of([float(c) for c in a], error=1e-15)
        if not inside:
            assert outcome in (NEVER, OPEN)
            missed += outcome == OPEN
        elif outcome == FOUND:
            # an ill-conditioned root moves by the rounding of the coefficients over the slope there
            slope = abs(float(sum(k * a[k] * inside[0] ** (k - 1) for k in range(1, 9))))
            size = sum(abs(float(c)) for c in a)
            assert theta == pytest.approx(float(inside[0]), abs=1e-13 + 4e-15 * size / slope)
        else:
            assert outcome == OPEN  # a pair closer than the bound: said, not missed
            missed += 1
    assert missed < 150


def test_a_zero_by_decree_is_not_found_again() -> None:
    """p = theta**2 (1 - theta/0.4) begins at zero, whatever rounding made of its first coefficients."""
    a = [1e-17, -2e-17, 1.0, -2.5, 0.0]
    assert exit_of(a, order=2) == (FOUND, pytest.approx(0.4, rel=1e-14))
    assert exit_of([1e-17, -2e-17, 1.0, 0.5, 0.0], order=2)[0] == NEVER
    assert exit_of([-1e-17, 1.0, -1.0 + 1e-3, 0.0], order=1)[0] == NEVER


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("at", [0.5, 0.1, 0.01])
def test_what_is_zero_by_decree_shifts_all_that_follows(order: int, at: float) -> None:
    """p = theta**order ((theta - at)**2 + depth), and a residual at its begin that may take all of it below zero.

    A residual of 1e-12 is one of 1e-12/theta**order beside the square: a dip that it may hide is open, others pass.
    """
    for depth in (4.0 * at**-order, 0.25 * at**-order):
        depth *= 1e-12
        q = [at * at + depth, -2.0 * at, 1.0]
        outcome, theta = exit_of([0.0] * order + q + [0.0] * 3, 1e-15, order, floor=1e-12)
        if depth > 2e-12 * at**-order:
            assert outcome == NEVER
        else:
            assert outcome == OPEN
            assert theta == pytest.approx(at, abs=2.0 * math.sqrt(1e-12 * at**-order))


def test_a_touch_is_said() -> None:
    outcome, theta = exit_of([0.25, -1.0, 1.0, 0.0, 0.0])  # (theta - 1/2)**2
    assert outcome == OPEN
    assert theta == pytest.approx(0.5, abs=1e-6)


@pytest.fixture
def general(monkeypatch: pytest.MonkeyPatch):
    """Runs with every segment taken the general way."""

    def run(*args, **options):
        with monkeypatch.context() as patch:
            patch.setattr(Taylor, "has_compiled_loop", False)
            return hs.simulate(*args, **options, integrator="taylor")

    return run


@pytest.mark.parametrize("scene", SAME_TO_ROUNDING, ids=lambda scene: scene.name)
def test_the_compiled_loop_and_the_general_way(scene: Scene, general) -> None:
    """The same events to the order, times and states to rounding."""
    settings = {"params": dict(scene.params), "x0": dict(scene.start), "rtol": 1e-10, **scene.options}
    kernel_run = hs.simulate(load(scene), scene.span, integrator="taylor", **settings)
    stepped = general(load(scene), scene.span, **settings)
    assert kernel_run.status == stepped.status
    assert [(e.kind, e.component, e.guard, e.source, e.target) for e in kernel_run.events] == [
        (e.kind, e.component, e.guard, e.source, e.target) for e in stepped.events
    ]
    times = [[e.t for e in sol.events] for sol in (kernel_run, stepped)]
    assert times[0] == pytest.approx(times[1], rel=1e-9, abs=1e-9 * scene.unit)
    grid = np.linspace(*sorted((scene.span[0], min(kernel_run.t_end, stepped.t_end))), 201)
    size = np.max(np.abs(stepped(grid)), axis=1, initial=0.0)[:, None]
    assert np.max(np.abs(kernel_run(grid) - stepped(grid)) / (size + 1e-300), initial=0.0) < 1e-7
    assert list(kernel_run.modes) == list(stepped.modes)
    assert [i.mode for c in kernel_run.modes.values() for i in c] == [
        i.mode for c in stepped.modes.values() for i in c
    ]


def test_the_reference_model_is_one_compiled_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """401 events in a hundred periods, not one of them by the general way."""
    taken = []
    segment_run = mode_loop.SegmentRun
    monkeypatch.setattr(mode_loop, "SegmentRun", lambda *args: taken.append(args) or segment_run(*args))
    sol = hs.simulate("dfcs", (0, 100 * PERIOD), integrator="taylor", rtol=1e-12)
    assert len(sol.events) == 401
    assert not taken


@pytest.mark.parametrize(("r", "ratio"), [(1.103, 0.96)])
def test_a_motion_that_settles_is_no_series_that_accumulates(
    r: float, ratio: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # next to resonance the intervals between events shrink by one factor, by a few thousandths each
    runs: list[object] = []
    segment_run = mode_loop.SegmentRun
    monkeypatch.setattr(mode_loop, "SegmentRun", lambda *a: runs.append(a) or segment_run(*a))
    model = hs.load("dfcs").with_(N=40, F0=40 * ratio, omega=f"{r}*sqrt(k/m)")
    period = 2 * math.pi / model.parameter_values()["omega"]
    sol = hs.simulate(model, (0.0, 40 * period), integrator="exact")
    gaps = np.diff(sol.event_times("f"))
    falls = gaps[1:] / gaps[:-1]
    assert ((falls[3:13] < 0.9995) & (falls[3:13] > 0.99)).all()
    assert not runs


def test_more_steps_and_segments_than_there_is_room_for() -> None:
    """Calls follow each other where the arrays of one are full."""
    sol = hs.simulate("dfcs", (0, 600 * PERIOD), integrator="taylor", rtol=1e-12)
    assert len(sol.events) == 2401
    times = np.array([e.t for e in sol.events[-400:]])
    assert np.diff(times[::4]) == pytest.approx(np.full(99, PERIOD), rel=1e-9)


def test_output_is_exact_in_stick() -> None:
    sol = hs.simulate("belt", (0, 100), integrator="taylor", rtol=1e-12)
    for interval in sol.modes["f"]:
        if interval.mode == "stick":
            assert (sol(np.linspace(interval.t0, np.nextafter(interval.t1, 0), 50))[1] == 0.2).all()


@pytest.mark.parametrize(
    ("guard", "time"),
    [
        ("0.5 - tanh(50*(x - 1))", 1 + math.atanh(0.5) / 50),
        ("1 - exp(1000*(x - 5))", 5.0),
        ("1 - exp(100*(x - 1))", 1.0),
        ("2 - x**50", 2 ** (1 / 50)),
        ("1/(1 + x**12) - 0.01", 99 ** (1 / 12)),
        ("cos(x**4)", (math.pi / 2) ** 0.25),
        ("cos(x**8) + 0.5", (2 * math.pi / 3) ** 0.125),
    ],
)
@pytest.mark.parametrize("rtol", [1e-9, 1e-12])
def test_guards_whose_series_say_nothing_of_what_comes(guard: str, time: float, rtol: float) -> None:
    """Saturated, gapped or growing series: the guard itself is looked at where a step ends."""
    model = hs.Model(
        "still",
        states=[hs.State("x", 0, "1")],
        components=[
            hs.Component(
                "c", modes=[hs.Mode("a", guards=[hs.Guard("g", guard, then="b")]), hs.Mode("b")], initial="a"
            )
        ],
    )
    sol = hs.simulate(model, (0, 8), integrator="taylor", rtol=rtol)
    assert [event.t for event in sol.events] == pytest.approx([time], rel=1e-9)
