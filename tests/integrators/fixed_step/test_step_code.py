"""The steps that are compiled for a model give what steps one by one give, and what Python gives."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import hybridsim as hs

PERIOD = 0.0148  # of the forcing, roughly
KINDS = [
    ("rk4-dichotomy", {"stick_velocity": stick, "friction": friction, "after_event": after})
    for stick, friction, after in itertools.product(
        ("kept", "zero"), ("step", "stage"), ("full-step", "rest-of-step")
    )
] + [("rk4-sign", {"friction": friction}) for friction in ("step", "stage")]
MASS = """
[parameters]
k = 1
omega = 3
[definitions]
STIFFNESS = "2*k"
[states]
x = { start = 1, der = "v" }
v = { start = 0, der = "-STIFFNESS*x + cos(omega*t) - f" }
[contacts.f]
velocity = "v"
normal = 0.5
law = { name = "coulomb", mu = 1 }
"""
RUN = f"""
import hybridsim as hs
for integrator, options in {[KINDS[0], KINDS[7], KINDS[-1]]}:
    sol = hs.simulate("dfcs", (0.0, 0.03), integrator=integrator, steps_per_period=300.0, **options)
    print(sol.stats["rhs_evaluations"], sol.y[:, -1].tolist(), [(e.t, e.target) for e in sol.events])
"""


def result(model: hs.Model, integrator: str, options: dict[str, str]) -> tuple[object, ...]:
    sol = hs.simulate(model, (0.0, 4 * PERIOD), integrator=integrator, steps_per_period=300.0, **options)
    assert sol.success
    changes = [(e.t, e.source, e.target, e.x_plus.tolist()) for e in sol.events]
    return sol.t.tolist(), sol.y.tolist(), changes, sol.stats["rhs_evaluations"]


@pytest.mark.parametrize(("integrator", "options"), KINDS, ids=str)
def test_many_steps_in_one_call_are_the_steps_one_by_one(integrator: str, options: dict[str, str]) -> None:
    model = hs.load("dfcs").with_(N=25.0)
    watched = replace(
        model, monitors=(hs.Monitor("far", "x - 1"),)
    )  # with a monitor each step is a call of its own
    found = result(model, integrator, options)
    assert len(found[2]) > 5
    assert found == result(watched, integrator, options)


def test_compiled_steps_are_those_of_python() -> None:
    words = [
        subprocess.run(
            [sys.executable, "-c", RUN],
            env={**os.environ, "HYBRIDSIM_JIT": jit},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for jit in "01"
    ]
    assert words[0] and words[0] == words[1]


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
def test_components_without_forcing_and_several_contacts_have_steps_in_one_call(integrator: str) -> None:
    for name in ("belt", "clutches"):
        model = hs.load(name)
        watched = replace(model, monitors=(hs.Monitor("far", f"{model.states[0].name} - 1e6"),))
        found = [hs.simulate(m, (0.0, 2.0), integrator=integrator, step=0.002).y for m in (model, watched)]
        assert np.array_equal(*found)


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign"])
def test_a_definition_may_end_with_the_word_that_begins_a_function(integrator: str) -> None:
    motions = []
    for name in ("k_def", "twice"):
        text = MASS.replace("STIFFNESS", name)
        motions.append(hs.simulate(hs.Model.from_toml(text), (0.0, 4.0), integrator=integrator, step=0.01).y)
    assert np.array_equal(*motions)
