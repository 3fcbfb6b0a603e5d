"""A closed form is offered for a model that is the system, by its structure, and for no other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plot.fake_solution import ball_model, oscillator_model

from hybridsim.expr import parse
from hybridsim.model import Contact, Discrete, FrictionLaw, Model, Monitor, Output, State, load
from hybridsim.reference.closed_forms import find_closed_form
from hybridsim.reference.closed_forms.affine import Affine, NotAffine, affine
from hybridsim.reference.closed_forms.coulomb_model import recognise
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator


def test_affine_forms() -> None:
    values, definitions = {"a": 2.0, "w": 3.0}, {"push": parse("a*sin(w*t) + cos(1 - w*t)")}

    def read(text: str) -> Affine:
        return affine(parse(text), {"x", "v"}, values, definitions)

    assert read("a**2 - 1") == Affine(3.0)
    assert read("-(3*x - a*v)/a + 1") == Affine(1.0, {"x": -1.5, "v": 1.0})
    assert read("x*a + 0*v - x").linear["x"] == 1.0
    form = read("push - x")
    t = 0.7
    assert np.imag(form.waves[3.0] * np.exp(3j * t)) == pytest.approx(2 * math.sin(2.1) + math.cos(1 - 2.1))
    for text in ("x*v", "x**2", "sin(x)", "a/x", "sin(t**2)", "x if t > 1 else v", "abs(x)", "unknown*x"):
        with pytest.raises(NotAffine):
            read(text)


def test_the_packaged_scene_is_recognised() -> None:
    found = recognise(load("dfcs"))
    assert (found.position, found.velocity) == ("x", "v")
    assert found.system == ForcedCoulombOscillator(
        mass=0.2, damping=5.65, stiffness=1e5, slip_force=20, stick_limit=20, force=30,
        frequency=0.6 * math.sqrt(5e5), phase=0.0, offset=0.0,
    )  # fmt: skip


def test_other_spellings_of_the_system_are_recognised() -> None:
    law = FrictionLaw("two", slip="mu_k*N", stick="mu_s*N", parameters={"mu_s": 0.6, "mu_k": 0.4})
    model = Model(
        "other",
        states=[State("u", 0.5, "k/m*(1 - q) - u*0.3 + push - drag/m"), State("q", 1, "u")],
        parameters={"m": 2, "k": 3, "w": 1.5, "load": 4},
        definitions={"push": "0.5*cos(w*t)"},
        contacts=[Contact("drag", "u", "load/2", law)],
        monitors=[Monitor("crossing", "q")],
        outputs=[Output("twice", "2*q")],
    )
    found = recognise(model)
    assert (found.position, found.velocity) == ("q", "u")
    system = found.system
    assert (system.mass, system.damping, system.stiffness, system.offset) == pytest.approx((2, 0.6, 3, 3))
    assert (system.slip_force, system.stick_limit) == pytest.approx((0.8, 1.2))
    assert (system.force, system.frequency, system.phase) == pytest.approx((1, 1.5, math.pi / 2))
    closed = find_closed_form(model, (0.0, 5.0))
    assert closed.exact.states(np.array([0.0]), "+")[:, 0] == pytest.approx([0.5, 1])
    assert closed.exact.initial_modes == {"drag": "slip+"}
    assert {event.component for event in closed.exact.events} == {"drag"}


@pytest.mark.parametrize(
    "change",
    [
        {"monitors": (Monitor("stop", "x", action="terminate"),)},
        {"discrete": (Discrete("d", 0),)},
        {"contacts": (replace(oscillator_model().contacts[0], velocity=parse("v - 0.1")),)},
        {"contacts": (replace(oscillator_model().contacts[0], normal=parse("N*(1 + 0.1*sin(t))")),)},
        {"states": (State("x", 0, "v"), State("v", 0, "(F0*sin(omega*t) - k*x**3 - f)/m"))},
        {"states": (State("x", 0, "v"), State("v", 0, "(F0*sin(omega*t) + F0*sin(t) - k*x - f)/m"))},
        {"states": (State("x", 0, "v"), State("v", 0, "(F0*sin(omega*t) + t - k*x - f)/m"))},
        {"states": (State("x", 0, "v"), State("v", 0, "(F0*sin(omega*t) - 1e3*v - k*x - f)/m"))},
        {"states": (State("x", 0, "v - x"), State("v", 0, "(F0*sin(omega*t) - k*x - f)/m"))},
    ],
)
def test_anything_else_is_not(change: dict[str, object]) -> None:
    assert recognise(replace(oscillator_model(), **change)) is None


@pytest.mark.parametrize("name", ["dfcs-stribeck", "belt", "bouncing-ball", "thermostat", "sampled-servo"])
def test_other_scenes_have_no_such_form(name: str) -> None:
    assert find_closed_form(load(name), (0.0, 1.0)) is None


def test_backward_in_time_there_is_none() -> None:
    assert find_closed_form(oscillator_model(), (1.0, 0.0)) is None
    assert find_closed_form(ball_model(), (0.0, 1.0)) is None
