"""What each packaged model says to look at is there to be seen."""

from __future__ import annotations

import itertools
import math

import pytest

import hybridsim as hs


def events(model: hs.Model, t1: float, component: str | None = None) -> list[hs.Event]:
    """Mode changes of a run from rest, of one component or all."""
    solution = hs.simulate(model, (0.0, t1))
    assert solution.success, solution.message
    return [e for e in solution.events if e.kind == "transition" and component in (None, e.component)]


def lengths(model: hs.Model, t1: float) -> list[tuple[str, float]]:
    """Modes of the friction force with their lengths, the last, unfinished one left out."""
    return [(piece.mode, piece.t1 - piece.t0) for piece in hs.simulate(model, (0.0, t1)).modes["f"]][:-1]


def test_dfcs() -> None:
    model = hs.load("dfcs")
    p = model.parameter_values()
    period = 2 * math.pi / p["omega"]
    first = events(model, 0.5 * period)[0]
    assert first.t == pytest.approx(math.asin(p["mu"] * p["N"] / p["F0"]) / p["omega"], rel=1e-9)
    assert [mode for mode, _ in lengths(model, 30 * period)][-4:].count("stick") == 2


def test_dfcs_stribeck() -> None:
    model = hs.load("dfcs-stribeck")
    period = 2 * math.pi / model.parameter_values()["omega"]
    for name, share in (("dfcs", 0.058), ("dfcs-stribeck", 0.049)):
        stops = [length for mode, length in lengths(hs.load(name), 40 * period) if mode == "stick"]
        assert stops[-1] / period == pytest.approx(share, abs=5e-4)
    same = hs.simulate(model.with_(mu_s=0.5, mu_k=0.5), (0, 5 * period))
    plain = hs.simulate(hs.load("dfcs"), (0, 5 * period))
    assert same.y[:, -1] == pytest.approx(plain.y[:, -1], rel=1e-6)


def test_belt() -> None:
    found = events(hs.load("belt"), 60.0)
    releases = [e.t for e in found if e.source == "stick"]
    assert all(e.x_plus[0] == pytest.approx(1.0, rel=1e-9) for e in found if e.source == "stick")
    assert all(e.x_plus[1] == 0.2 for e in found)
    # The reference value was recomputed with two step sizes.
    assert [b - a for a, b in itertools.pairwise(releases)] == pytest.approx(
        [12.00103129483054] * 4, abs=1e-6
    )


def test_free_decay() -> None:
    found = events(hs.load("free-decay"), 30.0)
    assert [e.t / math.pi for e in found] == pytest.approx([1, 2, 3, 4, 5], rel=1e-8)
    assert [e.x_plus[0] for e in found] == pytest.approx([-8.5, 6.5, -4.5, 2.5, -0.5], rel=1e-8)
    assert found[-1].target == "stick"


def test_static_kinetic() -> None:
    model = hs.load("static-kinetic")
    p = model.parameter_values()
    spring = {e.target: p["k"] * e.x_plus[0] for e in events(model, 30.0)}
    assert spring["slip+"] == pytest.approx(p["mu_s"] * p["N"], rel=1e-9)
    assert spring["stick"] == pytest.approx((2 * p["mu_k"] - p["mu_s"]) * p["N"], rel=1e-6)


def test_bouncing_ball() -> None:
    model = hs.load("bouncing-ball")
    found = events(model, 5.0)
    fall = math.sqrt(2 / 9.81)
    times = [fall * (1 + 2 * sum(0.7**k for k in range(1, n + 1))) for n in range(11)]
    assert [e.t for e in found] == pytest.approx(times, rel=1e-9)
    assert [e.target for e in found] == ["flight"] * 10 + ["rest"]
    assert times[-1] == pytest.approx(2.49911, abs=1e-5)
    endless = hs.simulate(model.with_(v_rest=0), (0, 5))
    assert endless.events[-1].target == "rest"
    assert endless.events[-1].t == pytest.approx(fall * (1 + 2 * 0.7 / 0.3), rel=1e-9)
    assert fall * (1 + 2 * 0.7 / 0.3) == pytest.approx(2.55863, abs=1e-5)


def test_thermostat() -> None:
    model = hs.load("thermostat")
    p = model.parameter_values()
    room = p["T_out"] + p["q"]
    heating = p["tau"] * math.log((room - p["T_low"]) / (room - p["T_high"]))
    cooling = p["tau"] * math.log((p["T_high"] - p["T_out"]) / (p["T_low"] - p["T_out"]))
    times = [e.t for e in events(model, 8.0)]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert gaps == pytest.approx([cooling if k % 2 == 0 else heating for k in range(len(gaps))], rel=1e-8)


def test_square_wave() -> None:
    model = hs.load("square-wave")
    released = [e.t for e in events(model, 2.0) if e.source == "stick"]
    assert released[-2:] == [0.6, 1.2]  # by the switches of the force, at their times to the last bit
    still = hs.simulate(model.with_(F0=2.9), (0, 6))
    assert still.modes["f"][0].mode == "stick" and len(still.modes["f"]) == 1
    assert not still.y.any()


def test_sampled_servo() -> None:
    model = hs.load("sampled-servo")
    run = hs.simulate(model, (0, 16))
    stops = [e for e in run.events if e.kind == "transition" and e.target == "stick" and e.t > 7]
    errors = [0.1 - e.x_plus[0] for e in stops]
    assert [abs(error) for error in errors] == pytest.approx([0.0043] * len(errors), abs=1e-4)
    assert all(a * b < 0 for a, b in itertools.pairwise(errors))
    assert [b.t - a.t for a, b in itertools.pairwise(stops)] == pytest.approx(
        [2.1] * (len(stops) - 1), abs=0.05
    )


def test_base_isolation() -> None:
    model = hs.load("base-isolation")
    run = hs.simulate(model, (0, 20))
    assert run.events[0].t == pytest.approx(1.086, abs=5e-4)
    stops = [e for e in run.events if e.target == "stick"]
    turns = [e for e in run.events if "stick" not in (e.source, e.target)]
    assert (len(stops), len(turns)) == (31, 2)
    assert stops[-1] is run.events[-1] and stops[-1].t == pytest.approx(13.77, abs=5e-3)
    assert run(20.0)[0] == pytest.approx(-8e-3, abs=5e-4)
    fixed = hs.simulate(model.with_(mu=10), (0, 20))
    assert not fixed.events
    assert abs(run.output("a_g")).max() == pytest.approx(3.4, abs=0.05)
    assert abs(run.output("acc")).max() == pytest.approx(2.05, abs=0.05)
    assert abs(fixed.output("acc")).max() == pytest.approx(11, abs=0.1)
