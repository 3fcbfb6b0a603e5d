"""Integrals over a run: work of forces and what friction dissipates, against closed forms and energy balances."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError
from hybridsim.solution.integrals.quadrature import integral

MU, N, M, START = 0.3, 20.0, 2.0, 1.5
STRIBECK = {"mu_s": 0.5, "mu_k": 0.3, "v_s": 0.1}


def block(law: str = "coulomb", **arguments: object) -> hs.Model:
    """A block that slides from the speed START, slowed by mu N/m, until it stops."""
    return hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", START, f"-f/{M}")],
        contacts=[hs.Contact("f", velocity="v", normal=N, law=law, arguments=arguments or {"mu": MU})],
        outputs=[hs.Output("E", f"{M}*v**2/2")],
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-rk45"])
def test_a_sliding_block_loses_mu_n_times_the_distance(integrator: str) -> None:
    sol = hs.simulate(block(), (0, 1), integrator=integrator)
    distance = START**2 * M / (2 * MU * N)
    assert sol.x_end[0] == pytest.approx(distance, rel=1e-7)
    assert sol.dissipated["f"] == pytest.approx(MU * N * distance, rel=1e-7)
    assert sol.integral("v") == pytest.approx(distance, rel=1e-7)
    assert sol.integral("f") == pytest.approx(M * START, rel=1e-7)  # the impulse


def test_a_part_of_a_run_and_the_way_back() -> None:
    sol = hs.simulate(block(), (0, 1))
    speed = [START - MU * N / M * t for t in (0.1, 0.3)]
    lost = 0.5 * M * (speed[0] ** 2 - speed[1] ** 2)
    assert sol.integral("f", "v", t_span=(0.1, 0.3)) == pytest.approx(lost, rel=1e-12)
    assert sol.integral("f", "v", t_span=(0.3, 0.1)) == pytest.approx(-lost, rel=1e-12)
    back = hs.simulate(block(), (0.2, 0.0))
    assert back.integral("v") == pytest.approx(-(START * 0.2 + 0.5 * MU * N / M * 0.2**2), rel=1e-12)


def test_what_friction_takes_on_a_belt_is_what_the_belt_gives_and_the_spring_loses() -> None:
    """v' = -x - f: the work of -f is the gain of v^2/2 + x^2/2, and that of the belt is f v_belt."""
    model = hs.Model(
        "belt",
        states=[hs.State("x", 1.0, "v"), hs.State("v", 0.0, "-x - f")],
        contacts=[
            hs.Contact("f", velocity="v - 0.4", normal=1, law="stribeck-exponential", arguments=STRIBECK)
        ],
        outputs=[hs.Output("E", "v**2/2 + x**2/2")],
    )
    sol = hs.simulate(model, (0, 40), rtol=1e-12)
    assert len(sol.event_times("f")) > 4
    gain = sol["E"][-1] - sol["E"][0]
    assert sol.integral("f", "v") == pytest.approx(-gain, abs=1e-9)
    assert sol.dissipated["f"] == pytest.approx(-gain - 0.4 * sol.integral("f"), rel=1e-9)
    assert sol.dissipated["f"] > 0


def test_a_contact_without_stick_is_measured_too() -> None:
    """A law with a direct force, viscous: f = c v, so that m v^2/2 falls to m v0^2/2 exp(-2 c t/m)."""
    viscous = hs.FrictionLaw("viscous", force="0.7*v")
    model = hs.Model(
        "damped",
        states=[hs.State("x", 0, "v"), hs.State("v", START + 0.25, f"-f/{M}")],
        parameters={"u": 0.25},
        contacts=[hs.Contact("f", velocity="v - u", normal=1, law=viscous)],
    )
    sol = hs.simulate(model, (0, 3))
    lost = 0.5 * M * START**2 * (1 - math.exp(-2 * 0.7 * 3 / M))  # in the frame of the belt
    assert sol.dissipated["f"] == pytest.approx(lost, rel=1e-8)


def test_many_periods_without_an_event_are_resolved() -> None:
    """cos(50 t)^2 over a run of one closed-form segment."""
    model = hs.Model("swing", states=[hs.State("x", 1.0, "50*y"), hs.State("y", 0.0, "-50*x")])
    sol = hs.simulate(model, (0, 100), integrator="exact")
    assert sol.integral("x", "x") == pytest.approx(50 + math.sin(2 * 50 * 100) / 200, rel=1e-9)


def test_the_rule_resolves_a_kink() -> None:
    found = integral(lambda t: np.column_stack([np.abs(t - 0.3), t**15]), np.array([0.0, 1.0]), 2)
    assert found == pytest.approx([0.5 * (0.3**2 + 0.7**2), 1 / 16], rel=1e-12)


def stored(system: hs.MechanicalSystem, x: np.ndarray) -> float:
    """Kinetic and elastic energy of a state, from the matrices."""
    q, v = np.split(x, 2)
    return float(0.5 * (v @ (system.M @ v) + q @ (system.K @ q)))


def test_a_block_of_a_mechanical_system_loses_mu_n_times_the_distance() -> None:
    floor = hs.MechanicalContact("f", [1.0], normal=N, law="coulomb", arguments={"mu": MU})
    system = hs.MechanicalSystem(M=[M], C=None, K=None, contacts=[floor], v0=[START])
    sol, lost = hs.simulate(system, (0, 1)), 0.5 * M * START**2
    assert sol.dissipated == {"f": pytest.approx(lost, rel=1e-10)}
    assert sol.work == pytest.approx(
        {"forcing": 0.0, "damping": 0.0, "friction": -lost, "bases": 0.0, "impacts": 0.0}, rel=1e-10
    )
    assert sol.stored_energy(0.0) == pytest.approx(lost)
    assert sol.stored_energy([0.0, 1.0]).tolist() == pytest.approx([lost, 0.0])


def test_works_of_a_taylor_run_add_up_to_what_is_stored() -> None:
    """Each source by itself against the ordinary model, and all of them against the gain of stored energy."""
    base = hs.Harmonic(0.9, sin=0.3)
    contacts = [
        hs.MechanicalContact("f1", [1.0, 0.0], 1.0, "coulomb", {"mu": 0.5}, base=base),
        hs.MechanicalContact("f2", [-1.0, 1.0], 1.5, "coulomb", {"mu": 0.2}, base=0.1),
    ]
    forcing = {1: (hs.Harmonic(1.3, sin=0.5, cos=0.2), 0.1)}
    system = hs.MechanicalSystem(
        M=[1.0, 2.0], C=[0.05, 0.02], K=[[2.0, -1.0], [-1.0, 1.5]], forcing=forcing, contacts=contacts,
        q0=[1.0, -0.5],
    )  # fmt: skip
    sol = hs.simulate(system, (0, 20))
    assert len(sol.events) > 6
    gain = stored(system, sol.x_end) - stored(system, sol(0.0))
    assert sum(sol.work.values()) == pytest.approx(gain, abs=1e-8)
    assert sol.stored_energy()[-1] - sol.stored_energy(0.0) == pytest.approx(gain, rel=1e-12)
    model = system.to_model()
    model = hs.Model(
        "with-outputs", states=model.states, parameters=model.parameters, contacts=model.contacts,
        outputs=[
            hs.Output("F", "0.5*sin(1.3*t) + 0.2*cos(1.3*t) + 0.1"),
            hs.Output("u1", "0.3*sin(0.9*t)"),
            hs.Output("lost", "0.05*v1**2 + 0.02*v2**2"),
        ],
    )  # fmt: skip
    other = hs.simulate(model, (0, 20), integrator="dop853", rtol=1e-11)
    assert sol.dissipated == pytest.approx(
        {name: other.integral(name, f"v_rel({name})") for name in ("f1", "f2")}, rel=1e-6
    )
    assert sol.work == pytest.approx(
        {
            "forcing": other.integral("F", "v2"),
            "damping": -other.integral("lost"),
            "friction": -sum(other.dissipated.values()),
            "bases": -other.integral("f1", "u1") - 0.1 * other.integral("f2"),
            "impacts": 0.0,
        },
        rel=1e-6,
    )


def test_time_stepping_measures_the_same_by_contact() -> None:
    sol = hs.simulate(hs.two_blocks_on_belt(), (0, 5), integrator="moreau", step=1e-3)
    assert -sum(sol.dissipated.values()) == pytest.approx(sol.work["friction"], rel=1e-9)


def test_what_is_refused() -> None:
    sol = hs.simulate(block(), (0, 1))
    for call, message in (
        (lambda: sol.integral(), "got no quantity"),
        (lambda: sol.integral("w"), "no quantity 'w'"),
        (lambda: sol.integral("v", t_span=(0, 2)), "is outside the run"),
        (lambda: sol.stored_energy(), "does not declare masses"),
        (lambda: hs.simulate(block(), (0, 1), keep="events").dissipated, "keeps no states"),
    ):
        with pytest.raises(UsageError, match=message):
            call()
    with pytest.raises(UsageError, match="no component 'g'"):
        sol.dissipated["g"]
    with pytest.raises(AttributeError, match="only a run of a MechanicalSystem"):
        _ = sol.work


def test_a_model_without_contacts_dissipates_nothing() -> None:
    model = hs.Model("free", states=[hs.State("x", 1, "-x")])
    assert hs.simulate(model, (0, 1)).dissipated == {}


def test_time_is_a_quantity_of_an_integral() -> None:
    """The integral of t from 1 to 3 is 4, and that of t v for the constant v = 2 is 8."""
    model = hs.Model("line", states=[hs.State("x", 0, "2")], outputs=[hs.Output("v", "2")])
    sol = hs.simulate(model, (1, 3), integrator="dop853")
    assert sol.integral("t") == pytest.approx(4.0, rel=1e-13)
    assert sol.integral("t", "v") == pytest.approx(8.0, rel=1e-13)


def test_energy_lost_in_impulses_is_said_to_be_missing() -> None:
    """A body with horizontal speed falls from 0.5 m and strikes the floor once: its friction acts in the impulse."""
    model = hs.Model(
        "skid",
        states=[
            hs.State("h", 0.5, "w"), hs.State("w", 0, "-10 + p"), hs.State("x", 0, "v"), hs.State("v", 1, "-f")
        ],
        contacts=[hs.Contact("f", velocity="v", normal="p", law="coulomb", arguments={"mu": 0.1})],
        impacts=[hs.Impact("p", gap="h", restitution="0")],
    )  # fmt: skip
    assert "without the impulses of friction in 1 impact" in repr(hs.simulate(model, (0, 1)).dissipated)
    assert "impulses" not in repr(hs.simulate(model, (0, 0.1)).dissipated)
