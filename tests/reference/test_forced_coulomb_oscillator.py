"""The exact motion against numbers computed elsewhere, and against what any exact motion must satisfy."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hybridsim.reference.closed_forms.forced_coulomb_oscillator import (
    SLIP_BACKWARD,
    SLIP_FORWARD,
    STICK,
    ForcedCoulombOscillator,
)

# Number of changes up to t = 100, the first and the last ones (time, mode, position), states at some times:
# exact solutions in 40-digit arithmetic, cross-checked with an independent Runge-Kutta run. m = k = F0 = 1.
STICK_SLIP = {
    "two stops a cycle": (
        {"damping": 0.1, "slip_force": 0.4, "stick_limit": 0.4, "frequency": 0.3},
        20,
        [
            (1.37172282022496, SLIP_FORWARD, 0.0),
            (5.826429882072151, STICK, 0.9252544191123313),
            (8.628595279842454, SLIP_BACKWARD, 0.9252544191123313),
        ],
        (98.30710582824207, STICK, -0.8154448448868299),
        {5.0: (0.8154424834500138, 0.25216068338566205), 25.0: (0.8420032779795676, 0.03780695032585147)},
    ),
    "static above kinetic": (
        {"damping": 0.1, "slip_force": 0.4, "stick_limit": 0.6, "frequency": 0.5},
        33,
        [
            (1.2870022175865687, SLIP_FORWARD, 0.0),
            (4.610118589635216, STICK, 1.0020149652703843),
            (5.455752485282521, SLIP_BACKWARD, 1.0020149652703843),
        ],
        None,
        {50.0: (-1.035655788058698, 0.45919520020651955), 100.0: (-1.141376992976597, 0.3376950350941286)},
    ),
    "undamped": (
        {"damping": 0.0, "slip_force": 0.8, "stick_limit": 0.8, "frequency": 0.75},
        49,
        [
            (1.2363936240021496, SLIP_FORWARD, 0.0),
            (3.4108099773656217, STICK, 0.19631761964883834),
            (5.052939636026555, SLIP_BACKWARD, 0.19631761964883834),
        ],
        None,
        {
            50.0: (-1.3054143718029554, 0.06995734285886582),
            100.0: (-1.3414577731503636, 0.017789450243140693),
        },
    ),
}


@pytest.mark.parametrize("case", STICK_SLIP.values(), ids=STICK_SLIP.keys())
def test_stick_slip_against_forty_digits(case) -> None:
    system, count, first, last, samples = case
    motion = ForcedCoulombOscillator(mass=1, stiffness=1, force=1, **system).motion(0, 0, (0, 100))
    changes = motion.changes
    assert motion.first_mode == STICK
    assert len(changes) == count
    listed = [*zip(changes, first), *([(changes[-1], last)] if last else [])]
    for change, (t, mode, x) in listed:
        assert change.target == mode
        assert (change.t, change.x) == pytest.approx((t, x), rel=0, abs=3e-14)
    for t, state in samples.items():
        assert motion(t) == pytest.approx(state, rel=0, abs=1e-14)


# Half a cycle of the symmetric motion without stops: start and end on the turning points (Den Hartog 1931).
@pytest.mark.parametrize(
    "w, f, x0, t0",
    [
        (2.0, 0.2, 0.31797973380564853, 2.203848163184646),
        (0.75, 0.3, 2.178184977433819, 2.504999549376764),
        (1.5, 0.5, 0.5537749241945386, 2.6041009671839688),
    ],
)
def test_den_hartog_orbit_closes(w: float, f: float, x0: float, t0: float) -> None:
    system = ForcedCoulombOscillator(1, 0, 1, f, f, force=1, frequency=w)
    turn = system.motion(x0, 0, (t0, t0 + 2 * math.pi / w)).changes[0]
    assert (turn.source, turn.target) == (SLIP_BACKWARD, SLIP_FORWARD)
    assert (turn.t, turn.x) == pytest.approx((t0 + math.pi / w, -x0), abs=1e-14)


# Amplitude of the steady motion without stops with viscous damping (Den Hartog 1931).
@pytest.mark.parametrize(
    "r, zeta, f, amplitude, t_end",
    [
        (0.5, 0.1, 0.1, 1.291061984107524, 779.1149780902687),
        (0.8, 0.05, 0.3, 2.3468719674220138, 1036.7255756846316),
        (1.0, 0.1, 0.4, 2.4500737983918293, 590.6194188748811),
        (1.4, 0.2, 0.3, 0.6574739474795802, 336.5992128846207),
        (1.0, 0.02, 0.5, 9.083537964026519, 2192.8316722056757),
    ],
)
def test_den_hartog_amplitude(r: float, zeta: float, f: float, amplitude: float, t_end: float) -> None:
    changes = ForcedCoulombOscillator(1, 2 * zeta, 1, f, f, 1, r).motion(0, 0, (0, t_end)).changes
    assert abs(changes[-1].x - changes[-2].x) / 2 == pytest.approx(amplitude, rel=1e-12)


def test_free_decay_stops_for_good() -> None:
    motion = ForcedCoulombOscillator(1, 0, 1, 1, 1).motion(10.5, 0, (0, 60))
    assert [c.t / math.pi for c in motion.changes] == pytest.approx([1, 2, 3, 4, 5], abs=1e-15)
    assert [c.x for c in motion.changes] == pytest.approx([-8.5, 6.5, -4.5, 2.5, -0.5], abs=1e-14)
    assert motion.changes[-1].target == STICK
    assert np.all(motion(np.linspace(16, 60, 99)) == [[motion.changes[-1].x], [0.0]])


def test_free_decay_from_a_moving_start() -> None:
    # Stop of the Siconos example FrictionOscillator, in closed form.
    motion = ForcedCoulombOscillator(1, 0, 1, 1, 1).motion(12, 6, (0, 100))
    first, last = motion.changes[0], motion.changes[-1]
    assert (first.t, first.x) == pytest.approx((0.43240777557053783, 13.317821063276353), rel=1e-14)
    assert (last.t, last.x) == pytest.approx((22.42355635069909, 0.6821789367236466), rel=1e-13)


@pytest.mark.parametrize("excess", [1e-2, 1e-5, 1e-8, 1e-11])
def test_release_close_to_the_top_of_the_forcing(excess: float) -> None:
    """Just above the limit the body slips for an instant: v = j s^2/2 - s^3/6 + ..., until s = 3 j."""
    limit = 1 - excess
    release, stop = ForcedCoulombOscillator(1, 0.1, 1, limit, limit, force=1).motion(0, 0, (0, 3)).changes[:2]
    assert (release.target, stop.target) == (SLIP_FORWARD, STICK)
    jerk = math.cos(math.asin(limit))
    assert stop.t - release.t == pytest.approx(3 * jerk, rel=2 * jerk + 1e-15 / jerk)
    assert release.t == pytest.approx(math.asin(limit), rel=1e-15)


def test_limit_equal_to_the_force_only_touches() -> None:
    assert ForcedCoulombOscillator(1, 0.1, 1, 1, 1, force=1).motion(0, 0, (0, 50)).changes == ()


def test_against_a_general_integrator_inside_each_phase() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        m, c, k, force, w, b = rng.uniform([0.5, 0, 0.5, 0.5, 0.3, -0.3], [2, 0.5, 3, 2, 2, 0.3])
        slip = rng.uniform(0.1, 0.8) * force
        system = ForcedCoulombOscillator(m, c, k, slip, slip * rng.uniform(1, 1.5), force, w, 0.7, b)
        motion = system.motion(*rng.uniform(-1, 1, 2), (1.0, 40.0))
        ends = [1.0, *(change.t for change in motion.changes), 40.0]
        modes = [motion.first_mode, *(change.target for change in motion.changes)]
        for start, end, mode in zip(ends[:-1], ends[1:], modes):
            friction = {SLIP_FORWARD: slip, SLIP_BACKWARD: -slip, STICK: None}[mode]
            t = np.linspace(start, end, 7)
            x, v = motion(t)
            if friction is None:
                push = b + force * np.sin(w * t + 0.7) - k * x
                assert np.all(v[:-1] == 0) and np.all(x[:-1] == x[0])  # at its end the slip has begun
                assert np.all(np.abs(push) <= system.stick_limit * (1 + 1e-12))
                continue

            rhs = functools.partial(_rate, system, friction)
            run = solve_ivp(rhs, (start, end), (x[0], v[0]), "DOP853", t, rtol=1e-12, atol=1e-13)
            assert run.y == pytest.approx(np.array([x, v]), abs=1e-10)
            assert np.all(v[1:-1] * friction > 0)


def _rate(system: ForcedCoulombOscillator, friction: float, t: float, y: np.ndarray) -> tuple[float, float]:
    drive = system.offset + system.force * math.sin(system.frequency * t + system.phase)
    return y[1], (drive - system.damping * y[1] - system.stiffness * y[0] - friction) / system.mass


def test_a_thousand_periods_keep_their_digits() -> None:
    """The steady motion repeats itself; what is left of the difference is the rounding of the time itself."""
    motion = ForcedCoulombOscillator(0.2, 5.65, 1e5, 20, 20, 30, 0.6 * math.sqrt(5e5)).motion(0, 0, (0, 14.8))
    changes = motion.changes
    period = 2 * math.pi / (0.6 * math.sqrt(5e5))
    assert len(changes) > 3990
    assert changes[-1].x == changes[-5].x
    assert changes[-1].t - changes[-401].t == pytest.approx(100 * period, rel=0, abs=4 * math.ulp(14.8))


@pytest.mark.parametrize(
    "change",
    [{"damping": 3.0}, {"stiffness": 0.0}, {"stick_limit": 0.1}, {"damping": 0.0, "frequency": 1.0}],
)
def test_what_has_no_such_form_is_refused(change: dict[str, float]) -> None:
    plain = {"mass": 1, "damping": 0.1, "stiffness": 1, "slip_force": 0.2, "stick_limit": 0.2, "force": 1}
    with pytest.raises(ValueError):
        ForcedCoulombOscillator(**{**plain, "frequency": 0.5, **change})
