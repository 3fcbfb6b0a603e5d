"""An orbit along which a guard is zero at all times is on the boundary of its mode, and no motion reaches it."""

from __future__ import annotations

from math import exp, log, pi

import pytest

import hybridsim as hs

M, C, KP, KI, TS, TARGET, STATIC, KINETIC = 1.0, 20.0, 400.0, 4000.0, 1e-3, 0.1, 3.0, 2.0


def servo() -> hs.Model:
    """A sampled PI controller moves a mass with static above kinetic friction."""
    return hs.Model(
        "servo",
        parameters={"c": C, "kp": KP, "ki": KI, "Ts": TS, "target": TARGET},
        states=(
            hs.State("x", 0.0, "v", nominal=0.1),
            hs.State("v", 0.0, "u - c*v - f", nominal=0.1),
        ),
        discrete=(hs.Discrete("u", 0.0), hs.Discrete("I", 0.0)),
        definitions={"e": "target - x"},
        schedules=(
            hs.Schedule("tick", period="Ts", start=0.0, reset={"u": "kp*e + ki*(I + Ts*e)", "I": "I + Ts*e"}),
        ),
        contacts=(hs.Contact("f", "v", 1.0, "static-kinetic", arguments={"mu_s": STATIC, "mu_k": KINETIC}),),
    )


def moved(x: float, v: float, force: float, dt: float) -> tuple[float, float]:
    """x and v after dt under a constant force and the damping, in closed form."""
    end = force / C
    return x + end * dt + (v - end) * (1.0 - exp(-C * dt)) / C, end + (v - end) * exp(-C * dt)


def hunting() -> float:
    """The amplitude of x from 10 s to 20 s, by hand from tick to tick."""
    x = v = integral = 0.0
    seen = []
    for k in range(20000):
        e = TARGET - x
        u, integral, left = KP * e + KI * (integral + TS * e), integral + TS * e, TS
        while left > 0.0:
            if v == 0.0 and abs(u) <= STATIC:
                break
            force = u - (KINETIC if (v > 0.0 or (v == 0.0 and u > 0.0)) else -KINETIC)
            stop = log((v - force / C) / (-force / C)) / C if v * force < 0.0 else left + 1.0
            if stop <= left:
                (x, _), v, left = moved(x, v, force, stop), 0.0, left - stop
            else:
                (x, v), left = moved(x, v, force, left), 0.0
        if k >= 10000:
            seen.append(x)
    return 0.5 * (max(seen) - min(seen))


def test_a_drive_that_hunts_is_not_at_rest() -> None:
    """Slip with v = 0 and u = the kinetic friction is an orbit of the equations of slip, with multipliers below 1."""
    assert 1.6e-3 < hunting() < 1.9e-3
    found = hs.steady_state(servo())
    assert not found.success and found.kind == "not settled"


@pytest.mark.parametrize("tol", [1e-8, 1e-10, 1e-12])
def test_a_contact_whose_slips_vanish_sticks(tol: float) -> None:
    """The force of contact g reaches its limit once in a period. Its slips last 1.3 and move y by ever less.

    In a plain run y moves by less than 1e-12 after 40 periods, so that in the limit g sticks throughout.
    """
    friction = {"mu_s": 0.8146, "mu_k": 0.4888, "v_s": 0.2}
    model = hs.Model(
        "two-masses",
        parameters={"omega": 0.2625},
        states=[
            hs.State("x", -1.725, "v"),
            hs.State("v", 0, "0.8041*sin(omega*t) - 0.1319*v - x - 2.021*(x - y) - f"),
            hs.State("y", 0, "w"),
            hs.State("w", 0, "(2.021*(x - y) - 0.3*y - 0.1319*w - g)/0.3742"),
        ],
        contacts=[
            hs.Contact("f", "v", 0.7988, "stribeck", arguments=friction),
            hs.Contact("g", "w", 0.6414, "stribeck", arguments=friction),
        ],
    )
    period = 2.0 * pi / 0.2625
    plain = hs.simulate(model, (0, 100 * period), integrator="dop853", rtol=1e-11)
    assert abs(plain(100 * period)[2] - plain(40 * period)[2]) < 1e-12
    found = hs.steady_state(model, tol=tol)
    assert found.kind == "periodic" and "slips by less" not in found.message
    assert found.stick_fraction["g"] == 1.0
    assert found.multipliers[0] == pytest.approx(1.0, abs=1e-9)  # g may stick anywhere
