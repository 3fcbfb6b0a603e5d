"""An orbit along which a guard is zero at all times is on the boundary of its mode, and no motion reaches it."""

from __future__ import annotations

from math import exp, log

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
