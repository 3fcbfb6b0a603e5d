"""The multiple-precision run against closed forms that share nothing with it, and `dop853` against both."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.compare.errors_against_reference import Yardstick
from hybridsim.analysis.compare.resets import resets_of
from hybridsim.analysis.compare.trajectory import trajectory_of
from hybridsim.reference.multiple_precision import multiple_precision_trajectory
from hybridsim.reference.trajectory import Trajectory
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator

MP = mpmath.mp.clone()
MP.dps = 60


def times_of(trajectory: Trajectory) -> list[object]:
    """The instants at which the run was cut, in full precision."""
    return [segment.t for segment in trajectory.states.segments]


def nearest(instant: object, trajectory: Trajectory) -> object:
    return min(abs(instant - cut) for cut in times_of(trajectory))


@pytest.mark.parametrize(("ratio", "force"), [(0.6, 30.0), (0.64, 22.0), (1.4, 60.0)])
def test_the_published_points_against_their_closed_form(ratio: float, force: float) -> None:
    """P1 and P2 of He et al. 2026, doi:10.3390/sym18010057, and an orbit that never stops, for four periods."""
    model = hs.load("dfcs").with_(omega=f"{ratio}*sqrt(k/m)", N=40, F0=force)
    p = model.parameter_values()
    friction = MP.mpf(p["mu"]) * MP.mpf(p["N"])
    exact = Oscillator(
        p["m"], p["c"], p["k"], friction, friction, p["F0"], p["omega"], multiprecision(60)
    ).run(0, 0.06, 0)
    run = multiple_precision_trajectory(model, (0, 0.06))
    assert [event.target for event in run.events] == [
        {1: "slip+", -1: "slip-", 0: "stick"}[change.mode] for change in exact.changes
    ]
    for change in exact.changes:
        assert nearest(change.t, run) < 1e-35
    for t in np.linspace(0, 0.06, 23):
        for ours, theirs in zip(run.states.state(t), exact.state(t)[:2], strict=True):
            assert abs(ours - theirs) < MP.mpf("1e-32")


def test_free_decay_against_the_half_swings_of_den_hartog() -> None:
    """Each half swing takes pi*sqrt(m/k) and 2*mu*N/k off the amplitude (Den Hartog, Mechanical Vibrations, 1956)."""
    run = multiple_precision_trajectory(hs.load("free-decay"), (0, 20))
    friction = MP.mpf(0.1) * 10
    amplitude = MP.mpf(10.5)
    for half_swing in range(1, 6):
        amplitude -= 2 * friction
        x, v = run.states.state(half_swing * MP.pi)
        assert abs(x - (-1) ** half_swing * amplitude) < 1e-30
        assert abs(v) < 1e-30
    assert [event.target for event in run.events] == ["slip+", "slip-", "slip+", "slip-", "stick"]
    assert nearest(5 * MP.pi, run) < 1e-30
    at_rest = run.states(np.array([5 * np.pi + 0.01, 17.0, 20.0]), "+")
    assert (at_rest[1] == 0).all() and len(set(at_rest[0])) == 1


def test_the_bouncing_ball_against_its_parabolas() -> None:
    model = hs.load("bouncing-ball")
    p = model.parameter_values()
    g, e = MP.mpf(p["g"]), MP.mpf(p["e"])
    run = multiple_precision_trajectory(model, (0, 3))
    speed, t, impacts = MP.sqrt(2 * g), MP.sqrt(2 / g), []
    while speed * e >= p["v_rest"]:
        speed, impacts = speed * e, [*impacts, t]
        t += 2 * speed / g
    impacts.append(t)
    assert [event.t for event in run.events] == [float(t) for t in impacts]
    assert [event.target for event in run.events] == ["flight"] * (len(impacts) - 1) + ["rest"]
    first = float(impacts[0])
    assert run.states(np.array([first]), "-")[1, 0] == float(-MP.sqrt(2 * g))
    assert run.states(np.array([first]), "+")[1, 0] == float(e * MP.sqrt(2 * g))
    assert (run.states(np.array([2.9, 3.0]), "+") == 0).all()


def test_the_pulled_slider_against_its_harmonic_slips() -> None:
    """In stick the spring grows at v_pull; a slip is harmonic and ends where v is zero again.

    With y = e - mu_k N/k, w^2 = k/m, A = (mu_s - mu_k) N/k: y = A cos(w s) + (v_pull/w) sin(w s), and v = 0 is
    -A w sin(w s) + v_pull cos(w s) = v_pull, that is w s = 2 (pi - atan(A w/v_pull)).
    """
    model = hs.load("static-kinetic")
    p = {name: MP.mpf(value) for name, value in model.parameter_values().items()}
    w, limit = MP.sqrt(p["k"] / p["m"]), p["mu_s"] * p["N"]
    a = (p["mu_s"] - p["mu_k"]) * p["N"] / p["k"]
    release = limit / (p["k"] * p["v_pull"])
    duration = 2 * (MP.pi - MP.atan(a * w / p["v_pull"])) / w
    # the slip is symmetric about its middle: it ends as far below mu_k N/k as it began above
    again = 2 * a / p["v_pull"]
    expected = [release, release + duration, release + duration + again, release + 2 * duration + again]
    run = multiple_precision_trajectory(model, (0, 7))
    assert [event.target for event in run.events] == ["slip+", "stick"] * 2
    for instant in expected:
        assert nearest(instant, run) < 1e-30


def test_the_belt_sticks_at_its_speed_exactly_and_repeats_itself() -> None:
    """Period 12.0 (Leine et al. 1998, doi:10.1023/A:1008289604683); stick ends at x = Fs/k = 1 and erases the past."""
    model = hs.load("belt")
    run = multiple_precision_trajectory(model, (0, 40))
    releases = [event.t for event in run.events if event.source == "stick"]
    assert releases[-1] - releases[-2] == pytest.approx(12.0, abs=0.05)
    cuts = {float(cut): cut for cut in times_of(run)}
    exact = [cuts[t] for t in releases]
    assert all(abs(run.states.state(t, "-")[0] - 1) < 1e-30 for t in exact)
    periods = [b - a for a, b in itertools.pairwise(exact[-3:])]
    assert abs(periods[0] - periods[1]) < 1e-28
    stops = [event.t for event in run.events if event.target == "stick"]
    inside = np.linspace(stops[0], releases[-2], 50)[:3]
    assert (run.states(inside, "+")[1] == model.parameter_values()["v_belt"]).all()


def test_two_blocks_that_stick_to_each_other_are_released_where_their_contact_can_carry_no_more() -> None:
    """Pushed by 1 + t they move as one with (1 + t)/3; block 1 needs that force, and its contact carries 1."""
    model = hs.Model.from_toml(
        """
        schema = 1
        name = "stack"
        [states]
        v1 = { start = 0, der = "f" }
        v2 = { start = 0, der = "(1 + t - f)/2" }
        [contacts.f]
        velocity = "v2 - v1"
        normal = "1"
        law = { name = "coulomb", mu = 1 }
        """
    )
    run = multiple_precision_trajectory(model, (0, 3))
    assert [(event.source, event.target) for event in run.events] == [("stick", "slip+")]
    assert nearest(MP.mpf(2), run) < 1e-35
    together = run.states(np.linspace(0, 2, 21), "-")
    assert (together[0] == together[1]).all()
    t = MP.mpf(3)
    v1, v2 = run.states.state(t)
    assert abs(v1 - (MP.mpf(4) / 3 + 1)) < 1e-35
    assert abs(v2 - (MP.mpf(4) / 3 + (t**2 / 2 - 2) / 2)) < 1e-35


@pytest.mark.parametrize(("name", "end", "period"), [("belt", 40.0, 12.0), ("dfcs-stribeck", 0.04, 0.0148)])
def test_dop853_agrees(name: str, end: float, period: float) -> None:
    """At rtol 1e-12 the states differ by less than 1e-8 of their amplitudes, event times by 1e-9 of a period."""
    model = hs.load(name)
    truth = Yardstick(
        multiple_precision_trajectory(model, (0, end), digits=24), resets_of(model), [1, 1], None
    )
    errors = truth.measure(trajectory_of(hs.simulate(model, (0, end), integrator="dop853", rtol=1e-12)))
    assert errors.sequence.right
    assert errors.state < 1e-8
    assert errors.event_time is not None and errors.event_time < 1e-9 * period


def test_more_digits_are_more_digits() -> None:
    """The same run with 24, 32 and 48 digits: each agrees with the next to its own digits, but for a few."""
    model = hs.load("dfcs-stribeck")
    states = {
        digits: multiple_precision_trajectory(model, (0, 0.005), digits=digits).states.state(0.005)
        for digits in (24, 32, 48)
    }
    for digits in (24, 32):
        for x, better, size in zip(states[digits], states[48], (1e-4, 0.1), strict=True):
            assert abs(MP.mpf(x) - better) < size * MP.mpf(10) ** -(digits - 3)
