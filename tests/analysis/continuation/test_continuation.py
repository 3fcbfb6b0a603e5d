"""Branches of periodic orbits: where they turn, what repels, and that each orbit closes by another integrator."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


def hardening(friction: float = 0.02) -> hs.Model:
    """A spring that stiffens, a little damping and friction: two motions that attract and one that repels."""
    return hs.Model(
        "hardening",
        parameters={"w": 0.8, "a": 0.3},
        states=[
            hs.State("x", start=0, der="v", nominal=1),
            hs.State("v", start=0, der="-0.1*v - x - x**3 - f + a*cos(w*t)", nominal=1),
        ],
        contacts=[hs.Contact("f", velocity="v", normal=friction, law="coulomb", arguments={"mu": 1})],
    )


@pytest.fixture(scope="module")
def branch() -> hs.Branch:
    return hs.continuation(hardening(), "w", (0.7, 2.0))


def test_it_turns_twice_and_repels_between(branch: hs.Branch) -> None:
    folds = [s for s in branch.special if s.kind == "fold"]
    assert len(folds) == 2
    unstable = np.flatnonzero(~branch.stable)
    assert unstable.min() - folds[0].index in (0, 1, 2)
    assert folds[1].index - unstable.max() in (-1, 0, 1)
    assert (np.diff(unstable) == 1).all()


def test_each_orbit_closes_by_another_integrator(branch: hs.Branch) -> None:
    for point in branch.points[:: len(branch.points) // 8]:
        start = point.orbit.start
        run = hs.simulate(
            hardening().with_(w=point.parameter), (0.0, 2.0 * np.pi / point.parameter), x0=start.x.tolist(),
            integrator="scipy-dop853", rtol=1e-12,
        )  # fmt: skip
        assert np.abs(run.y[:, -1] - start.x).max() < 1e-8


def test_the_upper_fold_is_where_a_slow_rise_of_the_frequency_falls_off(branch: hs.Branch) -> None:
    """A route of its own: the motion that attracts, followed until it is lost, from below the fold."""
    fold = max(s.parameter for s in branch.special if s.kind == "fold")

    def stays(w: float) -> bool:
        upper = [
            p
            for p in branch.points
            if p.stable and p.parameter < fold - 1e-3 and p.steady.amplitude["x"] > 1.0
        ]
        start = max(upper, key=lambda p: p.parameter).orbit.start.x.tolist()
        run = hs.simulate(
            hardening().with_(w=w),
            (0.0, 300.0 * 2.0 * np.pi / w),
            x0=start,
            keep="last-period",
            integrator="dop853",
        )
        return bool(np.abs(run.y[0]).max() > 1.0)

    assert stays(fold - 2e-4)
    assert not stays(fold + 2e-4)


def test_the_period_of_a_limit_cycle_is_followed() -> None:
    branch = hs.continuation("belt", "v_belt", (0.1, 0.3))
    for point in branch.points[::5]:
        period = hs.steady_state("belt", params={"v_belt": point.parameter}).period
        assert point.orbit.period == pytest.approx(period, rel=1e-9)
    assert {p.word for p in branch.points} == {("slip-", "stick")}


def test_bad_questions_are_refused() -> None:
    with pytest.raises(UsageError, match="'F1'"):
        hs.continuation("dfcs", "F1", (1, 2))
    with pytest.raises(UsageError, match="bounds"):
        hs.continuation("dfcs", "F0", (1, 2))
    with pytest.raises(UsageError, match="does not settle on a periodic orbit"):
        hs.continuation("free-decay", "mu", (0.05, 0.2))


def test_a_pitchfork_is_marked_where_it_is() -> None:
    """y = (sin t - cos t)/2 has the mean square 1/4: along x = 0 the multiplier is exp(2 pi (a - 3/4)) exactly."""
    model = hs.Model(
        "pitchfork",
        parameters={"a": 0.6},
        states=[hs.State("x", 0, "(a - 1 + y**2)*x - x**3"), hs.State("y", 0, "-y + sin(t)")],
    )
    found = hs.continuation(model, "a", (0.5, 0.95))
    (special,) = found.special
    assert special.kind == "branch point" and special.parameter == pytest.approx(0.75, abs=1e-3)
    assert (found.stable == (found.parameter < 0.75)).all()
    assert found.message == "it ends at a = 0.5 (the bound) and at a = 0.95 (the bound)"
    # beyond it the branch that crosses attracts what does not start on the symmetric one
    assert hs.steady_state(model, params={"a": 0.9}, x0={"x": 1e-3}).mean["x"] > 0.1


def test_a_fold_is_no_branch_point(branch: hs.Branch) -> None:
    assert "branch point" not in {special.kind for special in branch.special}


def test_a_thermostat_is_followed_over_its_first_starting_value() -> None:
    """The first orbit starts at T = 20, which those with hi < 20 do not pass; each has a period in closed form."""
    model = hs.Model(
        "room",
        parameters={"hi": 21.0},
        states=[hs.State("T", 15, "(5 + heat - T)/2", nominal=10)],
        components=[
            hs.Component(
                "heater",
                [
                    hs.Mode("on", hs.Guard("warm", "hi - T", "off"), set={"heat": 25}),
                    hs.Mode("off", hs.Guard("cold", "T - 19", "on"), set={"heat": 0}),
                ],
                initial="on",
            )
        ],
    )
    branch = hs.continuation(model, "hi", (19.2, 22.0))
    high = branch.parameter
    assert (high.min(), high.max()) == (19.2, 22.0)
    assert branch.period == pytest.approx(
        2 * np.log(11 / (30 - high)) + 2 * np.log((high - 5) / 14), abs=1e-7
    )
