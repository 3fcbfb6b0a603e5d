"""Rest, steady sliding and eigenvalues against closed forms, and the onset of squeal against a simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError


def test_steady_sliding_on_the_belt() -> None:
    """k x = Fs/(1 + delta v); the slope of friction there is -delta Fs/(1 + delta v)^2, and drives the block."""
    found = hs.linearize("belt", "slip-")
    slope = 3.0 / 1.6**2
    assert found.is_equilibrium and found.admissible and not found.stable
    assert np.allclose(found.x, [1.0 / 1.6, 0.0], rtol=1e-15, atol=0)
    assert found.growth == pytest.approx(0.5 * slope, rel=1e-14)
    assert found.frequencies[0] == pytest.approx(math.sqrt(1.0 - 0.25 * slope**2), rel=1e-14)
    assert found.damping_ratios[0] == pytest.approx(-0.5 * slope, rel=1e-14)


def test_where_a_block_can_rest() -> None:
    """|k x| <= mu N: an interval of rest, and no equilibrium of sliding."""
    (found,) = hs.equilibria("free-decay", params={"k": 4.0})
    assert found.modes == {"f": "stick"}
    assert (found.low[0], found.high[0]) == pytest.approx((-0.25, 0.25), rel=1e-12)
    assert (found.low[1], found.high[1]) == (0.0, 0.0)
    assert not found.is_point


def test_a_pulled_slider_can_slide_but_not_rest() -> None:
    (found,) = hs.equilibria("static-kinetic")
    assert found.modes == {"f": "slip+"}
    assert found.is_point
    assert found.x == pytest.approx([0.03, 0.01], rel=1e-12)  # mu_k N/k, v_pull


def test_two_blocks_rest_within_what_springs_and_friction_allow() -> None:
    """k1 x1 + k12 (x1 - x2) within +-1, k12 (x2 - x1) within +-2: extreme positions by hand."""
    model = hs.Model(
        "two",
        parameters={"k1": 1.0, "k12": 2.0},
        states=[
            hs.State("x1", start=0, der="v1"),
            hs.State("v1", start=0, der="-k1*x1 - k12*(x1 - x2) - f1"),
            hs.State("x2", start=0, der="v2"),
            hs.State("v2", start=0, der="-k12*(x2 - x1) - f2"),
        ],
        contacts=[
            hs.Contact("f1", velocity="v1", normal="1", law="coulomb", arguments={"mu": 1}),
            hs.Contact("f2", velocity="v2", normal="2", law="coulomb", arguments={"mu": 1}),
        ],
    )
    resting = [e for e in hs.equilibria(model) if set(e.modes.values()) == {"stick"}]
    (found,) = resting
    # x1 = a - b with a = k1 x1 + k12 (x1 - x2) in +-1 and b = k12 (x1 - x2) in +-2
    assert found.high[0] == pytest.approx(3.0, rel=1e-12)
    assert found.high[2] == pytest.approx(3.0 + 1.0, rel=1e-12)  # x2 = x1 - b/k12, b = -2
    assert found.low == pytest.approx(-found.high, rel=1e-12)


@pytest.mark.parametrize("mu", [0.5, 0.74, 0.7501, 0.9])
def test_mode_coupling_sets_in_at_three_quarters(mu: float) -> None:
    """Without damping s^2 = -2 +- sqrt(1 - 4 mu/3): the frequencies meet at mu = 3/4, and a pair grows beyond."""
    found = hs.linearize("mode-coupling", "slip-", params={"mu": mu, "c": 0.0})
    root = np.sqrt(complex(1.0 - 4.0 * mu / 3.0))
    expected = np.array([sign * np.sqrt(-2.0 + side * root) for sign in (1, -1) for side in (1, -1)])
    assert found.is_equilibrium
    for value in expected:
        assert np.abs(found.eigenvalues - value).min() <= 1e-12
    assert found.growth == pytest.approx(max(expected.real.max(), 0.0), abs=1e-13)


@pytest.mark.parametrize("mu", [0.755, 0.8])
def test_the_simulation_grows_at_the_rate_of_the_linearisation(mu: float) -> None:
    model = hs.load("mode-coupling").with_(mu=mu)
    found = hs.linearize(model, "slip-")
    run = hs.simulate(model, (0.0, 60.0), x0=(found.x + [1e-9, 0, 0, 0]).tolist())
    assert not run.events
    values, vectors = found.eigenvalues, found.eigenvectors
    at_start = np.linalg.solve(vectors, np.array([1e-9, 0, 0, 0]))
    expected = (vectors @ (at_start * np.exp(values * 60.0))).real
    assert np.abs(run.y[:, -1] - found.x - expected).max() <= 1e-5 * np.abs(expected).max()


def test_onset_by_the_sign_of_the_growth_and_by_simulation() -> None:
    """With damping c the pair grows above mu = 3/4 (1 + 2 c^2); linearisation finds it, runs on both sides agree."""
    model = hs.load("mode-coupling")

    def grows(mu: float) -> bool:
        changed = model.with_(mu=mu)
        start = hs.linearize(changed, "slip-").x
        run = hs.simulate(changed, (0.0, 1500.0), x0=(start + [1e-6, 0, 0, 0]).tolist())
        return bool(run.events) or bool(np.abs(run.y[0, -1] - start[0]) > 1e-6)

    low, high = 0.7, 0.9
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle) if hs.linearize(model.with_(mu=middle), "slip-").growth > 0 else (middle, high)
        )
    assert low == pytest.approx(0.75 * (1.0 + 2.0 * 0.1**2), abs=1e-9)
    assert not grows(low - 0.005)
    assert grows(high + 0.005)


def test_bad_questions_are_refused() -> None:
    with pytest.raises(UsageError, match="has forcing"):
        hs.equilibria("dfcs")
    with pytest.raises(UsageError, match="'slide'"):
        hs.linearize("belt", "slide")
    with pytest.raises(UsageError, match="has no entry"):
        hs.linearize("belt")


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_rest_is_found_in_any_unit(size: float) -> None:
    """Nothing is said of nominal sizes, and rounding leaves a velocity of 1e-17 where it should be 0."""
    draw = np.random.default_rng(4)
    for _ in range(40):
        ka, kb, kc = draw.uniform(1, 20, 3)
        load = size * draw.uniform(-5, 5, 2)
        model = hs.Model(
            "two",
            [
                hs.State("x1", 0, "v1"),
                hs.State("v1", 0, f"{load[0]} - {ka}*x1 - {kb}*(x1 - x2) - 0.1*v1"),
                hs.State("x2", 0, "v2"),
                hs.State("v2", 0, f"{load[1]} - {kc}*x2 - {kb}*(x2 - x1) - 0.1*v2"),
            ],
        )
        (found,) = hs.equilibria(model)
        expected = np.linalg.solve([[ka + kb, -kb], [-kb, kb + kc]], load)
        assert found.x[[0, 2]] == pytest.approx(expected, rel=1e-12)
        assert found.x[[1, 3]].tolist() == [0.0, 0.0]
        assert found.growth == pytest.approx(-0.05, rel=1e-9)
        assert hs.linearize(model).is_equilibrium


def test_steady_sliding_of_two_blocks_is_found() -> None:
    """mu_k N of each, held by the springs; the belt drags them off again: it is not stable."""
    (found,) = hs.equilibria(hs.two_blocks_on_belt().to_model())
    assert found.modes == {"f1": "slip-", "f2": "slip-"}
    assert found.x[[1, 3]].tolist() == [0.0, 0.0]
    assert found.growth > 0.0


def test_where_no_rest_is_found_it_is_said_how_to_go_on() -> None:
    adrift = hs.Model("adrift", [hs.State("x", 0, "v"), hs.State("v", 1, "1 + v*v")])
    assert hs.equilibria(adrift) == ()
    with pytest.raises(hs.SimulationError, match=r"from its initial state\n.*nominal") as caught:
        hs.linearize(adrift)
    assert "in the modes" not in str(caught.value)


@pytest.mark.parametrize(
    ("rate", "at", "growth"), [("-x - 0.5*abs(x)", 0.0, -0.5), ("2 - 2*x - abs(x - 1)", 1.0, -1.0)]
)
def test_a_point_on_a_corner_is_one_equilibrium(rate: str, at: float, growth: float) -> None:
    """Its growth is the larger of both slopes: -1.5 and -0.5, or -3 and -1."""
    (found,) = hs.equilibria(hs.Model("corner", states=[hs.State("x", 0.5, rate)]))
    assert found.x == pytest.approx([at]) and found.growth == pytest.approx(growth)
