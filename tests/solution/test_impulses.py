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
