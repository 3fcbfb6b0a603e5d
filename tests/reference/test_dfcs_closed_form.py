"""The closed-form oscillator against published facts, against 30 digits, and against its equations."""

from __future__ import annotations

import math
import random

import pytest

from hybridsim.testing.facts import CASES
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Motion, Oscillator, Undecided

FACTS = list(CASES.values())
OSCILLATORS = [c for c in FACTS if c["id"].startswith(("FLAG-", "DH-", "DHV-", "FREE-", "THR-"))]
MANY_DIGITS = multiprecision(30)


def follow(case: dict, **numbers: object) -> Motion:
    p = case["params"]
    system = Oscillator(*(p[name] for name in ("m", "c", "k", "Fs", "Fk", "F0", "w")), **numbers)
    return system.run(*case["t_span"], *case["x0"])


def dfcs(F0: float, ratio: float, **numbers: object) -> tuple[Motion, float]:
    w = ratio * math.sqrt(1e5 / 0.2)
    period = 2 * math.pi / w
    return Oscillator(0.2, 5.65, 1e5, 20, 20, F0, w, **numbers).run(0, 100 * period, 0), period


@pytest.mark.parametrize("case", OSCILLATORS, ids=lambda c: c["id"])
def test_facts(case: dict) -> None:
    motion, fact, t1 = follow(case), case["expected"], case["t_span"][1]
    changes = motion.changes
    if "events" in fact:
        assert len(changes) == fact["n_events"]
        for change, event in zip(changes, fact["events"][1:], strict=False):
            assert change.mode == event["mode"]
            assert change.t == pytest.approx(event["t"], abs=5e-14)
            assert change.x == pytest.approx(event["x"], abs=5e-14)
    for t, state in fact.get("samples", {}).items():
        x, v = (state["x"], state["v"]) if isinstance(state, dict) else state
        assert motion.state(float(t))[:2] == pytest.approx((x, v), abs=5e-14)
    for change, (t, x) in zip(changes, fact.get("turning_points", ()), strict=False):
        assert (change.t, change.x) == pytest.approx((t, x), abs=5e-14)
    if "x_end" in fact:
        assert motion.state(t1)[:2] == pytest.approx((fact["x_end"], fact["v_end"]), abs=5e-14)
    if "amplitude_last_cycle" in fact:
        period = 2 * math.pi / case["params"]["w"]
        assert motion.amplitude(t1 - period, t1) == pytest.approx(fact["amplitude_last_cycle"], abs=2e-12)
        assert all(change.mode for change in changes if change.t > t1 - period)
    if "stop_time" in fact:
        assert (changes[-1].t, changes[-1].x) == pytest.approx((fact["stop_time"], fact["x_stop"]), abs=5e-14)
        assert changes[-1].mode == 0


@pytest.mark.parametrize(("F0", "ratio", "count"), [(30, 0.6, 401), (22, 0.64, 400)])
def test_dfcs_over_a_hundred_periods(F0: float, ratio: float, count: int) -> None:
    (motion, period), (exact, _) = dfcs(F0, ratio), dfcs(F0, ratio, numbers=MANY_DIGITS)
    assert len(motion.changes) == len(exact.changes) == count
    for a, b in zip(motion.changes, exact.changes, strict=True):
        assert a.mode == b.mode
        assert abs(a.t - b.t) < 4e-14 * period  # 100 periods: half an ulp of the time is 1.4e-14 periods
        assert abs(a.x - b.x) < 1e-13 * abs(exact.amplitude(99 * period, 100 * period))


def draw(seed: int) -> tuple[tuple[float, ...], float]:
    pick = random.Random(seed)
    m, k = 10 ** pick.uniform(-1, 1), 10 ** pick.uniform(-1, 2)
    zeta = pick.choice([0.0, 10 ** pick.uniform(-3, -0.5), 1.0, pick.uniform(1, 5)])
    kinetic = pick.uniform(0.05, 1.0)
    static = kinetic * pick.choice([1.0, pick.uniform(1, 1.5)])
    w = math.sqrt(k / m) * 10 ** pick.uniform(-1, 0.7)
    return (m, 2 * zeta * math.sqrt(k * m), k, static, kinetic, 1.0, w), pick.uniform(-1, 1) / k


@pytest.mark.parametrize("seed", range(40))
def test_random_oscillators(seed: int) -> None:
    parameters, x0 = draw(seed)
    span = 6 * 2 * math.pi / parameters[-1]
    exact = Oscillator(*parameters, numbers=MANY_DIGITS).run(0, span, x0)
    try:
        motion = Oscillator(*parameters).run(0, span, x0)
    except Undecided:
        return  # the double run may decline to decide; it may not decide wrongly
    scale = max(abs(p.x) for p in exact.pieces) + 1e-30
    assert [c.mode for c in motion.changes] == [c.mode for c in exact.changes]
    for a, b in zip(motion.changes, exact.changes, strict=True):
        assert abs(a.t - b.t) < 1e-11 * span
        assert abs(a.x - b.x) < 1e-11 * scale
    check_equations(exact, span)


def check_equations(motion: Motion, span: float) -> None:
    """Sampled densely: the mode's sign of v, the cone in stick, the equation of motion, continuity."""
    o, num = motion.system, motion.system.numbers
    tiny, ends = num.number(10) ** -20, (*motion.starts[1:], num.number(span))
    for piece, start, end in zip(motion.pieces, motion.starts, ends, strict=True):
        length = end - start
        for i in range(1, 12):
            tau = length * i / 12
            x, v = piece.state(tau)
            e = o.F0 * num.sin(piece.phase + o.w * tau) - o.k * x
            if piece.mode == 0:
                assert v == 0 and abs(e) <= o.Fs + tiny
                continue
            assert piece.mode * v > 0
            h = length * num.number(10) ** -8
            slope = (piece.state(tau + h)[1] - piece.state(tau - h)[1]) / (2 * h)
            force = e - o.c * v - piece.mode * o.Fk
            assert abs(o.m * slope - force) < 1e-10 * (abs(force) + 1)
        x, v = piece.state(length)
        later = [p for p, s in zip(motion.pieces, motion.starts, strict=True) if s == end]
        if later:
            assert abs(x - later[0].x) < tiny * (1 + abs(x)) and abs(v) < tiny * (1 + abs(v))


def test_a_force_that_only_touches_the_limit_does_not_release() -> None:
    assert Oscillator(1, 0, 1, 1, 1, 1, 0.5).run(0, 1000, 0).changes == ()


def test_a_very_short_slip_is_found() -> None:
    """A force one part in 1e9 over the limit: slip lasts about 3 sqrt(2e-9) of phase and moves by 1e-13."""
    parameters = (1, 0.1, 1, 1 - 1e-9, 1 - 1e-9, 1, 0.5)
    motion = Oscillator(*parameters).run(0, 12, 0)
    exact = Oscillator(*parameters, numbers=MANY_DIGITS).run(0, 12, 0)
    assert [c.mode for c in motion.changes] == [c.mode for c in exact.changes] == [1, 0, -1, 0]
    first, stop = motion.changes[:2]
    assert (stop.t - first.t) * 0.5 == pytest.approx(3 * math.sqrt(2e-9), rel=1e-3)
    assert abs(stop.x - exact.changes[1].x) < 1e-4 * stop.x


def test_a_million_periods_cost_no_digits() -> None:
    """Started at a whole number of periods, the motion is the one started at zero, shifted."""
    w, turns = 0.3, 10**6
    late = 2 * math.pi / w * turns
    early_motion = Oscillator(1, 0.1, 1, 0.4, 0.4, 1, w).run(0, 60, 0)
    start_phase = Oscillator(1, 0.1, 1, 0.4, 0.4, 1, w).numbers.phase(w, late)[1]
    late_motion = Oscillator(1, 0.1, 1, 0.4, 0.4, 1, w).run(late, late + 60, 0)
    assert min(start_phase, 2 * math.pi - start_phase) < 1e-8
    for a, b in zip(early_motion.changes, late_motion.changes, strict=True):
        assert abs(a.phase - b.phase) < 1e-14 + 4e-16 * 10 and a.mode == b.mode and b.turns - a.turns == turns


def test_undamped_resonance_grows() -> None:
    """Above F0/Fk = 4/pi Coulomb friction cannot hold an undamped oscillator driven at its own frequency."""
    motion = Oscillator(1, 0, 1, 0.5, 0.5, 1, 1).run(0, 200, 0)
    exact = Oscillator(1, 0, 1, 0.5, 0.5, 1, 1, numbers=MANY_DIGITS).run(0, 200, 0)
    assert abs(motion.state(200)[0] - exact.state(200)[0]) < 1e-11
    assert motion.amplitude(190, 200) > 30
