"""Derivatives at any time against closed forms that mpmath differentiates."""

from __future__ import annotations

import pickle

import mpmath as mp
import numpy as np
import pytest
from known_slopes import ELSE, EXACT, check, slope

import hybridsim as hs


def ball(*, is_impact: bool) -> hs.Model:
    """A ball that bounces; its floor is an impact, or a guard with a reset."""
    parts = (
        {"impacts": [hs.Impact("floor", gap="h", restitution="e")]}
        if is_impact
        else {
            "components": [
                hs.Component(
                    "floor",
                    [hs.Mode("up", hs.Guard("hit", "h", hs.Choice("up", reset={"h": 0, "w": "-e*w"})))],
                    initial="up",
                )
            ]
        }
    )
    force = " + floor" if is_impact else ""
    return hs.Model(
        "ball",
        parameters={"h0": 1.0, "e": 0.8, "g": 9.8},
        states=[hs.State("h", "h0", "w", nominal=1), hs.State("w", 0, f"-g{force}", nominal=1)],
        **parts,
    )


def bounces(t: mp.mpf, h0: mp.mpf, e: mp.mpf, g: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
    """Height and speed of the ball."""
    fall = mp.sqrt(2 * h0 / g)
    if t < fall:
        return h0 - g * t * t / 2, -g * t
    begin, speed = fall, e * g * fall
    while t > begin + 2 * speed / g:
        begin, speed = begin + 2 * speed / g, e * speed
    return speed * (t - begin) - g * (t - begin) ** 2 / 2, speed - g * (t - begin)


@pytest.mark.parametrize("is_impact", [True, False], ids=["impact", "guard"])
def test_a_bouncing_ball(is_impact: bool) -> None:
    """The example ex1adj of PETSc: a ball on a floor, through four bounces."""
    solution = hs.simulate(ball(is_impact=is_impact), (0, 2.4), integrator="exact")
    assert len([event for event in solution.events if event.component == "floor"]) == 4
    forms = {"h": lambda t, **v: bounces(t, **v)[0], "w": lambda t, **v: bounces(t, **v)[1]}
    found = check(solution, forms, {"h0": 0, "e": 0, "g": 0}, [0.0, 0.3, 0.6, 1.3, 2.0, 2.4])
    for k in range(4):

        def time(h0: mp.mpf, e: mp.mpf, g: mp.mpf, k: int = k) -> mp.mpf:
            return mp.sqrt(2 * h0 / g) * (1 + 2 * sum(e**i for i in range(1, k + 1)))

        values = {"h0": 1.0, "e": 0.8, "g": 9.8}
        assert found.times_by_parameter[k] == pytest.approx(
            [slope(time, values, n) for n in values], rel=EXACT
        )


def test_the_two_sides_of_a_bounce() -> None:
    """At the first impact dw/dh0 is -g dt = 0 before, and after it h falls behind by (1 + e) w dt."""
    solution = hs.simulate(ball(is_impact=False), (0, 1), integrator="exact")
    found = hs.sensitivities(solution, ["h0"])
    t = solution.events[0].t
    speed = float(np.sqrt(2 * 9.8))
    before, after = (found.at(t, side=side).by_parameter[:, 0] for side in "-+")
    assert before == pytest.approx([1.0, 0.0], abs=1e-12)
    by_time = 1.0 / speed  # dt/dh0
    expected = [-0.8 * speed * by_time, 0.8 * 9.8 * by_time + 9.8 * by_time]
    assert after == pytest.approx(expected, rel=EXACT)
    assert found.at([t], side="+").by_parameter[0, :, 0] == pytest.approx(after)


def test_a_slider_stops() -> None:
    """x = v0 t - mu g t^2/2 until t = v0/(mu g), and then v0^2/(2 mu g)."""
    model = hs.Model(
        "slider",
        parameters={"v0": 2.0, "mu": 0.3, "g": 9.81},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", "v0", "-f", nominal=1)],
        contacts=[hs.Contact("f", "v", "g", "coulomb", {"mu": "mu"})],
    )
    solution = hs.simulate(model, (0, 1), integrator="exact")

    def x(t: mp.mpf, v0: mp.mpf, mu: mp.mpf, g: mp.mpf) -> mp.mpf:
        until = min(t, v0 / (mu * g))
        return v0 * until - mu * g * until**2 / 2

    def force(t: mp.mpf, v0: mp.mpf, mu: mp.mpf, g: mp.mpf) -> mp.mpf:
        return mu * g if t < v0 / (mu * g) else mp.mpf(0)

    values = {"v0": 2.0, "mu": 0.3, "g": 9.81}
    found = check(solution, {"x": x, "f": force}, values, [0.2, 0.6, 0.8, 1.0])
    stop = [slope(lambda v0, mu, g: v0 / (mu * g), values, name) for name in values]
    assert found.times_by_parameter[0] == pytest.approx(stop, rel=EXACT)


def test_static_above_kinetic_friction() -> None:
    """A block on a spring that is pulled at speed V sticks until k V t = mu_s, and then swings."""
    model = hs.Model(
        "pulled",
        parameters={"k": 4.0, "V": 0.5, "mu_s": 1.2, "mu_k": 0.7},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "k*(V*t - x) - f", nominal=1)],
        contacts=[hs.Contact("f", "v", 1, "static-kinetic", {"mu_s": "mu_s", "mu_k": "mu_k"})],
    )
    solution = hs.simulate(model, (0, 1.4), integrator="exact")

    def x(t: mp.mpf, k: mp.mpf, V: mp.mpf, mu_s: mp.mpf, mu_k: mp.mpf) -> mp.mpf:
        release, w = mu_s / (k * V), mp.sqrt(k)
        if t < release:
            return mp.mpf(0)
        at = w * (t - release)
        return V * t - mu_k / k + (mu_k - mu_s) / k * mp.cos(at) - V / w * mp.sin(at)

    values = {"k": 4.0, "V": 0.5, "mu_s": 1.2, "mu_k": 0.7}
    found = check(solution, {"x": x}, values, [0.3, 0.7, 1.0, 1.4])
    release = [slope(lambda k, V, mu_s, mu_k: mu_s / (k * V) + 0 * mu_k, values, name) for name in values]
    assert found.times_by_parameter[0] == pytest.approx(release, rel=EXACT)


def test_a_relay_with_hysteresis() -> None:
    """x' = q - x until x = high, then x' = -x until x = low, and again."""
    model = hs.Model(
        "relay",
        parameters={"low": 0.4, "high": 0.8, "q": 1.1, "x0": 0.1},
        states=[hs.State("x", "x0", "u - x", nominal=1)],
        components=[
            hs.Component(
                "relay",
                [
                    hs.Mode("on", hs.Guard("high", "high - x", "off"), set={"u": "q"}),
                    hs.Mode("off", hs.Guard("low", "x - low", "on"), set={"u": 0}),
                ],
                initial="on",
            )
        ],
    )
    solution = hs.simulate(model, (0, 3), integrator="exact")

    def x(t: mp.mpf, low: mp.mpf, high: mp.mpf, q: mp.mpf, x0: mp.mpf) -> mp.mpf:
        start, begin, is_on = x0, mp.mpf(0), True
        while True:
            length = mp.log((q - start) / (q - high)) if is_on else mp.log(high / low)
            if t < begin + length:
                return q + (start - q) * mp.exp(begin - t) if is_on else start * mp.exp(begin - t)
            begin, start, is_on = begin + length, high if is_on else low, not is_on

    check(solution, {"x": x}, {"low": 0, "high": 0, "q": 0, "x0": 0}, [0.5, 1.4, 2.0, 2.4, 3.0])


def test_sliding_and_its_exit() -> None:
    """x' = t - c - u with u = sign(x) reaches 0, slides with u = t - c, and leaves it at t = c + 1."""
    model = hs.Model(
        "sliding",
        parameters={"c": 0.6, "x0": 0.3},
        states=[hs.State("x", "x0", "t - c - u", nominal=1), hs.State("y", 0, "u", nominal=1)],
        surfaces=[hs.SwitchingSurface("s", "x", above={"u": 1}, below={"u": -1})],
    )
    solution = hs.simulate(model, (0, 2.5), integrator="exact")
    assert solution.modes["s"][1].mode not in ("above", "below")

    def reached(c: mp.mpf, x0: mp.mpf) -> mp.mpf:
        return c + 1 - mp.sqrt((c + 1) ** 2 - 2 * x0)

    def x(t: mp.mpf, c: mp.mpf, x0: mp.mpf) -> mp.mpf:
        if t < reached(c, x0):
            return x0 + t * t / 2 - (c + 1) * t
        return mp.mpf(0) if t < c + 1 else (t - c - 1) ** 2 / 2

    def y(t: mp.mpf, c: mp.mpf, x0: mp.mpf) -> mp.mpf:
        first = reached(c, x0)
        if t < first:
            return t
        end = min(t, c + 1)
        return first + ((end - c) ** 2 - (first - c) ** 2) / 2 + (t - end)

    found = check(solution, {"x": x, "y": y}, {"c": 0, "x0": 0}, [0.1, 0.5, 1.2, 2.0, 2.5])
    assert found.times_by_parameter[1] == pytest.approx([1.0, 0.0], abs=1e-12)


def test_a_schedule_whose_time_is_a_parameter() -> None:
    """v = v0 exp(-t), to which p is added at T: v = v0 exp(-t) + p exp(T - t)."""
    model = hs.Model(
        "kick",
        parameters={"v0": 1.5, "p": 0.7, "T": 0.4},
        states=[hs.State("v", "v0", "-v", nominal=1)],
        schedules=[hs.Schedule("kick", times=["T"], reset={"v": "+= p"})],
    )
    solution = hs.simulate(model, (0, 1), integrator="exact")

    def v(t: mp.mpf, v0: mp.mpf, p: mp.mpf, T: mp.mpf) -> mp.mpf:
        return v0 * mp.exp(-t) + (p * mp.exp(T - t) if t > T else 0)

    check(solution, {"v": v}, {"v0": 0, "p": 0, "T": 0}, [0.2, 0.5, 1.0])


def test_a_pendulum_against_its_variational_equation() -> None:
    """A curved flow, without events: d/dx0 of the pendulum through its elliptic function."""
    model = hs.Model(
        "pendulum",
        parameters={"a": 1.0},
        states=[hs.State("x", "a", "v", nominal=1), hs.State("v", 0, "-sin(x)", nominal=1)],
    )
    solution = hs.simulate(model, (0, 6), integrator="taylor", rtol=1e-13)

    def x(t: mp.mpf, a: mp.mpf) -> mp.mpf:
        k = mp.sin(a / 2)
        return 2 * mp.asin(k * mp.ellipfun("sn", mp.ellipk(k**2) - t, m=k**2))

    check(solution, {"x": x}, {"a": 0}, [0.5, 1.7, 3.0, 4.4, 6.0], ELSE)


def test_many_times_at_once_are_the_times_one_by_one() -> None:
    found = hs.sensitivities(hs.simulate("dfcs-stribeck", (0, 0.02)), ["mu_s", "N"])
    times = np.linspace(0.0, 0.02, 37)[::-1]
    together = found.at(times, ["x", "f"])
    for k, t in enumerate(times.tolist()):
        alone = found.at(t, ["x", "f"])
        assert together.by_parameter[k] == pytest.approx(alone.by_parameter, rel=1e-9, abs=1e-14)
        assert together.by_start[k] == pytest.approx(alone.by_start, rel=1e-9, abs=1e-14)
    assert found.at(0.02).by_parameter == pytest.approx(found.by_parameter, rel=1e-12)


def test_derivatives_pass_through_pickle() -> None:
    found = hs.sensitivities(hs.simulate("dfcs", (0, 0.02)), ["N"])
    again = pickle.loads(pickle.dumps(found))
    assert (again.by_parameter == found.by_parameter).all()
    assert (again.at(0.01, "f").by_parameter == found.at(0.01, "f").by_parameter).all()


def test_unknown_quantities_and_times_outside_are_refused() -> None:
    found = hs.sensitivities(hs.simulate("dfcs", (0, 0.02)), ["N"])
    with pytest.raises(hs.UsageError, match="no quantity 'X'"):
        found.at(0.01, "X")
    with pytest.raises(hs.UsageError, match="outside"):
        found.at(0.03)
    with pytest.raises(hs.UsageError, match="side"):
        found.at(0.01, side="after")
