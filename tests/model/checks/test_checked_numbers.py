"""Numbers and switches of declared parts are checked when the part is made, or when its model is validated."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hybridsim as hs

TABLE = {"name": "measured", "slip": "mu*N", "stick": "mu*N"}


def sliding(law: hs.FrictionLaw) -> hs.Model:
    """A block under a law."""
    states = [hs.State("v", 1, "-f")]
    return hs.Model("block", states=states, contacts=[hs.Contact("f", velocity="v", normal=1, law=law)])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: hs.State("x", 0, 1, place="here"), "State: `place` cannot be 'here'"),
        (lambda: hs.Contact("f", "v", 1, "coulomb", {"mu": 1}, opens="yes"), "`opens` cannot be 'yes'"),
        (lambda: hs.Contact("f", "v", 1, "coulomb", {"mu": 1}, nominal=3), "`nominal` cannot be 3"),
        (lambda: hs.Schedule("s", period=1, count=2.5), "`count` cannot be 2.5"),
        (lambda: hs.Schedule("s", times=[1], terminate=1), "`terminate` cannot be 1"),
        (lambda: hs.FrictionLaw("a", slip="mu", stick="mu", parameters=[["mu"]]), "`parameters` cannot be"),
        (lambda: hs.LawTable("mu", at=[0, 10**400], values=[1, 2]), "`at` cannot be"),
        (lambda: hs.Harmonic(math.nan), "Harmonic: `omega` cannot be nan"),
        (lambda: hs.Harmonic(1.0, sin=math.inf), "Harmonic: `sin` cannot be inf"),
        (lambda: hs.Harmonic(1.0, cos=1j), "Harmonic: `cos` cannot be 1j"),
        (lambda: hs.MechanicalSystem([1.0], None, None, q0=[1j]), "`q0` cannot be"),
        (lambda: hs.MechanicalSystem([[1, 2], [3]], None, None), "`M` cannot be"),
        (lambda: hs.MechanicalSystem([10**400], None, None), "`M` cannot be"),
        (lambda: hs.MechanicalSystem([], None, None), "M is empty"),
        (lambda: hs.MechanicalSystem([1.0], None, None, contacts=[3]), "contacts contain 3"),
        (lambda: hs.MechanicalSystem([1.0], None, None, forcing=[math.inf]), "contains inf"),
        (lambda: hs.MechanicalContact("f", {"a": 1.0}, 1.0, "coulomb"), "coordinate 'a'"),
    ],
)
def test_a_wrong_value_is_named(make: Callable[[], Any], says: str) -> None:
    with pytest.raises(hs.UsageError, match=says):
        make()


@pytest.mark.parametrize("nominal", [0, -1, math.nan, math.inf, 10**400])
def test_a_size_that_is_not_above_zero_is_refused_with_the_model(nominal: float) -> None:
    with pytest.raises(hs.ModelError, match="'nominal' cannot be"):
        hs.Model("m", states=[hs.State("x", 0, 1, nominal=nominal)]).validate()


@pytest.mark.parametrize(
    "mass",
    [
        np.array([0.0, 1.0]),
        np.array([[1.0, 1.0], [1.0, 1.0]]),
        np.array([[1.0, 2.0], [2.0, 1.0]]),
        np.outer([0.1, 0.7, 0.3], [0.1, 0.7, 0.3]) + np.outer([0.3, -0.1, 0.9], [0.3, -0.1, 0.9]),
    ],
)
def test_a_mass_matrix_that_is_not_positive_definite_is_refused_at_once(mass: np.ndarray) -> None:
    """The last one has rank 2 of 3, so that in exact arithmetic its determinant is zero."""
    with pytest.raises(hs.UsageError, match="M is not positive definite"):
        hs.MechanicalSystem(mass, None, None)


def test_random_mass_matrices_are_judged_as_their_eigenvalues_say() -> None:
    random = np.random.default_rng(3)
    for _ in range(60):
        n = int(random.integers(2, 9))
        root = random.normal(size=(n, n))
        mass = root @ root.T + 0.1 * np.eye(n)
        hs.MechanicalSystem(mass, None, None)
        values, vectors = np.linalg.eigh(mass)
        values[0] = -values[0]
        turned = (vectors * values) @ vectors.T
        with pytest.raises(hs.UsageError, match="M is not positive definite"):
            hs.MechanicalSystem((turned + turned.T) / 2, None, None)


def test_tables_over_the_speed_begin_at_rest() -> None:
    table = hs.LawTable("mu", at=[-1, 0, 1], values=[0.5, 0.4, 0.5])
    with pytest.raises(hs.ModelError, match=r"the point -1 is negative, but v is the absolute speed"):
        sliding(hs.FrictionLaw(**TABLE, tables=[table])).validate()


def test_a_table_that_turns_friction_into_a_drive_is_refused() -> None:
    table = hs.LawTable("mu", at=[0, 1, 2], values=[0.5, -0.1, 0.5])
    with pytest.raises(hs.ModelError, match=r"the slip force at v = 1 cannot be -0\.1"):
        sliding(hs.FrictionLaw(**TABLE, tables=[table])).validate()


@pytest.mark.parametrize("name", ["v", "f"])
def test_an_event_is_not_called_as_something_else(name: str) -> None:
    states = [hs.State("v", 1, "-f")]
    contact = hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.5})
    monitor = hs.Monitor(name, "v - 0.5")
    with pytest.raises(hs.ModelError, match=f"the monitor '{name}' has the name of a"):
        hs.Model("m", states=states, contacts=[contact], monitors=[monitor]).validate()


def test_a_span_of_no_length_is_pointed_out() -> None:
    sol = hs.simulate(hs.Model("m", states=[hs.State("x", 1, "-x")]), (1, 1))
    assert sol.success
    assert sol.warnings == ("`t_span` begins and ends at 1.0, so nothing was integrated",)


def test_the_imaginary_part_of_a_start_is_not_dropped() -> None:
    model = hs.Model("m", states=[hs.State("x", 1, "-x")])
    for x0 in ([1 + 1j], np.array([1 + 1j]), {"x": np.complex128(1 + 1j)}):
        with pytest.raises(hs.UsageError, match="x0"):
            hs.simulate(model, (0, 1), x0=x0)
