"""Inside their regions of step and zone approximate methods are right; outside they are wrong for the reason told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs

DFCS = hs.load("dfcs")
P = DFCS.parameter_values()
PERIOD = 2 * math.pi / P["omega"]
LIMIT = P["mu"] * P["N"]
OSCILLATOR = Oscillator(P["m"], P["c"], P["k"], LIMIT, LIMIT, P["F0"], P["omega"])
MOTION = OSCILLATOR.run(0, 62 * PERIOD, 0)
AMPLITUDE = MOTION.amplitude(60 * PERIOD, 62 * PERIOD)
SPEED = max(abs(MOTION.state(t)[1]) for t in np.linspace(60, 61, 4001) * PERIOD)
STICKS = [c for c in MOTION.changes if c.mode == 0 and c.t > 59 * PERIOD]
TOLERATED = 0.01
READ = 10  # periods at the end of a run


def steady(model: hs.Model, steps: float, **options) -> hs.Solution:
    """The last ten of forty periods of a run that starts on the exact motion."""
    x0 = [float(value) for value in MOTION.state(60 * PERIOD)[:2]]
    sol = hs.simulate(model, (0, 40 * PERIOD), x0=x0, step=PERIOD / steps, keep=READ * PERIOD, **options)
    assert sol.success, sol.message
    return sol


def error(sol: hs.Solution) -> float:
    """Of the amplitude of the worst period, relative to that of the closed form."""
    x = sol(np.linspace(sol.t_start, sol.t_end, READ * 1000 + 1))[0][:-1].reshape(READ, 1000)
    errors = np.ptp(x, axis=1) / 2 / AMPLITUDE - 1
    return float(errors[np.argmax(np.abs(errors))])


def dichotomy(steps: float, share: float, stick_velocity: str) -> hs.Solution:
    options = {"eps_v": share * SPEED, "stick_velocity": stick_velocity}
    return steady(DFCS, steps, integrator="rk4-dichotomy", **options)


def regularised(kind: str, steps: float, share: float) -> hs.Solution:
    """By RK4: without contacts nothing else is left of rk4-sign."""
    options = {"z0": {"f": "stick"}} if kind == "karnopp" else {}
    return steady(DFCS.regularized(kind, v0=share * SPEED), steps, integrator="rk4-sign", **options)


def test_velocity_zeroed_stops_early_by_the_square_of_the_zone() -> None:
    """A stop from eps is eps^2/(2 a) short: 1 % of the amplitude at 15 % of the speed, and four times for twice."""
    assert abs(error(dichotomy(400, 0.05, "zero"))) < TOLERATED / 5
    narrow, wide = (error(dichotomy(4000, share, "zero")) for share in (0.12, 0.24))
    assert -TOLERATED < narrow < 0
    assert wide < -TOLERATED
    assert 3.5 < wide / narrow < 4.5


def test_velocity_zeroed_holds_falsely_beyond_the_largest_speed() -> None:
    """With the zone as wide as the speed the body is held as soon as the applied force can be: it never slows down."""
    sol = dichotomy(1200, 1.0, "zero")
    assert error(sol) < -0.5
    events = [e for e in sol.events if e.target == "stick"]
    held = np.array([abs(sol(e.t - PERIOD / 600)[1]) for e in events])
    assert (held > 0.9 * np.abs(sol.y[1]).max()).all()


def test_velocity_kept_creeps_through_its_sticks() -> None:
    """It is 1 % off where zeroing the velocity, and nothing else, makes it right; the stuck body moves all the time."""
    assert abs(error(dichotomy(1200, 0.002, "kept"))) < TOLERATED
    kept, zeroed = (dichotomy(1200, 0.03, way) for way in ("kept", "zero"))
    assert error(kept) > 2 * TOLERATED
    assert abs(error(zeroed)) < TOLERATED / 10
    for sol, creeps in ((kept, True), (zeroed, False)):
        sticks = [i for i in sol.modes["f"] if i.mode == "stick"][1:-1]
        moved = [abs(sol(i.t1, side="-")[0] - sol(i.t0)[0]) / (i.t1 - i.t0) for i in sticks]
        assert all((rate > 0.2 * 0.03 * SPEED) == creeps for rate in moved)


@pytest.mark.parametrize("stick_velocity", ["zero", "kept"])
def test_a_long_step_misses_stops(stick_velocity: str) -> None:
    """Eight steps a period and a zone that 16 halvings do not reach: fewer stops than the two of each period."""
    stops = {
        (steps, share): sum(e.target == "stick" for e in dichotomy(steps, share, stick_velocity).events)
        for steps, share in ((8, 1e-7), (200, 1e-3))
    }
    assert len({round(s.t / PERIOD % 1, 3) for s in STICKS}) == 2  # of the closed form
    assert stops[200, 1e-3] == 2 * READ
    assert stops[8, 1e-7] < 2 * READ


def test_the_bare_sign_is_of_first_order() -> None:
    """Wrong at 100 steps a period, right at 1000; over two decades of the step the order is one, within a quarter.

    Its chatter is not periodic, so that no closer law holds from step to step.
    """
    coarse, middle, fine = (abs(error(steady(DFCS, n, integrator="rk4-sign"))) for n in (100, 1000, 10000))
    assert coarse > TOLERATED
    assert fine < middle < TOLERATED
    assert 0.75 < math.log10(coarse / fine) / 2 < 1.25


def test_tanh_creeps_and_is_unstable_beyond_the_limit_of_rk4() -> None:
    """A width of 5 % is wrong at any step; one of 0.05 % is right where h < 2.785 m v0/(mu N).

    With four times that step the velocity zigzags through what should be stick, and with fifty times the amplitude is
    wrong: the force is bounded, and so is what chatter does.
    """
    assert abs(error(regularised("tanh", 4000, 0.05))) > TOLERATED
    width = 5e-4
    stable = LIMIT / (P["m"] * width * SPEED) * PERIOD / 2.785  # steps a period at that limit
    calm, restless, coarse = (regularised("tanh", n * stable, width) for n in (1.2, 0.25, 0.02))
    assert abs(error(calm)) < TOLERATED
    assert abs(error(coarse)) > TOLERATED
    turns = [np.count_nonzero(np.diff(np.sign(np.diff(sol.y[1])))) / READ for sol in (calm, restless)]
    assert turns[0] < 6
    assert turns[1] > 50


def test_karnopp_stops_early_like_the_zeroed_velocity() -> None:
    """The band is entered at v0, and what is left of the way is not gone: the square of the width again."""
    assert abs(error(regularised("karnopp", 100, 0.03))) < TOLERATED / 5
    narrow, wide = (error(regularised("karnopp", 400, share)) for share in (0.12, 0.24))
    assert -TOLERATED < narrow < 0
    assert wide < -TOLERATED
    assert 3.5 < wide / narrow < 4.5
