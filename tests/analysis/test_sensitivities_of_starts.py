"""Derivatives of runs by what they start from: bodies that stick from the start, and guards at zero side by side."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

METHODS = pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853", "tsit5", "rodas5p"])


def carried(start: str, velocity: str, integrator: str, rest: str = "", **options: object) -> np.ndarray:
    """Derivatives of v(1) and w(1) by a, b and F of a block that a belt at 3/10 carries; v + w changes by F t alone."""
    model = hs.Model.from_toml(
        f"""schema = 1
name = "carried"
parameters = {{ a = 0.1, b = 0.3, F = 0.4 }}
states.v = {{ start = "{start}", der = "F - f" }}
states.w = {{ start = 0, der = "f" }}
states.x = {{ start = 1, der = 1 }}
contacts.f = {{ velocity = "{velocity}", normal = 1, law = {{ name = "coulomb", mu = 1 }} }}
{rest}
"""
    )
    solution = hs.simulate(model, (0, 1), integrator=integrator, **options)
    assert [mode.mode for mode in solution.modes["f"]] == ["stick"]
    return hs.sensitivities(solution, ["a", "b", "F"]).by_parameter[:2]


@METHODS
@pytest.mark.parametrize(
    ("start", "velocity", "start_by", "belt_by"),
    [
        ("b", "v - 3*a", (0, 1), (3, 0)),
        ("b", "v - (a + 0.2)", (0, 1), (1, 0)),
        ("b", "10*v - 30*a", (0, 1), (3, 0)),
        ("b", "v - 0.3", (0, 1), (0, 0)),
        ("3*a", "v - b", (3, 0), (0, 1)),
    ],
)
def test_a_block_that_its_belt_carries_from_the_start(
    start: str, velocity: str, start_by: tuple[int, int], belt_by: tuple[int, int], integrator: str
) -> None:
    """v(1) is the speed u of the belt, and w(1) = F + v0 - u, however both numbers of 3/10 are rounded."""
    found = carried(start, velocity, integrator)
    v0, u = np.array([*start_by, 0.0]), np.array([*belt_by, 0.0])
    assert found == pytest.approx(np.array([u, [0.0, 0.0, 1.0] + v0 - u]), abs=1e-12)


@METHODS
def test_a_start_that_is_given_does_not_follow_the_declared_one(integrator: str) -> None:
    found = carried("b", "v - 3*a", integrator, x0={"v": 0.1 * 3})
    assert found == pytest.approx(np.array([[3.0, 0.0, 0.0], [-3.0, 0.0, 1.0]]), abs=1e-12)


@METHODS
@pytest.mark.parametrize("belt", ["3*a", "b + 0*a"])
@pytest.mark.parametrize(
    "rest",
    [
        '[schedules.s]\ntimes = [0]\nreset.w = "w + v"',
        "[components.g.modes.on]\ninitial = true\nguards.end = "
        '{ expr = "1 - x", then = { to = "off", reset = { w = "+= v" } } }\n[components.g.modes.off]',
    ],
    ids=["clock", "guard"],
)
def test_a_reset_at_the_start_reads_the_speed_before_the_belt_takes_the_block(
    rest: str, belt: str, integrator: str
) -> None:
    """w is v0 then, and w(1) = v0 + F + v0 - u with the belt's speed u; a block that sticks already has the speed u."""
    by_belt = np.array([3.0, 0.0, 0.0] if belt == "3*a" else [0.0, 1.0, 0.0])
    by_start, by_force = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    found = carried("b", f"v - {belt}", integrator, rest)
    assert found == pytest.approx(np.array([by_belt, by_force + 2.0 * by_start - by_belt]), abs=1e-12)
    found = carried("b", f"v - {belt}", integrator, rest, z0={"f": "stick"})
    assert found == pytest.approx(np.array([by_belt, by_force + by_start]), abs=1e-12)


@METHODS
def test_a_guard_whose_delay_lets_the_block_come_to_the_belt(integrator: str) -> None:
    """From b - h the guard fires after 2 h, when v has come back to 3/10 at the rate 7/5; from b + h at once."""
    model = hs.Model.from_toml(
        """schema = 1
name = "delayed"
parameters = { b = 0.3 }
states.v = { start = "b", der = "0.4 - f" }
states.w = { start = 0, der = "f" }
states.x = { start = "2*b + 0.4", der = 1 }
contacts.f = { velocity = "v - 0.3", normal = 1, law = { name = "coulomb", mu = 1 } }
[components.g.modes.on]
initial = true
guards.end = { expr = "1 - x", then = { to = "off", reset = { w = "+= v" } } }
[components.g.modes.off]
"""
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1), integrator=integrator))
    assert np.isnan(found.by_parameter[1, 0])
    assert any("guard end of g" in warning for warning in found.warnings)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5", "rodas5p"])
def test_a_guard_that_fires_while_another_waits(integrator: str) -> None:
    """From q = 1 - h the first guard adds 1 at once: x(1) = 4 - h. From 1 + h it never does: x(1) = q sqrt(e).

    The second guard, which fires at the start at 1, changes nothing.
    """
    model = hs.Model(
        "waiting",
        states=[hs.State("x", "q", "x/2"), hs.State("y", 0, "x")],
        parameters={"q": 1.0},
        components=[
            hs.Component(
                "c",
                [
                    hs.Mode("a", hs.Guard("g", "x - 1 + y", hs.Choice("b", reset={"x": "+= 1"}))),
                    hs.Mode("b", der={"x": 2}),
                ],
                initial="a",
            ),
            hs.Component(
                "d", [hs.Mode("a", hs.Guard("g", "1 - x", hs.Choice("b"))), hs.Mode("b")], initial="a"
            ),
        ],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 1), integrator=integrator), ["q"])
    assert np.isnan(found.by_parameter).all()
    assert any("guard g of c" in warning and " q " in warning for warning in found.warnings)
    for q, expected in ((0.75, 1.0), (1.25, math.sqrt(math.e))):
        beside = hs.sensitivities(
            hs.simulate(model, (0, 1), integrator=integrator, rtol=1e-10, params={"q": q})
        )
        assert beside.by_parameter[0, 0] == pytest.approx(expected, rel=1e-8)
