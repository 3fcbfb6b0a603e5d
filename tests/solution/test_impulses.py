"""An integral over time does not contain the impulses of impacts, so that it is refused for their forces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import hybridsim as hs

MASS, G, E, H = 0.5, 9.81, 0.6, 1.0


def ball(sliding: Sequence[hs.State] = (), contacts: Sequence[hs.Contact] = ()) -> hs.Model:
    """A ball that falls on the ground, with further states."""
    return hs.Model(
        "ball",
        parameters={"m": MASS, "e": E},
        states=[hs.State("z", H, "v"), hs.State("v", 0, "p/m - 9.81"), *sliding],
        contacts=contacts,
        impacts=[hs.Impact("p", gap="z", restitution="e")],
        outputs={"twice": "2*p", "weight": "9.81*m"},
    )


def test_the_integral_of_an_impact_force_is_refused_and_the_remedy_gives_the_impulse() -> None:
    sol = hs.simulate(ball(), (0, 1.0))
    for names in (["p"], ["twice"], ["v", "p"]):
        with pytest.raises(hs.UsageError, match=r"would omit impulses.*impact p"):
            sol.integral(*names)
    assert sol.integral("weight") == pytest.approx(9.81 * MASS, rel=1e-12)
    jumps = sol.event_states("p") - sol.event_states("p", side="-")
    closed_form = MASS * (1.0 + E) * np.sqrt(2.0 * G * H)
    # the impacts are at sqrt(2 H/G) = 0.452 s and sqrt(2 H/G) (1 + 2 E) = 0.993 s
    assert MASS * jumps[:, 1].sum() == pytest.approx(closed_form * (1.0 + E), rel=1e-9)


def test_an_impact_that_does_not_occur_has_no_impulses() -> None:
    assert hs.simulate(ball(), (0, 0.3)).integral("p") == 0.0


@pytest.mark.parametrize("reading", ["integral", "mean"])
def test_derivatives_of_the_integral_are_refused(reading: str) -> None:
    found = hs.sensitivities(hs.simulate(ball(), (0, 0.6)), ["e"])
    with pytest.raises(hs.UsageError, match=f"the {reading} of p would omit impulses"):
        found.of(reading, "p")


@pytest.mark.parametrize("normal, has_impulses", [("1", False), ("p", True)])
def test_only_friction_under_an_impact_force_has_impulses(normal: str, has_impulses: bool) -> None:
    model = ball(
        sliding=[hs.State("u", 1.0, "-f/m")],
        contacts=[hs.Contact("f", velocity="u", normal=normal, law="coulomb", arguments={"mu": 0.1})],
    )
    dissipated = hs.simulate(model, (0, 0.6)).dissipated
    assert ("impulses" in repr(dissipated)) == has_impulses


def test_unknown_kinds_of_events_are_refused() -> None:
    sol = hs.simulate(ball(), (0, 0.6))
    for read in (sol.event_times, sol.event_states):
        with pytest.raises(hs.UsageError, match="kind of events cannot be '-'"):
            read("p", "-")


def test_the_mean_of_an_impact_force_is_no_measure_of_a_sweep() -> None:
    swept = hs.sweep(ball(), {"e": [0.5]}, ["mean.twice", "maximum.z"], t_span=(0.0, 0.6))
    assert "would omit impulses" in swept.status[0]


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-rk45"])
def test_readings_count_the_impacts_and_sum_their_impulses(integrator: str) -> None:
    """The impacts are at 0.452 s and 0.993 s, with the speeds sqrt(2 G H) and E sqrt(2 G H)."""
    speed = np.sqrt(2.0 * G * H)
    readings, values = ["impacts.p", "impulse.p"], {"m": [0.5, 2.0]}
    swept = hs.sweep(ball(), values, readings, t_span=(0.0, 1.0), integrator=integrator)
    assert swept["impacts.p"].tolist() == [2.0, 2.0]
    expected = np.array([0.5, 2.0]) * (1.0 + E) * speed * (1.0 + E)
    assert swept["impulse.p"] == pytest.approx(expected, rel=1e-8)


def test_bodies_in_contact_share_the_impulse_of_a_collision() -> None:
    """A block of mass 3 strikes two blocks of mass 1 that touch: the momentum passes through both contacts.

    Newton's law for all contacts: the middle block leaves the contact q at rest or faster than it came.
    """
    states = [hs.State("x", -1, "u", nominal=1), hs.State("u", 2, "-p/3", nominal=1)]
    states += [hs.State("y", 0, "v", nominal=1), hs.State("v", 0, "p - q", nominal=1)]
    states += [hs.State("z", 0, "w", nominal=1), hs.State("w", 0, "q", nominal=1)]
    impacts = [hs.Impact("p", gap="y - x", restitution=0), hs.Impact("q", gap="z - y", restitution=0)]
    row = hs.Model("row", states=states, impacts=impacts)
    end = hs.simulate(row, (0, 1)).x_end
    found = hs.sweep(row, {"u": [2.0]}, ["impulse.p", "impulse.q", "impacts.p"], t_span=(0.0, 1.0))
    assert end[[1, 3, 5]] == pytest.approx([1.2, 1.2, 1.2])  # momentum 6 of the mass 5
    assert found["impulse.p"][0] == pytest.approx(3 * (2 - 1.2))
    assert found["impulse.q"][0] == pytest.approx(1.2)
    assert found["impacts.p"][0] == 1.0


def test_friction_in_an_impact_does_not_change_the_impulse_of_the_normal_force() -> None:
    model = ball(
        sliding=[hs.State("u", 10.0, "-f/m")],
        contacts=[hs.Contact("f", velocity="u", normal="p", law="coulomb", arguments={"mu": 0.1})],
    )
    found = hs.sweep(model, {"e": [E]}, ["impulse.p", "final.u"], t_span=(0.0, 0.6))
    impulse = MASS * (1.0 + E) * np.sqrt(2.0 * G * H)
    assert found["impulse.p"][0] == pytest.approx(impulse, rel=1e-8)
    assert found["final.u"][0] == pytest.approx(10.0 - 0.1 * impulse / MASS, rel=1e-8)


@pytest.mark.parametrize("reset", [{"z": 0.25}, {"v": -2}, {"v": "v - 1"}])
def test_an_impulse_beside_a_reset_is_refused(reset: dict[str, object]) -> None:
    """The reset at the instant of the impact changes a position, or the velocity that the impulse changes too."""
    falling = hs.Model(
        "falling",
        states=[hs.State("z", 1, "v"), hs.State("v", -1, "p")],
        impacts=[hs.Impact("p", gap="z", restitution=0.5)],
        schedules=[hs.Schedule("kick", times=[1.0], reset=reset)],
    )
    found = hs.sweep(falling, {"v": [-1.0]}, "impulse.p", t_span=(0.0, 1.5))
    assert "the impulse of p at t = 1 is unknown, because a reset" in found.status[0]


def test_separate_collisions_at_one_instant_have_their_own_impulses() -> None:
    two = hs.Model(
        "two",
        states=[
            hs.State("x", 1, "u"),
            hs.State("u", -1, "p"),
            hs.State("y", 2, "v"),
            hs.State("v", -2, "q/3"),
        ],
        impacts=[hs.Impact("p", gap="x", restitution=0.5), hs.Impact("q", gap="y", restitution=0.25)],
    )
    found = hs.sweep(two, {"u": [-1.0]}, ["impulse.p", "impulse.q"], t_span=(0.0, 1.5))
    assert found["impulse.p"][0] == pytest.approx(1.5) and found["impulse.q"][0] == pytest.approx(3 * 2.5)


def test_the_impulses_of_a_period() -> None:
    """A ball that a table strikes once in each period T gets the impulse m g T from it, and leaves with g T/2.

    The table then has the speed V = g T (1 - e)/(2 (1 + e)).
    """
    w, e, amplitude = 30.0, 0.3, 0.02
    period = 2.0 * np.pi / w
    phase = np.arccos(G * period * (1.0 - e) / (2.0 * (1.0 + e)) / (amplitude * w))
    before, speed = phase / w, -0.5 * G * period  # time of the first impact, and the speed there
    start = amplitude * np.sin(phase) - speed * before - 0.5 * G * before**2, speed + G * before
    table = hs.Model(
        "table",
        parameters={"w": w, "A": amplitude, "e": e},
        states=[hs.State("z", start[0], "v", nominal=0.1), hs.State("v", start[1], "p/2 - 9.81", nominal=1)],
        impacts=[hs.Impact("p", gap="z - A*sin(w*t)", restitution="e")],
    )
    found = hs.sweep(table, {"w": [w]}, ["impulse.p", "impacts.p", "residual"], after=20)
    assert found["residual"][0] < 1e-6 and found["impacts.p"][0] == 1.0
    assert found["impulse.p"][0] == pytest.approx(2.0 * G * period, rel=1e-6)


def test_a_discrete_state_at_the_end_is_a_reading() -> None:
    counted = hs.Model(
        "counted",
        states=[hs.State("x", 0, "1")],
        discrete=[hs.Discrete("n", 0)],
        schedules=[hs.Schedule("k", start=0.1, period=0.2, reset={"n": "n + 1"})],
    )
    found = hs.sweep(counted, {"x": [0.0, 1.0]}, ["final.n", "final.x"], t_span=(0.0, 1.0))
    assert found["final.n"].tolist() == [5.0, 5.0]
    assert found["final.x"] == pytest.approx([1.0, 2.0])
