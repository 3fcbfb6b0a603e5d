"""Loads that touch zero, contacts in series with static above kinetic friction, reactions that load friction."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

LOADS = ("k*max(-h, 0)", "max(-k*h, 0)", "1000*max(-h, 0)", "k*(abs(h) - h)/2", "-k*min(h, 0)")


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
@pytest.mark.parametrize("load", LOADS)
def test_a_body_that_leaves_an_elastic_floor_keeps_its_speed(load: str, integrator: str) -> None:
    model = hs.Model(
        "floor",
        states=[
            hs.State("h", 0.1, der="w", nominal=1),
            hs.State("w", 0, der="n - 9.81", nominal=1),
            hs.State("u", 3, der="-f", nominal=1),
        ],
        parameters={"k": 1000},
        definitions={"n": load},
        contacts=[hs.Contact("f", "u", "n", "coulomb", {"mu": 0.3})],
    )
    solution = hs.simulate(model, (0, 0.3), integrator=integrator, rtol=1e-11)
    assert solution.success
    # the impulse of the load is what has changed w, less that of the weight
    impulse = solution(0.3)[1] + 9.81 * 0.3
    assert solution(0.3)[2] == pytest.approx(3.0 - 0.3 * impulse, rel=1e-9)
    assert solution(0.3)[2] > 1.8
    assert solution.events == ()


def test_a_load_that_does_become_negative_still_ends_the_run() -> None:
    model = hs.Model(
        "pulled",
        states=[hs.State("h", -1, der="1", nominal=1), hs.State("u", 3, der="-f", nominal=1)],
        parameters={"k": 2},
        contacts=[hs.Contact("f", "u", "k*max(-h, 0) - h", "coulomb", {"mu": 0.1})],
    )
    solution = hs.simulate(model, (0, 2), integrator="taylor")
    assert solution.status == "inconsistent"
    assert solution.t_end == pytest.approx(1.0)
    assert "normal load of contact f became negative" in solution.message


def series(rng: np.random.Generator) -> tuple[hs.MechanicalSystem, dict[str, float]]:
    """Two blocks on each other, of which a harmonic force pulls the upper one."""
    v = {name: float(rng.uniform(0.3, 2.0)) for name in ("m1", "m2", "k1", "k2", "N1", "N2")}
    v |= {"s1": float(rng.uniform(0.5, 1.0)), "s2": float(rng.uniform(0.5, 1.0))}
    v |= {"c1": v["s1"] * float(rng.uniform(0.3, 0.9)), "c2": v["s2"] * float(rng.uniform(0.3, 0.9))}
    v["F"] = 1.5 * max(v["s1"] * v["N1"], v["s2"] * v["N2"])
    contacts = [
        hs.MechanicalContact("f", {0: 1.0}, v["N1"], "static-kinetic", {"mu_s": v["s1"], "mu_k": v["c1"]}),
        hs.MechanicalContact("g", {0: -1.0, 1: 1.0}, v["N2"], "static-kinetic", {"mu_s": v["s2"], "mu_k": v["c2"]}),
    ]  # fmt: skip
    system = hs.MechanicalSystem(
        np.diag([v["m1"], v["m2"]]), np.zeros((2, 2)), np.diag([v["k1"], v["k2"]]),
        {1: hs.Harmonic(omega=0.5, sin=v["F"])}, contacts,
    )  # fmt: skip
    return system, v


def test_of_two_contacts_in_series_the_one_at_its_limit_lets_go() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        system, v = series(rng)
        limits = {"f": v["s1"] * v["N1"], "g": v["s2"] * v["N2"]}
        first = min(limits, key=limits.__getitem__)
        # at rest both contacts carry the force
        instant = float(np.arcsin(limits[first] / v["F"]) / 0.5)
        solution = hs.simulate(system.to_model(), (0, instant + 1e-3), integrator="exact")
        assert solution.success, solution.message
        (event,) = [one for one in solution.events if one.t > 0.0]
        assert (event.component, event.target) == (first, "slip+")
        assert event.t == pytest.approx(instant, rel=1e-9)


@pytest.mark.slow
def test_contacts_in_series_let_go_as_a_mechanical_system_decides() -> None:
    """Up to the first stop: where one comes to rest as another lets go, several outcomes may be admissible."""
    rng = np.random.default_rng(4)
    for _ in range(100):
        system, _v = series(rng)
        solution = hs.simulate(system.to_model(), (0, 12), integrator="exact")
        other = hs.simulate(system, (0, 12))
        assert solution.status == other.status == "finished", solution.message
        stops = [one.t for one in solution.events if one.t > 0.0 and one.source != "stick"]
        end = 0.999 * min(stops, default=12.0)
        releases = [
            [(one.component, one.target, one.t) for one in run.events if 0.0 < one.t < end]
            for run in (solution, other)
        ]
        assert [one[:2] for one in releases[0]] == [one[:2] for one in releases[1]]
        assert np.allclose([t for *_, t in releases[0]], [t for *_, t in releases[1]], rtol=1e-9)
        x1, v1, x2, v2 = solution(end)
        assert np.allclose([x1, x2, v1, v2], other(end), rtol=1e-7, atol=1e-8)


def reaction(mu: float = 1.0, u: float = -1.0) -> hs.Model:
    """A reaction that loads friction: w' = 1 + p + 2 f, u' = -5 f - 2 p."""
    return hs.Model(
        "painleve",
        states=[
            hs.State("h", 0, der="w", nominal=1),
            hs.State("w", 0, der="1 + p + 2*f", nominal=1),
            hs.State("u", u, der="-5*f - 2*p", nominal=1),
        ],
        parameters={"mu": mu},
        contacts=[hs.Contact("f", "u", "p", "coulomb", {"mu": "mu"})],
        impacts=[hs.Impact("p", gap="h", restitution=0)],
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_two_motions_under_one_reaction_are_named_and_can_be_chosen(integrator: str) -> None:
    solution = hs.simulate(reaction(), (0, 1), integrator=integrator)
    assert solution.status == "nonunique"
    assert "p: closed; or p: open" in solution.message
    opened = hs.simulate(reaction(), (0, 0.25), integrator=integrator, z0={"p": "open"})
    assert opened.y[:, -1] == pytest.approx([0.25**2 / 2, 0.25, -1.0], rel=1e-9)  # w' = 1
    closed = hs.simulate(reaction(), (0, 0.25), integrator=integrator, z0={"p": "closed"})
    assert closed.y[:, -1] == pytest.approx([0.0, 0.0, -1.0 + 3 * 0.25], rel=1e-9)  # f = -p, p = 1, u' = 3


@pytest.mark.parametrize(("mu", "u"), [(0.4, -1.0), (0.25, -1.0), (1.0, 1.0), (0.4, 1.0)])
def test_where_the_reaction_has_one_motion_it_is_taken(mu: float, u: float) -> None:
    """With f = mu sign(u) p the rate of w is 1 + (1 + 2 mu sign(u)) p: where that factor is positive it only opens."""
    assert 1 + 2 * mu * np.sign(u) > 0
    solution = hs.simulate(reaction(mu, u), (0, 0.5), integrator="taylor")
    assert solution.success
    assert solution.y[:, -1] == pytest.approx([0.125, 0.5, u], rel=1e-9)
