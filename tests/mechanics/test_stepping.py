"""Mechanical systems by time stepping: closed forms, runs that locate events, the balance of energy, many impacts."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

STEPS = 4  # neighbouring steps, over which an error is averaged: where in a step an impact falls is chance


def errors(system: hs.MechanicalSystem, end: float, steps: int, truth: np.ndarray) -> np.ndarray:
    """Largest error of positions, and mean error of velocities, relative, for three steps, each a quarter."""
    times, scale = np.linspace(0, end, truth.shape[1]), np.abs(truth).max(axis=1)[:, None]
    found = np.zeros((3, 2))
    for level in range(3):
        for k in range(STEPS):
            step = end / (steps * 4**level * (1 + k / STEPS))
            sol = hs.simulate(system, (0, end), integrator="moreau", step=step)
            assert (sol.status, sol.warnings) == ("finished", ())
            off = np.abs(sol(times) - truth) / scale
            found[level] += np.array([off[: system.n].max(), off[system.n :].mean(axis=1).max()]) / STEPS
    return found


def orders(found: np.ndarray) -> np.ndarray:
    """The exponents with which errors fall with the step."""
    return -np.polyfit(np.arange(3), np.log(found), 1)[0] / math.log(4.0)


def stored(system: hs.MechanicalSystem, x: np.ndarray) -> float:
    """Kinetic and elastic energy."""
    q, v = np.split(x, 2)
    return float(0.5 * v @ (system.M @ v) + 0.5 * q @ (system.K @ q))


def ball(e: float, height: float = 1.0) -> hs.MechanicalSystem:
    stop = hs.MechanicalImpact("p", [1.0], 0.0, e)
    return hs.MechanicalSystem([2.0], None, None, [-2.0 * 9.81], impacts=[stop], q0=[height])


def three_blocks() -> hs.MechanicalSystem:
    """A chain on a belt: the first and the last block rub, the middle one hits the last."""
    law = {"mu": 1.0, "delta": 3.0}
    rub = [hs.MechanicalContact(f"f{i}", {i: 1.0}, 1.0, "hyperbolic", law, 0.2) for i in (0, 2)]
    hit = hs.MechanicalImpact("p", {1: -1.0, 2: 1.0}, 0.15, 0.6)
    return hs.MechanicalSystem(
        np.ones(3),
        None,
        hs.chain_on_belt(3).K,
        None,
        rub,
        impacts=[hit],
        q0=[0.4, -0.3, -0.3],
        v0=[0, 0.5, 0],
    )


def test_first_order_against_a_model_whose_impacts_are_located() -> None:
    system, end = three_blocks(), 8.0
    reference = hs.simulate(system.to_model(), (0, end), integrator="taylor", rtol=1e-11)
    assert len(reference.event_times("p")) == 2
    truth = reference(np.linspace(0, end, 32001))[[0, 2, 4, 1, 3, 5]]
    found = errors(system, end, 400, truth)
    assert (orders(found) > 0.85).all()
    assert (found[-1] < 1.5e-3).all()


def test_first_order_against_the_run_that_locates_stick_and_slip() -> None:
    system = hs.chain_on_belt(6)
    reference = hs.simulate(system, (0, 10), rtol=1e-11)
    assert len(reference.events) > 10
    found = errors(system, 10, 500, reference(np.linspace(0, 10, 8001)))
    assert (orders(found) > 0.85).all()
    assert (found[-1] < 3e-3).all()


def test_it_agrees_with_time_stepping_of_the_ordinary_model() -> None:
    """The same scheme by other code: matrices in place of differences of a flow, all impulses in one sparse problem."""
    system = three_blocks()
    one = hs.simulate(system, (0, 4), integrator="moreau", step=2e-3)
    other = hs.simulate(system.to_model(), (0, 4), integrator="moreau", step=2e-3)
    assert one.stats["bounces"] > 0
    # the model takes the gap of what is closed as zero, and there is none here
    assert one.y[:, -1] == pytest.approx(other.y[[0, 2, 4, 1, 3, 5], -1], abs=1e-8)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
def test_a_ball_comes_to_rest_at_the_limit_of_its_bounces(e: float) -> None:
    limit, step = math.sqrt(2 / 9.81) * (1 + e) / (1 - e), 1e-4
    sol = hs.simulate(ball(e), (0, 10), integrator="moreau", step=step)
    (event,) = sol.events
    assert (event.component, event.source, event.target) == ("p", "open", "closed")
    assert abs(event.t - limit) < (2 / (1 - e) + 15) * step
    assert [i.mode for i in sol.modes["p"]] == ["open", "closed"]
    at_rest = sol.t > event.t + 1.5 * step
    assert np.ptp(sol.y[0, at_rest]) < 1e-15
    assert np.abs(sol.output("gap(p)")[at_rest]).max() < math.sqrt(2 * 9.81) * step
    assert sol.output("p", 9.0) == pytest.approx(2 * 9.81, rel=1e-12)
    assert sol.work["impacts"] == pytest.approx(-2 * 9.81, rel=1e-3)  # all of it, since it ends at rest


def test_balls_that_touch_are_struck_together() -> None:
    """Three equal ones, e = 1: the law sends the first back with 1/3 of its speed and the others on with 2/3."""
    hits = [hs.MechanicalImpact(f"p{i}", {i: -1.0, i + 1: 1.0}, 0.0, 1.0) for i in range(2)]
    system = hs.MechanicalSystem(np.ones(3), None, None, impacts=hits, q0=[-0.5, 0, 0], v0=[1, 0, 0])
    sol = hs.simulate(system, (0, 1), integrator="moreau", step=1e-3)
    assert sol(1.0)[3:] == pytest.approx([-1 / 3, 2 / 3, 2 / 3], rel=1e-9)
    assert sol.work["impacts"] == pytest.approx(0.0, abs=1e-12)


def test_a_block_that_slides_into_another_sets_it_off() -> None:
    """Friction and the impact on the same blocks: from v0 to the hit, then both slide to rest."""
    g_mu, e, way = 0.3, 0.5, 1.0
    rub = [hs.MechanicalContact(f"f{i}", {i: 1.0}, 1.0, "coulomb", {"mu": g_mu}) for i in range(2)]
    hit = hs.MechanicalImpact("p", {0: -1.0, 1: 1.0}, way, e)
    system = hs.MechanicalSystem(np.ones(2), None, None, None, rub, impacts=[hit], v0=[2.0, 0.0])
    speed = math.sqrt(4.0 - 2 * g_mu * way)
    after = speed * np.array([1 - e, 1 + e]) / 2
    rest = np.array([way, 0.0]) + after**2 / (2 * g_mu)
    late = []
    for step in (4e-3, 1e-3, 2.5e-4):
        sol = hs.simulate(system, (0, 8), integrator="moreau", step=step)
        assert [i.mode for i in sol.modes["f1"]][-2:] == ["slip+", "stick"]
        assert (sol.y[2:, -1] == 0.0).all()
        assert (sol.y[:2, -1] == sol.y[:2, -200]).all()  # what sticks keeps its place bit for bit
        late.append(np.abs(sol.y[:2, -1] - rest).max())
    assert late[-1] < 1e-3
    assert late[0] / late[-1] > 8


@pytest.mark.parametrize("theta", [0.5, 0.7])
def test_works_add_up_to_what_is_stored(theta: float) -> None:
    """Whatever happens in the steps; with theta above 1/2 the scheme itself takes some out."""
    n = 40
    chain = hs.chain_on_belt(n, gap=0.2, spread=0.09, coupling=0.5)
    system = chain.with_(C=np.full(n, 0.05), forcing={0: hs.Harmonic(1.3, sin=0.5, cos=0.2), 7: 0.1})
    sol = hs.simulate(system, (0, 20), integrator="moreau", step=5e-3, theta=theta)
    assert sol.stats["bounces"] > 20
    gained, works = stored(system, sol.x_end) - stored(system, sol(0.0)), sol.work
    missing = sum(works.values()) - gained
    assert works["damping"] < 0 and works["friction"] < 0 and works["impacts"] < 0 < works["bases"]
    if theta == 0.5:
        assert missing == pytest.approx(0.0, abs=1e-11 * works["bases"])
    else:
        assert missing > 1e-6 * works["bases"]


def test_a_thousand_blocks_that_collide() -> None:
    chain = hs.chain_on_belt(1000, gap=0.1, spread=0.049)
    chain = chain.with_(v0=np.random.default_rng(2).uniform(-0.4, 0.4, 1000))
    sol = hs.simulate(chain, (0, 4), integrator="moreau", step=4e-3)
    assert (sol.status, sol.warnings) == ("finished", ())
    assert sol.stats["bounces"] > 200
    assert sol.stats["residual"] <= 1e-12
    works = sol.work
    gained = stored(chain, sol.x_end) - stored(chain, sol(0.0))
    assert sum(works.values()) == pytest.approx(gained, abs=1e-11 * works["bases"])
    assert works["friction"] < 0 and works["impacts"] < 0
    gaps = np.diff(sol.y[:1000], axis=0) + 0.1
    closing = -np.diff(sol.y[1000:], axis=0)
    # g > h u/2 where a step begins that the gap takes part in, or it would have before; then g grows by h (u + e |u|)/2
    assert gaps.min() > -0.75 * 4e-3 * closing.max()


def test_what_is_kept_and_asked_for() -> None:
    system = three_blocks()
    whole = hs.simulate(system, (0, 4), integrator="moreau", step=1e-3)
    grid = hs.simulate(system, (0, 4), integrator="moreau", step=1e-3, t_eval=[0.0, 1.2345, 4.0])
    assert (grid.y == whole([0.0, 1.2345, 4.0])).all()
    events = hs.simulate(system, (0, 4), integrator="moreau", step=1e-3, keep="events")
    assert [e.t for e in events.events] == [e.t for e in whole.events]
    assert (events.x_end == whole.y[:, -1]).all()
    assert (
        hs.simulate(system, (0, 4), integrator="moreau", step=1e-3, keep="nothing").x_end == events.x_end
    ).all()
    with pytest.raises(hs.UsageError, match="no states"):
        events(1.0)
    with pytest.raises(hs.UsageError, match="'v_rel"):
        whole.output("v_rel(f9)")
    assert whole.output("v_rel(f0)", 0.0) == -0.2
    assert whole.output("q2", 0.0) == -0.3
    sliding = next(i for i in whole.modes["f0"] if i.mode == "slip-")
    t = 0.5 * (sliding.t0 + sliding.t1)
    speed = abs(whole.output("v_rel(f0)", t))
    assert whole.output("f0", t) == pytest.approx(-1 / (1 + 3 * speed), rel=5e-3)
    assert f"bounces: {whole.stats['bounces']}" in repr(whole)


def test_a_forcing_gives_the_step_and_the_start_may_be_changed() -> None:
    system = hs.MechanicalSystem([1.0], None, [4.0], [hs.Harmonic(2 * math.pi, sin=1.0)])
    sol = hs.simulate(system, (0, 3), integrator="moreau", steps_per_period=400, x0={"q1": 0.1})
    assert sol.stats["steps"] == 1200
    w = 2 * math.pi
    a = 1 / (4 - w * w)
    exact = 0.1 * math.cos(6) - a * w / 2 * math.sin(6) + a * math.sin(3 * w)
    assert sol(3.0)[0] == pytest.approx(exact, abs=2e-5)
    with pytest.raises(hs.UsageError, match="no single forcing period"):
        hs.simulate(ball(0.5), (0, 1), integrator="moreau")


def test_what_cannot_be_run_is_refused() -> None:
    for integrator in ("auto", "taylor"):
        with pytest.raises(hs.UsageError, match="with impacts") as caught:
            hs.simulate(ball(0.5), (0, 1), integrator=integrator)
        assert "if the directions of its contacts and gaps are linearly independent" in str(caught.value)
    for options, named in (
        ({"step": -1.0}, "step"),
        ({"step": 0.1, "theta": 0.2}, "theta"),
        ({"rtol": 1e-3}, "rtol"),
    ):
        with pytest.raises(hs.UsageError, match=named):
            hs.simulate(ball(0.5), (0, 1), integrator="moreau", **options)
    with pytest.raises(hs.UsageError, match="max_step"):
        hs.simulate(ball(0.5), (0, 1), integrator="moreau", step=0.1, max_step=0.01)
    below = hs.simulate(ball(0.5, -0.1), (0, 1), integrator="moreau", step=0.1)
    assert below.status == "inconsistent" and "the gap of p is below zero" in below.message
    assert below.t.tolist() == [0.0]


def test_a_declaration_that_does_not_fit_is_refused() -> None:
    with pytest.raises(hs.UsageError, match=r"`restitution` cannot be 1\.5"):
        hs.MechanicalImpact("p", [1.0], 0.0, 1.5)
    with pytest.raises(hs.UsageError, match="`gap` cannot be 'wide'"):
        hs.MechanicalImpact("p", [1.0], "wide", 0.5)
    with pytest.raises(hs.UsageError, match="direction is zero"):
        hs.MechanicalImpact("p", [0.0], 0.0, 0.5)
    stop = hs.MechanicalImpact("p", {3: 1.0}, 0.0, 0.5)
    with pytest.raises(hs.UsageError, match="impact p: its direction has coordinate 3, but there are 2"):
        hs.MechanicalSystem([1, 1], None, None, impacts=[stop])
    rub = hs.MechanicalContact("p", {0: 1.0}, 1.0, "coulomb", {"mu": 0.1})
    with pytest.raises(hs.UsageError, match="impacts contain"):
        hs.MechanicalSystem([1, 1], None, None, impacts=[rub])
    with pytest.raises(hs.UsageError, match="the name 'p' is used twice"):
        hs.MechanicalSystem(
            [1, 1], None, None, None, [rub], impacts=[hs.MechanicalImpact("p", {1: 1.0}, 0, 0)]
        )
    with pytest.raises(hs.UsageError, match="below gap/2"):
        hs.chain_on_belt(3, gap=0.1)
