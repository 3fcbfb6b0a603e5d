"""Laws with states of their own: loops, losses and steady forces by closed forms, at a velocity that is prescribed."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log, pi, tanh

import numpy as np
import pytest

import hybridsim as hs

SMOOTH = ["taylor", "dop853", "rodas5p", "scipy-radau", "cvode-bdf"]
LINEAR = ["exact", *SMOOTH]
# CVODE controls the error of a step and not of a run, SciPy's Radau that of an estimate of low order
WITHIN = {"cvode-bdf": 2e-6, "scipy-radau": 2e-6}
A = 2.0  # amplitude of the displacement
N = 10.0


def driven(
    law: str,
    arguments: Mapping[str, float | str],
    velocity: str = "2*cos(t)",
    normal: str = "10",
    work: bool = True,
) -> hs.Model:
    """The contact alone, at x = 2 sin(t) unless said otherwise; w is the work of friction."""
    contact = hs.Contact("f", velocity, normal, law, arguments)
    states = [hs.State("x", 0, velocity, nominal=1)]
    if work:
        states.append(hs.State("w", 0, f"f*({velocity})", nominal=1))
    return hs.Model("driven", states, contacts=[contact], outputs={"f": "f"})


def run(model: hs.Model, t_end: float, integrator: str, **start: float) -> hs.Solution:
    sol = hs.simulate(model, (0, t_end), integrator=integrator, rtol=1e-9, x0=start or None)
    assert sol.success, sol.message
    return sol


@pytest.mark.parametrize("integrator", SMOOTH)
def test_dahl(integrator: str) -> None:
    """Loading from a reversal at x = -A, F = -F_m: F = F_c - (F_c + F_m) exp(-sigma (x + A)/F_c)."""
    mu, sigma = 0.5, 3.0
    limit = mu * N
    peak = limit * tanh(sigma * A / limit)
    sol = run(
        driven("dahl", {"mu": mu, "sigma": sigma}, "2*sin(t)"), 4 * pi, integrator, x=-A, f_z=-peak / sigma
    )
    within = WITHIN.get(integrator, 1e-8)
    for t in (0.7, 1.6, 2.4, 3.1):
        x = -A * np.cos(t)
        rising = limit - (limit + peak) * exp(-sigma * (x + A) / limit)
        assert sol.output("f", t) == pytest.approx(rising, abs=within * limit)
        assert sol.output("f", t + pi) == pytest.approx(-rising, abs=within * limit)
    lost = 4 * limit * A - 4 * limit * peak / sigma
    assert sol(4 * pi)[1] == pytest.approx(2 * lost, rel=within)


@pytest.mark.parametrize("integrator", SMOOTH)
@pytest.mark.parametrize("v", [0.05, -0.2])
def test_lugre_at_a_steady_velocity(v: float, integrator: str) -> None:
    """The bristles come to z = g/sigma_0 along an exponential in the distance; then F = g(v) + sigma_2 v."""
    p = {"mu_s": 0.6, "mu_k": 0.4, "v_s": 0.1, "sigma_0": 1e3, "sigma_1": 3.0, "sigma_2": 0.7}
    sol = run(driven("lugre", p, str(v)), 3.0, integrator)
    g = N * (p["mu_k"] + (p["mu_s"] - p["mu_k"]) * exp(-((v / p["v_s"]) ** 2)))
    for t in (0.05, 3.0):
        left = exp(-p["sigma_0"] * abs(v) * t / g)
        expected = np.sign(v) * g * (1 - left) + p["sigma_1"] * v * left + p["sigma_2"] * v
        assert sol.output("f", t) == pytest.approx(expected, rel=WITHIN.get(integrator, 1e-7))


@pytest.mark.parametrize("integrator", LINEAR)
def test_jenkins(integrator: str) -> None:
    """A parallelogram; 4 F_c (A - F_c/k) is lost in a cycle."""
    mu, k = 0.5, 4.0
    limit = mu * N
    is_linear = integrator == "exact"  # the work is not
    sol = run(driven("jenkins", {"mu": mu, "k": k}, work=not is_linear), 5 * pi / 2, integrator)
    within = WITHIN.get(integrator, 1e-9)
    assert [e.target for e in sol.events] == ["slip+", "stick", "slip-", "stick", "slip+", "stick"][
        : len(sol.events)
    ]
    if not is_linear:
        lost = sol(5 * pi / 2)[1] - sol(pi / 2)[1]
        assert lost == pytest.approx(4 * limit * (A - limit / k), rel=within)
    first = np.arcsin(limit / k / A)
    assert sol.events[0].t == pytest.approx(first, rel=1e-9)
    assert sol.events[1].t == pytest.approx(pi / 2, rel=1e-9)
    turned = pi / 2 + np.arccos(1 - 2 * limit / k / A)
    assert sol.events[2].t == pytest.approx(turned, rel=1e-8)
    assert sol.output("f", 1.2) == limit


@pytest.mark.parametrize("integrator", SMOOTH)
def test_jenkins_under_a_load_that_varies(integrator: str) -> None:
    """In slip F = mu N(t) all along, and the slider stops when k v falls below mu N'."""
    mu, k = 0.5, 40.0
    sol = run(driven("jenkins", {"mu": mu, "k": k}, normal="10 + 4*sin(3*t)"), 1.4, integrator)
    assert [e.target for e in sol.events][:1] == ["slip+"]
    for t in np.linspace(sol.events[0].t + 1e-6, 1.35, 7):
        assert sol.output("f", t) == pytest.approx(
            mu * (10 + 4 * np.sin(3 * t)), rel=WITHIN.get(integrator, 1e-8)
        )


@pytest.mark.parametrize("integrator", LINEAR)
def test_iwan(integrator: str) -> None:
    """Its loop is the first loading doubled (Masing), and a cycle loses what its elements lose."""
    n, mu, k = 4, 0.5, 6.0
    limits = [mu * N * (2 * i - 1) / n**2 for i in range(1, n + 1)]
    is_linear = integrator == "exact"  # the work is not
    sol = run(driven("iwan", {"n": n, "mu": mu, "k": k}, work=not is_linear), 5 * pi / 2, integrator)
    within = WITHIN.get(integrator, 1e-9)
    if not is_linear:
        lost = sol(5 * pi / 2)[1] - sol(pi / 2)[1]
        expected = sum(4 * f * (A - f * n / k) for f in limits if f * n / k < A)
        assert lost == pytest.approx(expected, rel=within)

    def backbone(x: float) -> float:
        return sum(min(k / n * x, limit) for limit in limits)

    assert sum(limits) == pytest.approx(mu * N)
    for t in (0.2, 0.6, 1.1):
        assert sol.output("f", t) == pytest.approx(backbone(A * np.sin(t)), rel=within)
        x = A * np.sin(t + pi / 2)  # unloading from A
        unloading = backbone(A) - 2 * backbone((A - x) / 2)
        assert sol.output("f", t + pi / 2) == pytest.approx(unloading, abs=1e-8 + within * mu * N)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_rate_and_state_at_a_step_in_velocity(integrator: str) -> None:
    """F/N jumps by a log(v2/v1), and comes to mu_0 + (a - b) log(v2/v_0) while theta decays over the distance L."""
    p = {"mu_0": 0.6, "a": 0.01, "b": 0.015, "L": 1e-5, "v_0": 1e-6}
    v1, v2 = 1e-6, 1e-5
    model = hs.Model(
        "step",
        states=[hs.State("x", 0, "v")],
        discrete=[hs.Discrete("v", v1)],
        schedules=[hs.Schedule("step", times=(20,), reset={"v": v2})],
        contacts=[hs.Contact("f", "v", 10, "rate-and-state", p, nominal={"theta": 1})],
        outputs={"f": "f"},
    )
    sol = run(model, 60.0, integrator)

    def force(v: float, theta: float) -> float:
        return N * (p["mu_0"] + p["a"] * log(v / p["v_0"]) + p["b"] * log(p["v_0"] * theta / p["L"]))

    within = WITHIN.get(integrator, 1e-8)
    assert sol.output("f", 19.0) == pytest.approx(force(v1, p["L"] / v1), rel=1e-12)
    for t in (20.5, 21.0, 23.0, 60.0):
        theta = p["L"] / v2 + (p["L"] / v1 - p["L"] / v2) * exp(-v2 * (t - 20) / p["L"])
        assert sol.output("f", t) == pytest.approx(force(v2, theta), rel=within)
    jump = sol.output("f", 20.0) - sol.output("f", 19.0)
    assert jump == pytest.approx(p["a"] * N * log(v2 / v1), rel=1e-9)
    steady = p["mu_0"] + (p["a"] - p["b"]) * log(v2 / p["v_0"])
    assert sol.output("f", 60.0) == pytest.approx(N * steady, rel=1e-8)


def test_rate_and_state_ends_where_the_velocity_does() -> None:
    p = {"mu_0": 0.6, "a": 0.01, "b": 0.015, "L": 1e-5, "v_0": 1e-6}
    contact = hs.Contact("f", "v", 10, "rate-and-state", p, nominal={"theta": 1})
    model = hs.Model("stopping", [hs.State("v", "1e-6*exp(1)", "-1e-6")], contacts=[contact])
    sol = hs.simulate(model, (0, 4), integrator="dop853")
    assert sol.status == "inconsistent" and "where rate-and-state friction ends" in sol.message
    assert sol.t[-1] == pytest.approx(exp(1), rel=1e-9)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_elasto_plastic(integrator: str) -> None:
    """A spring up to the break-away deflection, again and again; mu N + sigma_2 v after a long slide."""
    p = {"mu": 0.5, "sigma_0": 50.0, "sigma_1": 0.2, "sigma_2": 0.3, "share": 0.7}
    small = run(driven("elasto-plastic", p, "0.06*cos(t)"), 4.0, integrator)
    assert small.events == ()
    within = WITHIN.get(integrator, 1e-8)
    for t in (0.5, 2.0, 3.9):
        expected = 50 * 0.06 * np.sin(t) + (0.2 + 0.3) * 0.06 * np.cos(t)
        assert small.output("f", t) == pytest.approx(expected, rel=within)
    sliding = run(driven("elasto-plastic", p, "0.4"), 20.0, integrator)
    assert [e.target for e in sliding.events] == ["slip+"]
    assert sliding.events[0].t == pytest.approx(0.7 * 5 / 50 / 0.4, rel=1e-9)
    # alpha is flat at its end: slow
    assert sliding.output("f", 20.0) == pytest.approx(5 + 0.3 * 0.4, rel=1e-3)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_elasto_plastic_does_not_drift_where_lugre_does(integrator: str) -> None:
    """A load of 60 % of the break-away with a vibration of 5 % (Dupont et al., the reason for the law)."""
    common = {"sigma_0": 50.0, "sigma_1": 0.5, "sigma_2": 0.0}
    laws = {"elasto-plastic": {"mu": 0.5, "share": 0.7}, "lugre": {"mu_s": 0.5, "mu_k": 0.5, "v_s": 1.0}}
    drift = {}
    for law, own in laws.items():
        contact = hs.Contact("f", "v", 10, law, common | own)
        states = [
            hs.State("x", 0.06, "v", nominal=1),
            hs.State("v", 0, "3 + 0.25*sin(2*t) - 2*v - f", nominal=1),
        ]
        model = hs.Model("pushed", states, contacts=[contact])
        sol = run(model, 60 * pi, integrator, f_z=0.06)
        drift[law] = float(sol(60 * pi)[0] - sol(30 * pi)[0])
    assert abs(drift["elasto-plastic"]) < 1e-8
    assert drift["lugre"] > 1e-3


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_jenkins_in_a_contact_that_opens(integrator: str) -> None:
    """A steady pull under N = 10 (1 + 2 sin t): F = mu N in slip, none while open, and mu N again."""
    contact = hs.Contact("f", "1", "10 + 20*sin(t)", "jenkins", {"mu": 0.5, "k": 100}, opens=True)
    model = hs.Model("lifting", [hs.State("x", 0, "1")], contacts=[contact], outputs={"f": "f"})
    sol = run(model, 2 * pi, integrator)
    assert [(e.component, e.target) for e in sol.events] == [
        ("f", "slip+"),
        ("f_N", "open"),
        ("f_N", "closed"),
    ]
    assert [e.t for e in sol.events][1:] == pytest.approx([7 * pi / 6, 11 * pi / 6], rel=1e-8)
    for t in (1.0, 3.0, 3.8, 5.0, 5.9, 6.2):
        assert sol.output("f", t) == pytest.approx(0.5 * max(10 + 20 * np.sin(t), 0), abs=1e-7)
