"""A contact becomes three modes whose forces and guards say what dry friction is."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from model.samples import block, everything

import hybridsim as hs
from hybridsim.expr import evaluate, parse

STRIBECK = hs.FrictionLaw(
    "s", "N*(mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2))", "N*mu_s", {"mu_s": 0.6, "mu_k": 0.4, "v_s": 0.05}
)
speeds = st.floats(1e-3, 10)
loads = st.floats(0, 100)


@given(speeds, loads)
def test_the_force_opposes_the_motion_and_is_odd(speed: float, load: float) -> None:
    component = hs.Contact("f", "v - v_belt", "load", STRIBECK).component()
    forward = evaluate(component.mode("slip+").set["f"], {"v": speed + 1, "v_belt": 1, "load": load})
    backward = evaluate(component.mode("slip-").set["f"], {"v": 1 - speed, "v_belt": 1, "load": load})
    assert forward >= 0
    assert backward == pytest.approx(-forward, rel=1e-9)
    law = {"v": (speed + 1) - 1, "N": load, "mu_s": 0.6, "mu_k": 0.4, "v_s": 0.05}
    assert forward == evaluate(STRIBECK.slip, law)


@given(st.floats(-10, 10), st.floats(-100, 100))
def test_domains_of_the_modes(velocity: float, force: float) -> None:
    """slip+ where v >= 0, slip- where v <= 0, stick where |f| <= limit."""
    component = hs.Contact("f", "v", "load", STRIBECK).component(constants={"load"})
    values = {"v": velocity, "f": force, "load": 50.0}
    inside = {
        mode.name: all(evaluate(guard.expr, values) >= 0 for guard in mode.guards) for mode in component.modes
    }
    assert inside == {"slip+": velocity >= 0, "slip-": velocity <= 0, "stick": abs(force) <= 0.6 * 50.0}


def test_jumps_at_the_release() -> None:
    surface = hs.Contact("f", "v", 50, STRIBECK).component().surface
    assert surface is not None
    assert (surface.above, surface.below, surface.hold, surface.unknown) == ("slip+", "slip-", "stick", "f")
    assert evaluate(surface.jump_above, {}) == pytest.approx(0.0, abs=1e-13)
    law = hs.FrictionLaw("two", "mu_k*N", "mu_s*N", {"mu_s": 0.6, "mu_k": 0.4})
    surface = hs.Contact("f", "v", 50, law).component().surface
    assert surface is not None
    assert evaluate(surface.jump_above, {}) == pytest.approx(10)  # from limit 30 to 20: 30 - 20 in slip+
    assert evaluate(surface.jump_below, {}) == pytest.approx(-10)


def test_names_of_guards() -> None:
    modes = block().all_components()[0].modes
    assert [(mode.name, [guard.name for guard in mode.guards]) for mode in modes] == [
        ("slip+", ["velocity"]),
        ("slip-", ["velocity"]),
        ("stick", ["upper", "lower"]),
    ]
    assert all(guard.then == () for mode in modes for guard in mode.guards)


@pytest.mark.parametrize(
    ("normal", "guarded"),
    [
        ("N", False),
        ("3", False),
        ("2*N/m", False),
        ("weight", False),
        ("N + x", True),
        ("N*(2 + sin(t))", True),
        ("pressed", True),
        ("u", True),
        ("n", True),
    ],
)
def test_a_load_that_can_vary_is_guarded(normal: str, guarded: bool) -> None:
    model = block(
        contacts=[hs.Contact("f", "v", normal, "coulomb", {"mu": "mu"})],
        definitions={"pressed": "N + x", "weight": "9.81*m"},
        inputs=[hs.Input("u", "wave", shape="sine", period=1, offset=2)],
        discrete={"n": 2},
    ).validate()
    for mode in model.all_components()[0].modes:
        loads = [guard for guard in mode.guards if guard.name == "normal"]
        assert len(loads) == guarded
        assert all(guard.expr.text == normal and "f became negative" in str(guard.fatal) for guard in loads)


def test_arguments_are_inlined_and_defaults_hold() -> None:
    first, second = everything().all_components()[:2]
    assert first.mode("slip+").set["f1"].text == "m*9.81*(0.3 + 0.1*exp(-v/(P/100)))"
    assert second.mode("slip-").set["f2"].text == "-((0.1 + P)*max(0, 1 + load))"


def test_a_default_may_use_another_parameter() -> None:
    law = hs.FrictionLaw("l", "N*a*c", "N*a*c", {"a": "b/2", "b": 4, "c": "a*b"})
    assert hs.Contact("f", "v", 1, law).component().mode("slip+").set["f"].text == "1*(4/2)*(4/2*4)"
    assert hs.Contact("f", "v", 1, law, {"a": 7}).component().mode("slip+").set["f"].text == "1*7*(7*4)"


def test_names_of_the_law_and_of_the_model_do_not_mix() -> None:
    """The model's own v and N are other things than the law's."""
    law = hs.FrictionLaw("l", "N*mu + v", "N*mu", ["mu"])
    component = hs.Contact("f", "N*v", "v + 1", law, {"mu": "N"}).component()
    assert component.mode("slip+").set["f"].text == "(v + 1)*N + N*v"


def test_components_come_in_order_of_declaration() -> None:
    assert [part.name for part in everything().all_components()] == ["f1", "f2", "side", "relay", "hold"]
    assert everything().all_components()[4].variables == ("r",)


def test_velocity_of_a_moving_base() -> None:
    component = hs.Contact("f", "v - 0.1*cos(3*t)", "N", "coulomb", {"mu": 1}).component()
    assert component.mode("slip-").guards[0].expr.text == "-(v - 0.1*cos(3*t))"
    assert component.surface is not None
    assert component.surface.function == parse("v - 0.1*cos(3*t)")
