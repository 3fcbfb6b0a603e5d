"""Lowered contacts: forces that hold coupled surfaces against linear solves, held states, jumps at a release."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from engine.model_truth import combinations

import hybridsim as hs
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.model import Contact, FrictionLaw, Model, State

STICTION = FrictionLaw("stiction", slip="mu_k*N", stick="mu_s*N", parameters={"mu_s": 0.5, "mu_k": 0.4})


def chain(masses: list[float], pairs: list[tuple[int, int]], order: list[int] | None = None) -> Model:
    """Blocks on a line; contact (i, j) rubs block i on block j, (i, -1) on the ground."""
    order = list(range(len(pairs))) if order is None else order
    force = dict.fromkeys(range(len(masses)), "")
    for k, (i, j) in enumerate(pairs):
        force[i] += f" - f{k}"
        if j >= 0:
            force[j] += f" + f{k}"
    states = [State(f"v{i}", 0, f"(p{i}*cos(w*t + {i}) - c*v{i}{force[i]})/m{i}") for i in range(len(masses))]
    contacts = [
        Contact(
            f"f{k}",
            velocity=f"v{i} - v{j}" if j >= 0 else f"v{i}",
            normal=f"N*{k + 1}",
            law=STICTION,
        )
        for k, (i, j) in enumerate(pairs)
    ]
    values = {f"m{i}": m for i, m in enumerate(masses)} | {f"p{i}": 3.0 + i for i in range(len(masses))}
    return Model(
        "chain",
        states=states,
        parameters=values | {"w": 2.0, "c": 0.1, "N": 1.5},
        contacts=[contacts[k] for k in order],
    )


CHAINS: Mapping[str, tuple[list[float], list[tuple[int, int]]]] = {
    "one": ([1.5], [(0, -1)]),
    "two on the ground": ([1.5, 0.7], [(0, -1), (1, -1)]),
    "stack of two": ([1.5, 0.7], [(0, -1), (1, 0)]),
    "stack of three": ([1.0, 2.0, 0.3], [(0, -1), (1, 0), (2, 1)]),
    "chain v1-v2, v2-v3": ([1.0, 2.0, 0.3], [(0, 1), (1, 2)]),
    "stack of four": ([1.0, 5.0, 0.3, 2.5], [(0, -1), (1, 0), (2, 1), (3, 2)]),
    "four on one": ([4.0, 1.0, 2.0, 3.0, 0.1], [(1, 0), (2, 0), (3, 0), (4, 0)]),
}


@pytest.mark.parametrize("name", CHAINS)
def test_coupled_contacts_hold_their_surfaces(name: str) -> None:
    """Every combination of modes: held forces from a dense solve of W M^-1 W' f = W M^-1 F, rates zero where held."""
    masses, pairs = CHAINS[name]
    declared = list(range(len(pairs)))
    orders = [declared, declared[::-1]] if len(pairs) < 4 else [declared]
    rng = np.random.default_rng(3)
    for order in orders:
        model = chain(masses, pairs, order)
        system, x, t = System(model), rng.uniform(-1, 1, len(masses)), 0.7
        p = system.vector(Instant(t), np.zeros(0))
        p[system.layout.pin_at] = 0.0  # the rates of all states, held ones too
        w = np.zeros((len(pairs), len(masses)))
        for k, (i, j) in enumerate(pairs):
            w[k, i] = 1.0
            if j >= 0:
                w[k, j] = -1.0
        applied = np.array([(3.0 + i) * math.cos(2 * t + i) - 0.1 * x[i] for i in range(len(masses))])
        for z in combinations(system):
            sign = np.array([{0: 1.0, 1: -1.0}.get(int(z[order.index(k)]), 0.0) for k in range(len(pairs))])
            held = sign == 0.0
            force = sign * 0.4 * 1.5 * np.arange(1, len(pairs) + 1)
            free = (applied - w.T @ force) / masses
            if held.any():
                effect = w[held] / masses @ w[held].T
                force[held] = np.linalg.solve(effect, w[held] @ free)
            acceleration = (applied - w.T @ force) / masses
            size = np.max((np.abs(applied) + np.abs(w.T) @ np.abs(force)) / masses)
            found = system.flow(0.0, x, p, z)
            assert found == pytest.approx(acceleration, abs=1e-12)
            assert (np.abs(w[held] @ found) <= 1e-14 * size).all()
            values = system.rows("quantities", len(system.quantities), np.zeros(1), x[None, :], p, z)[0]
            for k in range(len(pairs)):
                assert values[system.quantities.index(f"f{k}")] == pytest.approx(force[k], abs=1e-12)


@pytest.mark.parametrize("name", CHAINS)
def test_held_states_are_on_their_constraints(name: str) -> None:
    masses, pairs = CHAINS[name]
    system = System(chain(masses, pairs))
    x = np.random.default_rng(4).uniform(-1, 1, len(masses))
    p = system.vector(Instant(0.0), np.zeros(0))
    for z in combinations(system):
        projected = system.project(0.0, x, p, z)
        for c, (i, j) in enumerate(pairs):
            if z[c] == system.automata[c].hold:
                relative = projected[i] - (projected[j] if j >= 0 else 0.0)
                assert abs(relative) <= 4 * math.ulp(np.abs(projected).max())
        assert (system.project(0.0, projected, p, z) == projected).all()


def test_coupled_contacts_are_one_cluster_and_separate_ones_are_not() -> None:
    def clusters(name: str) -> list[tuple[int, ...]]:
        return sorted(tuple(sorted(c)) for c in System(chain(*CHAINS[name])).clusters)

    assert clusters("two on the ground") == [(0,), (1,)]
    assert clusters("stack of three") == [(0, 1, 2)]
    two_stacks = chain([1.0, 2.0, 3.0, 4.0], [(0, -1), (2, -1), (1, 0), (3, 2)])
    assert sorted(tuple(sorted(c)) for c in System(two_stacks).clusters) == [(0, 2), (1, 3)]


# -- jumps at a release -----------------------------------------------------------------------------------------


def slider(
    law: FrictionLaw, normal: str = "N", arguments: Mapping[str, object] | None = None, **values: float
) -> System:
    model = Model(
        "slider",
        states=(State("x", 0.3, "v"), State("v", 0, "sin(t) - x - f")),
        parameters={"N": 7.3, "mu_s": 0.3, "mu_k": 0.3, "v_s": 0.01, "g": 9.81, **values},
        contacts=(Contact("f", velocity="v", normal=normal, law=law, arguments=arguments or {}),),
    )
    return System(model)


def jump(system: System) -> tuple[float, float]:
    z = np.array([system.automata[0].hold])
    above, below = system.jumps(0.123, np.array([0.3, 0.0]), system.vector(Instant(0.4), np.zeros(0)), z)
    return float(above), float(below)


PASSED_ON = {"mu_s": "mu_s", "mu_k": "mu_k"}
FREE = {"mu_s": None, "mu_k": None}
STRIBECK = {"mu_s": 0.7, "mu_k": 0.2, "v_s": 0.01}
# name: slip force, stick limit, parameters of the law, arguments of the contact
EQUAL = {
    "one coefficient": ("mu*N", "mu*N", {"mu": 0.3}, {}),
    "two numbers that are equal": ("mu_k*N", "mu_s*N", {"mu_s": 0.3, "mu_k": 0.3}, {}),
    "two parameters of equal value": ("mu_k*N", "mu_s*N", FREE, PASSED_ON),
    "the same parameter twice": ("mu_k*N", "mu_s*N", FREE, {"mu_s": "mu_s", "mu_k": "mu_s"}),
    "a default that follows": ("mu_k*N", "mu_s*N", {"mu_s": 0.3, "mu_k": "mu_s"}, {}),
    "stribeck at rest": ("N*(mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2))", "N*mu_s", STRIBECK, {}),
    "stribeck the other way": ("N*(mu_s - (mu_s - mu_k)*(1 - exp(-v/v_s)))", "mu_s*N", STRIBECK, {}),
    "hyperbolic": ("N*mu/(1 + delta*v)", "mu*N", {"mu": 0.9, "delta": 3}, {}),
    "with viscous part": ("mu_k*N + 2*v", "mu_s*N", {"mu_s": 0.3, "mu_k": 0.3}, {}),
    "tanh of speed": ("mu*N*(1 + 0.1*tanh(v))", "N*mu", {"mu": 0.3}, {}),
    "power of speed": ("mu*N*(1 - 0.1*v**0.5)", "N*mu", {"mu": 0.3}, {}),
    "thirds": ("N*(mu_s*2/3 + mu_k/3)", "N*mu_s", {"mu_s": 0.3, "mu_k": 0.3}, {}),
}


@pytest.mark.parametrize("normal", ["N", "N*g/3", "N + 0.1*sin(2*t)", "N*(1 + x**2)"])
@pytest.mark.parametrize("name", EQUAL)
def test_nothing_jumps_where_static_equals_kinetic(name: str, normal: str) -> None:
    """Exactly zero, not to rounding: the order of the release hangs on it."""
    slip, stick, parameters, arguments = EQUAL[name]
    law = FrictionLaw("law", slip=slip, stick=stick, parameters=parameters)
    assert jump(slider(law, normal, arguments)) == (0.0, 0.0)


@pytest.mark.parametrize("mu", [0.1, 0.3, 1 / 3, 0.7, 1e-3])
def test_two_parameters_that_happen_to_be_equal(mu: float) -> None:
    assert jump(slider(STICTION, "N*g", PASSED_ON, mu_s=mu, mu_k=mu)) == (0.0, 0.0)
    above, below = jump(slider(STICTION, "N*g", PASSED_ON, mu_s=math.nextafter(mu, 1.0), mu_k=mu))
    assert above > 0.0 > below


def test_a_jump_has_its_size_and_sign() -> None:
    above, below = jump(slider(STICTION))
    assert above == pytest.approx(0.1 * 7.3)
    assert below == pytest.approx(-0.1 * 7.3)


@pytest.mark.parametrize("load", ["exp(-t/10)", "exp(-t/10)*cos(t)", "exp(-(t - x)/10)"])
def test_what_decays_is_no_quotient(load: str) -> None:
    """The force that holds has exp(-t/10) in it, and not exp(t/10), which has no value for long."""
    model = hs.Model(
        "decay",
        [hs.State("x", 0, "v"), hs.State("v", 0, f"2 + {load} - x - f")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.1})],
    )
    late = {"x": 2.0, "v": 0.0}
    sol = hs.simulate(model, (8000, 8010), x0=late, integrator="dop853")
    assert sol.status == "finished" and sol.y[0, -1] == 2.0
    if "x" not in load:
        early = [hs.simulate(model, (0, 30), integrator=name) for name in ("exact", "taylor")]
        times = [[e.t for e in run.events] for run in early]
        assert len(times[0]) > 2 and times[0] == pytest.approx(times[1], rel=1e-7)
