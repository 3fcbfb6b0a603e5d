"""A floor that changes its speed at once strikes what lies on it, or leaves it behind: Newton's law and free fall."""

from __future__ import annotations

import pytest

import hybridsim as hs

METHODS = ["exact", "taylor", "dop853", "scipy-dop853"]
AT = 1.02


def floor(speed: float, form: str) -> hs.Model:
    """A ball at rest on a floor whose speed jumps from 0 to another at t = 1."""
    inputs = []
    level = f"{speed}*max(t - 1, 0)"
    if form == "table":
        inputs, level = [hs.Input("level", "table", times=[-1, 1, 3], values=[0, 0, 2 * speed])], "level"
    return hs.Model(
        "kinked-floor",
        states=[hs.State("h", 0, "w"), hs.State("w", 0, "p - 10")],
        impacts=[hs.Impact("p", gap=f"h - {level}", restitution=0.5)],
        inputs=inputs,
    )


@pytest.mark.parametrize("form", ["table", "corner"])
@pytest.mark.parametrize("method", METHODS)
def test_a_floor_that_starts_to_rise_throws_what_lies_on_it(method: str, form: str) -> None:
    """It closes at 0.5 and opens at 0.25: the ball leaves with 0.75, and lands 2*0.25/10 later."""
    sol = hs.simulate(floor(0.5, form), (0.0, 1.2), integrator=method)
    assert sol.success
    assert sol(AT) == pytest.approx([0.75 * 0.02 - 5 * 0.02**2, 0.75 - 10 * 0.02], abs=1e-9)
    assert [event.t for event in sol.events if event.component == "p"][:2] == pytest.approx(
        [1.0, 1.05], abs=1e-9
    )


@pytest.mark.parametrize("form", ["table", "corner"])
@pytest.mark.parametrize("method", METHODS)
def test_a_floor_that_starts_to_sink_leaves_what_lies_on_it(method: str, form: str) -> None:
    """The ball falls freely until it catches up with the floor, 0.5 s = 5 s^2 later."""
    sol = hs.simulate(floor(-0.5, form), (0.0, 1.2), integrator=method)
    assert sol.success
    assert sol(AT) == pytest.approx([-5 * 0.02**2, -10 * 0.02], abs=1e-9)
    assert [event.t for event in sol.events if event.component == "p"][:2] == pytest.approx(
        [1.0, 1.1], abs=1e-9
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_floor_that_only_bends_is_followed(method: str) -> None:
    """Where the acceleration jumps and the speed does not, the ball stays: it is no impact."""
    model = hs.Model(
        "bent-floor",
        states=[hs.State("h", 0, "w"), hs.State("w", 0, "p - 10")],
        impacts=[hs.Impact("p", gap="h - 2*max(t - 1, 0)**2", restitution=0.5)],
    )
    sol = hs.simulate(model, (0.0, 1.5), integrator=method)
    assert sol.success and not sol.events
    assert sol(1.5) == pytest.approx([0.5, 2.0], abs=1e-9)


@pytest.mark.parametrize("speeds", [(0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5)])
@pytest.mark.parametrize("method", METHODS)
def test_floors_that_set_out_at_once_do_so_each_for_itself(method: str, speeds: tuple[float, float]) -> None:
    """The blow of one floor does not carry the ball on the other along."""
    model = hs.Model(
        "two-floors",
        states=[
            s for k in (0, 1) for s in (hs.State(f"h{k}", 0, f"w{k}"), hs.State(f"w{k}", 0, f"p{k} - 10"))
        ],
        impacts=[
            hs.Impact(f"p{k}", gap=f"h{k} - {speed}*max(t - 1, 0)", restitution=0.5)
            for k, speed in enumerate(speeds)
        ],
    )
    sol = hs.simulate(model, (0.0, 1.04), integrator=method)
    started = [0.75 if speed > 0.0 else 0.0 for speed in speeds]
    expected = [part for w in started for part in (0.02 * w - 5 * 0.02**2, w - 10 * 0.02)]
    assert sol(AT) == pytest.approx(expected, abs=1e-9)
    assert [event.component for event in sol.events] == ["p0", "p1"]
