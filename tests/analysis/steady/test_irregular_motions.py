"""Motions that do not repeat: on a torus a small change varies for hundreds of periods, and does not grow."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


@pytest.mark.parametrize("period", [math.sqrt(2.0), 10.0 * math.sqrt(2.0)])
@pytest.mark.parametrize("ratio", [6.0, 30.0])
@pytest.mark.parametrize("max_periods", [64, 128])
def test_a_torus_with_an_uneven_speed_is_quasi_periodic(
    period: float, ratio: float, max_periods: int
) -> None:
    """On a circle angle' = w + a sin(angle), with a forced state with the period 1.

    A change of the angle is proportional to angle', so that its size varies by the ratio (w + a)/(w - a). The angle
    has the period 2 pi/sqrt(w^2 - a^2), which has no common multiple with 1.
    """
    part = (ratio - 1.0) / (ratio + 1.0)
    w = 2.0 * math.pi / period / math.sqrt(1.0 - part**2)
    model = hs.Model(
        "torus",
        parameters={"w": w, "a": part * w},
        states=[
            hs.State("x", 1, "x*(1 - x**2 - y**2) - y*(w + a*y)"),
            hs.State("y", 0, "y*(1 - x**2 - y**2) + x*(w + a*y)"),
            hs.State("z", 0, "cos(2*pi*t) - z"),
        ],
    )
    found = hs.steady_state(model, max_periods=max_periods)
    assert found.kind == "quasi-periodic"
    assert abs(found.lyapunov) < 1e-3


def test_a_torus_near_a_common_period_is_not_chaotic() -> None:
    """A van der Pol oscillator with a weak force: two motions 1e-6 apart are as close after 3000 periods."""
    model = hs.Model(
        "van-der-pol",
        parameters={"omega": 1.48},
        states=[
            hs.State("x", 1.873, "v", nominal=1),
            hs.State("v", 0, "0.1383*sin(omega*t) + 1.138*(1 - x**2)*v - x", nominal=1),
        ],
    )
    end = 3000 * 2.0 * math.pi / 1.48
    runs = [hs.simulate(model, (0, end), x0={"x": x}, keep="nothing", rtol=1e-11) for x in (1.873, 1.873001)]
    assert abs(runs[1].y[:, -1] - runs[0].y[:, -1]).max() < 1e-5
    found = hs.steady_state(model, max_periods=256)
    assert found.kind == "quasi-periodic"


@pytest.mark.parametrize("max_periods", [128, 1024])
def test_a_block_that_slips_ever_less_is_not_quasi_periodic(max_periods: int) -> None:
    """Asymmetric friction: the block creeps towards mu_backward - F, where its force only just reaches the limit.

    Its distance from there is about 1/k after k periods. Successive changes of it are not those of a torus.
    """
    model = hs.Model(
        "ratchet",
        parameters={"omega": 2.442},
        states=[hs.State("x", 1.238, "v"), hs.State("v", 0, "1.002*sin(omega*t) - 0.17162*v - x - f")],
        contacts=[
            hs.Contact("f", "v", 1, "asymmetric", arguments={"mu_forward": 1.41, "mu_backward": 0.6885})
        ],
    )
    found = hs.steady_state(model, max_periods=max_periods)
    assert found.kind in ("not settled", "equilibrium")
    assert found.solution.y[0, -1] == pytest.approx(0.6885 - 1.002, abs=0.02)


@pytest.mark.parametrize("tol", [1e-8, 1e-10])
def test_a_stable_orbit_that_the_motion_does_not_reach_is_not_returned(tol: float) -> None:
    """A mass on a belt with forcing has a stable orbit of amplitude 0.44, and from x = -0.5482 a torus beyond it.

    A plain run has an amplitude above 1 at all times after 20 periods.
    """
    model = hs.Model(
        "belt",
        parameters={"omega": 1.556},
        states=[
            hs.State("x", -0.5482, "v"),
            hs.State("v", 0, "0.626*sin(omega*t) - 0.08172*v - x - f"),
        ],
        contacts=[
            hs.Contact(
                "f", "v - 1.329", 1, "stribeck", arguments={"mu_s": 0.6397, "mu_k": 0.2073, "v_s": 0.3593}
            )
        ],
    )
    period = 2.0 * math.pi / 1.556
    plain = hs.simulate(model, (0, 300 * period), integrator="dop853", rtol=1e-11)
    for k in range(20, 300, 10):
        x = plain(np.linspace((k - 6) * period, k * period, 600))[0]
        assert 0.5 * np.ptp(x) > 1.0
    found = hs.steady_state(model, tol=tol, max_periods=128)
    assert found.kind in ("quasi-periodic", "not settled")
    near = hs.steady_state(model, x0={"x": 0.18, "v": -0.68}, tol=tol)
    assert near.kind == "periodic" and near.amplitude["x"] == pytest.approx(0.4390042817, rel=1e-7)
