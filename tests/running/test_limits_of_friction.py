"""Static friction holds what is just at its limit."""

from __future__ import annotations

import random
from decimal import Decimal

import pytest

import hybridsim as hs


def at_the_limit(static: str, load: str, gravity: float) -> hs.Model:
    arguments = {"mu_s": static, "mu_k": 0.3}
    contact = hs.Contact("f", "v", "N", "static-kinetic", arguments)
    numbers = {"a": 0.3, "b": 0.36, "N": gravity}
    return hs.Model("m", states=[hs.State("v", 0, f"{load} - f")], contacts=[contact], parameters=numbers)


@pytest.mark.parametrize("method", ["exact", "taylor", "dop853", "tsit5", "rodas5p"])
@pytest.mark.parametrize("static", ["(a + b)", "2.2*a", "a/0.7"])
@pytest.mark.parametrize("gravity", [1.0, 9.81])
def test_a_body_rests_at_the_limit_of_static_friction(static: str, gravity: float, method: str) -> None:
    """The load is the limit, whatever rounding makes of either: the body stays; a run may say that it was close."""
    for load in (f"{static}*N", f"-{static}*N", f"N*{static}"):
        sol = hs.simulate(at_the_limit(static, load, gravity), (0.0, 2.0), integrator=method)
        assert sol.success and sol(2.0)[0] == 0.0
        assert set(sol.warnings) <= {"undecided at rounding: f keeps mode stick"}


@pytest.mark.parametrize("method", ["exact", "dop853"])
def test_a_body_slips_beyond_the_limit(method: str) -> None:
    """A load above the limit by one part in 1e12 is no question of rounding."""
    sol = hs.simulate(at_the_limit("(a + b)", "(a + b)*(1 + 1e-12)", 1.0), (0.0, 2.0), integrator=method)
    assert sol(2.0)[0] == pytest.approx(2 * 0.36, rel=1e-9)


PUSHES = {
    "table": ("u", '[inputs.u]\nkind = "table"\ntimes = [0, 1, 1, 9]\nvalues = [0.5, 0.5, 1.4, 1.4]\n'),
    "step": ("(0.5 if t < 1 else 1.4)", ""),
    "schedule": ("d", "[schedules.s]\ntimes = [1]\nreset = { d = 1.4 }\n[discrete]\nd = 0.5\n"),
    "start": ("1.4", ""),
}


@pytest.mark.parametrize("push", PUSHES)
@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p"])
def test_a_jump_of_force_parts_the_contact_that_it_exceeds(push: str, integrator: str) -> None:
    """If both hold, 1.4 is below the 1.6 of f and above the 1.2 of g: the bodies slide together by (1.4 - 1.2)/2."""
    force, more = PUSHES[push]
    model = hs.Model.from_toml(
        f"""
[states]
v = {{ start = 0, der = "{force} - f" }}
w = {{ start = 0, der = "f - g" }}
[contacts.f]
velocity = "v - w"
normal = 2
law = {{ name = "static-kinetic", mu_s = 0.8, mu_k = 0.4 }}
[contacts.g]
velocity = "w"
normal = 2
law = {{ name = "static-kinetic", mu_s = 0.6, mu_k = 0.6 }}
"""
        + more
    )
    run = hs.simulate(model, (0, 2), integrator=integrator)
    begin = 0 if push == "start" else 1
    assert (run.status, run.t_end) == ("finished", 2.0)
    assert run(2.0) == pytest.approx([0.1 * (2 - begin)] * 2, abs=1e-9)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853", "rodas5p"])
@pytest.mark.parametrize("load", ["2.5", "-2.5", "3", "-3", "mu*10", "-mu*10"])
def test_a_start_at_the_speed_of_a_belt_holds_up_to_the_static_limit(integrator: str, load: str) -> None:
    """The speed is one decimal number, which the start and the belt write in two ways: doubles may differ by an ulp."""
    draw = random.Random(load)
    for _ in range(4):
        a, b, times = (
            Decimal(draw.randint(1, 99)) / 100,
            Decimal(draw.randint(1, 99)) / 100,
            draw.choice([3, 7]),
        )
        start, belt = draw.choice(
            [("a + b", a + b), (f"{times}*a", times * a), ("a*b", a * b), ("a - b", a - b)]
        )
        model = hs.Model(
            "belt",
            states=[hs.State("v", start, f"{load} - f")],
            parameters={"a": float(a), "b": float(b), "mu": 0.3},
            contacts=[hs.Contact("f", f"v - ({belt})", 10, "static-kinetic", {"mu_s": "mu", "mu_k": 0.2})],
        )
        for x0 in (None, {"v": model.start_values()["v"]}):
            sol = hs.simulate(model, (0.0, 1.0), integrator=integrator, x0=x0)
            assert [part.mode for part in sol.modes["f"]] == ["stick"]
            assert sol(1.0)[0] == pytest.approx(float(belt), rel=1e-15)


def test_runs_of_a_sweep_start_at_the_speed_of_a_belt_as_one_run_does() -> None:
    """A start of 3*0.1 is the belt's 0.3: the body rides on it, below the static limit of 3 and above the kinetic 2."""
    model = hs.Model(
        "belt",
        states=[hs.State("x", 0, "v"), hs.State("v", "3*b", "F + A*sin(om*t) - f")],
        parameters={"b": 0.1, "F": 2.5, "A": 1e-3, "om": 6.283185307179586},
        contacts=[hs.Contact("f", "v - 0.3", 10, "static-kinetic", {"mu_s": 0.3, "mu_k": 0.2})],
    )
    found = hs.sweep(model, {"F": [2.4, 2.5, 2.6]}, measure=["stick_fraction.f", "peak.v"], after=3)
    assert found["stick_fraction.f"] == pytest.approx(1.0) and found["peak.v"] == pytest.approx(0.3)
