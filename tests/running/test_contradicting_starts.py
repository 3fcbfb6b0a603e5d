"""A mode at the start that the state there rules out is taken, and said so."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hybridsim as hs

BELT = hs.Model(
    "belt",
    states=[hs.State("x", 0, "v"), hs.State("v", 0, "-x - f")],
    contacts=[hs.Contact("f", velocity="v - 1", normal="1", law="coulomb", arguments={"mu": 0.5})],
)


@pytest.mark.parametrize(
    "x0, z0, is_told",
    [
        ({"v": 1.0}, {"f": "stick"}, False),
        ({"v": 0.0}, {"f": "stick"}, True),
        ({"v": 2.0}, {"f": "slip-"}, True),
        ({"v": 2.0}, {"f": "slip+"}, False),
        ({"v": 1.0}, {"f": "slip-"}, False),
        ({"v": 2.0}, None, False),
    ],
)
@pytest.mark.parametrize("integrator", ["exact", "dop853", "scipy-dop853"])
def test_a_contact(x0: dict[str, float], z0: dict[str, str] | None, is_told: bool, integrator: str) -> None:
    for _ in range(2):  # the second time the start is known
        sol = hs.simulate(BELT, (0.0, 0.01), x0=x0, z0=z0, integrator=integrator)
        said = [text for text in sol.warnings if "as requested" in text]
        assert sol.success and len(said) == is_told
        assert all("f begins in mode" in text for text in said)


def test_beside_a_large_state() -> None:
    model = replace(BELT, states=[*BELT.states, hs.State("far", 1e9, "0")])
    (said,) = hs.simulate(model, (0.0, 0.01), x0={"v": 0.5}, z0={"f": "stick"}).warnings
    assert "f begins in mode stick" in said


def test_a_gap() -> None:
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1, "v"), hs.State("v", 0, "-9.81 + p")],
        impacts=[hs.Impact("p", gap="h", restitution=0.5)],
    )
    assert not hs.simulate(ball, (0.0, 0.1), z0={"p": "open"}).warnings
    assert not hs.simulate(ball, (0.0, 0.1), x0={"h": 0.0, "v": 0.0}, z0={"p": "closed"}).warnings
    for speed in (1.0, -3.0):
        for integrator in ("exact", "dop853"):
            sol = hs.simulate(
                ball, (0.0, 0.1), x0={"h": 0.0, "v": speed}, z0={"p": "closed"}, integrator=integrator
            )
            assert any(
                "moves off its surface: the state was projected onto the surface" in w for w in sol.warnings
            )
            assert sol.y[:, -1].tolist() == [0.0, 0.0]
    rising = replace(ball, states=[hs.State("h", 1, "v"), hs.State("v", 0, "9.81 + p")])
    (gone,) = hs.simulate(rising, (0.0, 0.1), x0={"h": 0.0, "v": 1.0}, z0={"p": "closed"}).warnings
    assert "p begins in mode closed" in gone
    (below,) = hs.simulate(ball, (0.0, 0.1), x0={"h": -0.5}, z0={"p": "open"}).warnings
    assert below.endswith("has the surface value -0.5, which does not belong to that mode")
    assert any(
        "p begins in mode closed" in text
        for text in hs.simulate(ball, (0.0, 0.1), z0={"p": "closed"}).warnings
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-rk45", "rodas5p", "cvode-bdf"])
@pytest.mark.parametrize("speed", [-4.43, 4.43, 0.0])
def test_a_gap_just_below_zero(speed: float, integrator: str) -> None:
    """A state of an earlier run at an impact has the rounding of that run, so that its gap may be below zero."""
    ball = hs.Model(
        "ball",
        states=[hs.State("h", -1.7e-17, "v"), hs.State("v", speed, "-9.81 + p")],
        impacts=[hs.Impact("p", gap="h", restitution=0.5)],
    )
    sol = hs.simulate(ball, (0.0, 0.2), integrator=integrator)
    thrown = speed if speed > 0.0 else -0.5 * speed
    expected = thrown * 0.2 - 0.5 * 9.81 * 0.2**2 if thrown else 0.0
    assert sol.success and sol.x_end[0] == pytest.approx(expected, abs=1e-9)
    assert (sol.events[0].t if speed < 0.0 else 0.0) == 0.0
    below = hs.simulate(ball, (0.0, 0.2), x0={"h": -2e-12, "v": speed}, integrator=integrator)
    assert below.status == "inconsistent" and "gap of p is -2e-12, below zero" in below.message
