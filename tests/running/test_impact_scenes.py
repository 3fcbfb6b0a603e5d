"""The scenes of impacts against closed forms and zeros of parabolas found by SciPy."""

from __future__ import annotations

import math

import pytest
from scipy.optimize import brentq

import hybridsim as hs


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_the_table_throws_its_ball_at_one_phase(integrator: str) -> None:
    model = hs.load("vibrating-table")
    p = model.parameter_values()
    g, A, omega, e = (p[name] for name in ("g", "A", "omega", "e"))
    sol = hs.simulate(model, (0, 1), integrator=integrator, rtol=1e-11)
    assert sol.success
    bounces = [event for event in sol.events if event.component == "p"]
    thrown = [event for event in bounces if event.source == "closed"]
    phase = math.asin(g / (A * omega**2))
    assert len(thrown) >= 4
    for event in thrown:
        turns = (event.t * omega - phase) / (2 * math.pi)
        assert turns == pytest.approx(round(turns), abs=1e-9)
    # the flight from there to the first bounce, and the one after it
    t, h, w = thrown[0].t, A * math.sin(phase), A * omega * math.cos(phase)
    after = [event for event in bounces if event.t > t]
    for event in after[:2]:
        start = 1e-6 if event is after[0] else 1e-4

        def gap(s: float, t: float = t, h: float = h, w: float = w) -> float:
            return h + w * s - g * s * s / 2 - A * math.sin(omega * (t + s))

        assert gap(start) > 0
        s = brentq(gap, start, 2 * (event.t - t), xtol=1e-15)
        assert event.t == pytest.approx(t + s, rel=1e-10)
        t, h, approach = t + s, A * math.sin(omega * (t + s)), w - g * s
        table = A * omega * math.cos(omega * t)
        w = table - e * (approach - table)
        assert event.x_plus == pytest.approx([h, w], rel=1e-8)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_the_thrown_block_stops_where_its_impulses_say(integrator: str) -> None:
    model = hs.load("thrown-block")
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 2), integrator=integrator, rtol=1e-11)
    fall = math.sqrt(2 * p["g"] * p["h0"])
    landed = fall / p["g"] * (1 + p["e"]) / (1 - p["e"])
    left = p["u0"] - p["mu"] * fall * (1 + p["e"]) / (1 - p["e"])
    (stop,) = [event for event in sol.events if event.target == "stick"]
    assert stop.t == pytest.approx(landed + left / (p["mu"] * p["g"]), rel=1e-9)
    assert sol(1.9)[1] == 0.0
    # work of friction in bounces and in sliding, and what the bounces themselves take, is all the energy there was
    assert sol(1.9)[2:] == pytest.approx([0.0, 0.0], abs=0)
    u, way = p["u0"], p["u0"] * fall / p["g"]
    speed = fall
    for _ in range(60):
        u -= p["mu"] * (1 + p["e"]) * speed
        speed *= p["e"]
        way += u * 2 * speed / p["g"]
    assert sol(1.9)[0] == pytest.approx(way + left**2 / (2 * p["mu"] * p["g"]), rel=1e-9)
