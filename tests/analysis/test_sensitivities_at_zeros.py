"""Derivatives of runs that start, or are put by a reset, exactly on a guard or surface. All are closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


def guarded(guard: str, rate: str, x0: float, then: hs.Choice, **rest: object) -> hs.Solution:
    """x from x0 with a guard, and y' = q beside it."""
    model = hs.Model(
        "guarded",
        states=[hs.State("x", "x0", rate), hs.State("y", 0, "q")],
        parameters={"x0": x0, "q": 2.0},
        components=[
            hs.Component("g", [hs.Mode("a", hs.Guard("end", guard, then)), hs.Mode("b", **rest)], initial="a")
        ],
    )
    return hs.simulate(model, (0, 1), rtol=1e-11)


HALVED = hs.Choice("b", reset={"x": "0.5*x"})


@pytest.mark.parametrize(
    ("guard", "rate"),
    [("1 - x", "1"), ("x - 1", "1"), ("x - 1", "0")],
    ids=["falls and fires", "rises and does not", "stays"],
)
def test_a_start_on_a_guard_has_no_derivative_by_what_moves_it_off(guard: str, rate: str) -> None:
    """Beyond the guard x is halved at once, before it x grows by 1 until it is halved, or is never halved."""
    solution = guarded(guard, rate, 1.0, HALVED)
    with pytest.raises(UsageError, match="guard end of g is exactly at its zero, and x0 moves it off"):
        hs.sensitivities(solution)
    found = hs.sensitivities(solution, ["q"])
    assert found.by_parameter[:, 0] == pytest.approx([0.0, 1.0], abs=1e-14)
    assert np.isnan(found.by_start[:, 0]).all()
    assert found.by_start[:, 1].tolist() == [0.0, 1.0]
    kept = hs.sensitivities(solution, ["q"], starts_follow=False)
    assert kept.by_parameter[:, 0] == pytest.approx([0.0, 1.0], abs=1e-14)


def test_a_start_beyond_a_guard_has_a_derivative() -> None:
    assert hs.sensitivities(guarded("1 - x", "1", 1.5, HALVED)).by_parameter[0, 0] == pytest.approx(0.5)


def test_a_guard_at_zero_that_changes_nothing_leaves_the_derivative() -> None:
    assert hs.sensitivities(guarded("1 - x", "1", 1.0, hs.Choice("b"))).by_parameter[0, 0] == pytest.approx(
        1.0
    )
    with pytest.raises(
        UsageError, match="moves it off"
    ):  # from x = 1 on x' = 3: on one side 3 x0, on the other x0
        hs.sensitivities(guarded("1 - x", "1", 1.0, hs.Choice("b"), der={"x": 3}))


def test_corners_at_the_start() -> None:
    """x' = 1 + |x| from 0 passes the corner: dx/dx0 = exp(t). x' = |x| stays: exp(t) above, exp(-t) below."""

    def ran(rate: str) -> hs.Solution:
        model = hs.Model("corner", states=[hs.State("x", "x0", rate)], parameters={"x0": 0.0})
        return hs.simulate(model, (0, 1), rtol=1e-11)

    assert hs.sensitivities(ran("1 + abs(x)")).by_parameter[0, 0] == pytest.approx(math.e, rel=1e-9)
    with pytest.raises(UsageError, match="x0 moves it off"):
        hs.sensitivities(ran("abs(x)"))


def rubbing(law: str, push: str, rest: str = "", v0: float = 2.0) -> hs.Model:
    return hs.Model.from_toml(
        f"""schema = 1
name = "rubbing"
parameters = {{ m = 1.0, M = 3.0, v0 = {v0}, w0 = 2.0, F = 3.0, q = 0.0 }}
states.v = {{ start = "v0", der = "({push} - f)/m" }}
states.w = {{ start = "w0", der = "f/M" }}
contacts.f = {{ velocity = "v - w", normal = 10, law = {{ {law} }} }}
{rest}
"""
    )


COULOMB = 'name = "coulomb", mu = 1'


def test_bodies_that_stick_at_the_start_share_their_momentum() -> None:
    """From velocities that differ a little both come at once to that of their common centre of mass."""
    found = hs.sensitivities(hs.simulate(rubbing(COULOMB, "F"), (0, 1)), ["v0", "w0", "F", "m"])
    shared = [1 / 4, 3 / 4, 1 / 4, -3 / 16]
    assert found.by_parameter == pytest.approx(np.array([shared, shared]), rel=1e-12)
    assert found.by_start == pytest.approx(np.array([shared[:2], shared[:2]]), rel=1e-12)


def test_bodies_that_a_reset_makes_stick_share_their_momentum() -> None:
    """At 1/2 v becomes w + q, from 2 + w0 - 2: momentum m (w + q) + M w is kept from there on."""
    rest = '[schedules.s]\ntimes = [0.5]\nreset.v = "w + q"'
    found = hs.sensitivities(hs.simulate(rubbing(COULOMB, "0", rest), (0, 1)), ["q"])
    assert found.by_parameter[:, 0] == pytest.approx([1 / 4, 1 / 4], rel=1e-12)
    assert found.by_start == pytest.approx(np.array([[1 / 4, 3 / 4]] * 2), rel=1e-12)


def test_what_slips_from_its_start_on_has_no_derivative_by_its_velocity() -> None:
    """Pushed by 30 against 10: a little behind, friction turns and adds."""
    solution = hs.simulate(rubbing(COULOMB, "10*F"), (0, 1))
    with pytest.raises(UsageError, match="f is exactly at its zero, and v0 moves it off"):
        hs.sensitivities(solution, ["v0"])
    found = hs.sensitivities(solution, ["F"])
    assert found.by_parameter[:, 0] == pytest.approx([10.0, 0.0], rel=1e-12)
    assert np.isnan(found.by_start).all()


def test_stick_that_does_not_come_back_has_no_derivative_by_its_velocity() -> None:
    """Static friction holds 9 of 10; kinetic friction of 5 lets go whatever moves."""
    law = 'name = "static-kinetic", mu_s = 1, mu_k = 0.5'
    solution = hs.simulate(rubbing(law, "3*F"), (0, 1))
    assert [i.mode for i in solution.modes["f"]] == ["stick"]
    with pytest.raises(UsageError, match="moves it off"):
        hs.sensitivities(solution, ["w0"])
    assert hs.sensitivities(solution, ["F"]).by_parameter[:, 0] == pytest.approx([3 / 4, 3 / 4], rel=1e-12)


def test_a_reset_exactly_onto_a_guard() -> None:
    """At 1/2 y becomes q = 1 and falls: z grows by q where q is less, and by 1 a little later where it is more."""
    model = hs.Model(
        "onto",
        states=[hs.State("y", 5, -1), hs.State("z", 0, 0)],
        parameters={"q": 1.0, "r": 1.0},
        schedules=[hs.Schedule("s", times=[0.5], reset={"y": "q"})],
        components=[
            hs.Component(
                "g",
                [
                    hs.Mode("a", hs.Guard("end", "y - 1", hs.Choice("b", reset={"z": "z + r*y"}))),
                    hs.Mode("b"),
                ],
                initial="a",
            )
        ],
    )
    with pytest.raises(
        UsageError, match=r"t = 0.5 guard end of g is exactly at its zero, and q moves it off"
    ):
        hs.sensitivities(hs.simulate(model, (0, 1)))
    assert hs.sensitivities(hs.simulate(model, (0, 1)), ["r"]).by_parameter[:, 0].tolist() == [0.0, 1.0]
    for q, expected in ((0.75, 0.75), (1.25, 1.0)):
        found = hs.sensitivities(hs.simulate(model, (0, 1), params={"q": q}))
        assert found.by_parameter[1] == pytest.approx([float(q < 1.0), expected], rel=1e-12)
