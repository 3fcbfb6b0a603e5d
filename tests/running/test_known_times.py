"""Conditions on time whose borders are discrete states that nothing sets, or constant inputs: as known as numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs


def on_a_belt(velocity: str, normal: str, rate: str = "0") -> hs.Model:
    """Friction of 0.5 times the load acts on a body of mass 1 at rest; a is c, and b is 2 w."""
    return hs.Model(
        "m",
        states=[hs.State("v", 0, f"{rate} - f")],
        contacts=[hs.Contact("f", velocity, normal, "coulomb", {"mu": 0.5})],
        parameters={"c": 1.0, "w": 0.5},
        discrete={"a": "c", "b": "2*w"},
        inputs=[hs.Input("u", "table", times=(-1, 9), values=(1.0, 1.0))],
    )


@pytest.mark.parametrize("method", ["exact", "dop853"])
@pytest.mark.parametrize("belt", ["v - (1 if t > a else 0)", "v - (0 if not t >= a else 1)"])
def test_a_belt_that_starts(belt: str, method: str) -> None:
    """From a on the body is drawn along at the rate 0.5."""
    model = on_a_belt(belt, "1")
    for changed, speed in (({}, 0.75), ({"params": {"c": 1.5}}, 0.5), ({"x0": {"a": 0.75}}, 0.875)):
        sol = hs.simulate(model, (0.0, 2.5), integrator=method, **changed)
        assert sol.success and not sol.warnings
        assert sol(2.5)[0] == pytest.approx(speed, abs=1e-9)


@pytest.mark.parametrize("method", ["exact", "dop853"])
@pytest.mark.parametrize(
    "load", ["(4 if t < a + b else 1)", "(4 if t < a or t < b + a else 1)", "(1 if b < t - a else 4)"]
)
def test_a_load_that_falls(load: str, method: str) -> None:
    """A pull of 1 is held until a + b, and draws with 0.5 from then on."""
    sol = hs.simulate(on_a_belt("v", load, "1"), (0.0, 3.0), integrator=method)
    assert sol.success and not sol.warnings
    assert sol(3.0)[0] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("method", ["exact", "dop853"])
def test_a_border_that_is_a_constant_input(method: str) -> None:
    """The pull of 1 is held until u + c = 2; the belt of the second model starts there."""
    for model in (
        on_a_belt("v", "(4 if t < u + c else 1)", "1"),
        on_a_belt("v - (1 if t > u + c else 0)", "1"),
    ):
        sol = hs.simulate(model, (0.0, 3.0), integrator=method)
        assert sol.success and not sol.warnings
        assert sol(3.0)[0] == pytest.approx(0.5, abs=1e-9)


def test_a_derivative_by_what_moves_the_time() -> None:
    """From c on, v = 0.5 (t - c)."""
    model = on_a_belt("v", "(4 if t < a else 1)", "1")
    sol = hs.simulate(model, (0.0, 3.0), integrator="dop853")
    assert hs.sensitivities(sol, ["c"]).by_parameter[0, 0] == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p"])
@pytest.mark.parametrize("other", [math.nextafter(1.0, 0.0), 1.0, math.nextafter(1.0, 2.0), 0.7])
@pytest.mark.parametrize("belt", ["0.5 if t >= 1 else -0.45", "u"])
def test_a_belt_that_jumps_beside_another_known_time_does_not_carry_the_body_along(integrator, other, belt):
    """Friction of 0.392 turns the body round: v = 0.8 - 0.392 t, and 0.408 + 0.392 (t - 1) up to the belt's speed."""
    inputs = [hs.Input("w", "table", times=(-1.0, other, 9.0), values=(0.0, 1.0, 0.0))]
    if belt == "u":
        inputs.append(hs.Input("u", "table", times=(-1.0, 1.0, 1.0, 9.0), values=(-0.45, -0.45, 0.5, 0.5)))
    model = hs.Model(
        "belt",
        states=[hs.State("v", 0.8, "-f")],
        contacts=[hs.Contact("f", f"v - ({belt})", "0.7", "coulomb", {"mu": 0.56})],
        inputs=inputs,
    )
    sol = hs.simulate(model, (0.0, 2.0), integrator=integrator)
    times = np.array([0.5, 1.1, 1.2, 1.5])
    np.testing.assert_allclose(sol(times)[0], [0.604, 0.4472, 0.4864, 0.5], atol=1e-9)


READ = """
[parameters]
restitution = 0
[states]
v = { start = 0, der = "-f" }
h = { start = 0, der = "w" }
w = { start = 0.15, der = "p - 3" }
[contacts.f]
velocity = "v - (BELT)"
normal = 2
law = { name = "coulomb", mu = 0.5 }
[impacts.p]
gap = "h - (0.15*t if t < 1 else 0.2*t - 0.05)"
restitution = "restitution"
[discrete]
b = 0.15
held = 0
raised = 0
late = 0
[clocks.c]
period = 1
offset = 1
set = { b = 0.2, held = "v", raised = "w" }
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "0.18 - b", then = [{ to = "off", reset = { late = "v" } }] }
[components.a.modes.off]
[inputs.u]
kind = "table"
times = [0, 1, 1, 9]
values = [0.15, 0.15, 0.2, 0.2]
"""


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p", "moreau"])
@pytest.mark.parametrize("belt", ["0.15 if t < 1 else 0.2", "u", "b"])
def test_a_reset_reads_the_velocity_that_a_body_has_before_its_surface_jumps(
    integrator: str, belt: str
) -> None:
    """The body goes with the belt at 0.15 until t = 1, and follows it to 0.2 at the acceleration 1 of friction."""
    options = {"step": 1.0 / 128.0} if integrator == "moreau" else {}
    model = hs.Model.from_toml(READ.replace("BELT", belt))
    sol = hs.simulate(model, (0.0, 1.5), integrator=integrator, **options)
    assert [sol.output(name, 1.2) for name in ("held", "raised", "late")] == pytest.approx(
        [0.15] * 3, abs=1e-9
    )
    assert sol(1.02)[0] == pytest.approx(0.17, abs=1.0 / 64.0 if options else 1e-9)


@pytest.mark.parametrize(
    "integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853", "cvode-bdf"]
)
@pytest.mark.parametrize(
    ("period", "offset"), [(0.46, 0.36), (0.3, 0.1), (0.7, 0.1), (0.55, 0.0), (0.2, 0.0)]
)
@pytest.mark.parametrize("rate", ["(1 if abs(t - 2) < w else 2)", "(1 if t > 2 - w and t < 2 + w else 2)"])
def test_a_clock_that_ticks_within_rounding_of_a_jump(rate, period, offset, integrator) -> None:
    """The clock ticks at 2.2, where the rate jumps, up to the rounding of both times."""
    model = hs.Model.from_toml(f"""
        schema = 1
        name = "m"
        parameters = {{ w = 0.2 }}
        states.x = {{ start = 0, der = "{rate}" }}
        clocks.c = {{ period = {period}, offset = {offset}, set = {{}} }}
    """)
    sol = hs.simulate(model, (0.0, 5.0), integrator=integrator)
    assert sol.success, sol.message
    assert sol(5.0)[0] == pytest.approx(9.6, abs=1e-6)
