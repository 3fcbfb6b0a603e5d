"""Laws that come to Coulomb's in the limit do so at the order that the analysis of releases and reversals gives."""

from __future__ import annotations

from functools import cache
from math import log10, pi, sqrt

import numpy as np
import pytest
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs

BASE = hs.load("dfcs")
P = BASE.parameter_values()
LIMIT = P["mu"] * P["N"]
SMALL = (1e-3, 1e-4)  # v0 over the largest speed, or mu N/stiffness over the largest displacement
# forcing and start: sticks most of the time; turns round without stick, close to its steady motion
SCENES = {"releases": (24.0, 0.2, (0.0, 0.0)), "reversals": (60.0, 1.4, (1e-5, -0.6))}


@cache
def truth(scene: str) -> tuple[hs.Model, np.ndarray, np.ndarray, float]:
    """The model, times, the displacement in closed form, and the largest speed."""
    force, ratio, start = SCENES[scene]
    omega = ratio * sqrt(P["k"] / P["m"])
    model = hs.Model(
        "limits",
        [
            hs.State("x", start[0], "v", nominal=1e-4),
            hs.State("v", start[1], "(F0*sin(omega*t) - c*v - k*x - f)/m", nominal=0.1),
        ],
        BASE.with_(F0=force, omega=omega).parameters,
        contacts=BASE.contacts,
    )
    t = np.linspace(0, 4 * pi / omega, 1001)
    motion = Oscillator(P["m"], P["c"], P["k"], LIMIT, LIMIT, force, omega).run(0, t[-1], *start)
    modes = [piece.mode for piece in motion.pieces]
    assert len(modes) > 3 and (0 in modes) is (scene == "releases")
    x, v, _ = np.array([motion.state(time) for time in t]).T
    return model, t, x, abs(v).max()


def error(scene: str, law: str, small: float) -> float:
    model, t, x, fastest = truth(scene)
    give = small * abs(x).max()
    stiffness = LIMIT / give
    if law in ("tanh", "arctan", "karnopp"):
        model = model.regularized(law, v0=small * fastest)
    else:
        own, nominal = {
            "jenkins": ({"mu": "mu", "k": stiffness}, {"F": LIMIT}),
            "dahl": ({"mu": "mu", "sigma": stiffness}, {"z": give}),
        }[law]
        contact = hs.Contact("f", "v", "N", law, own, nominal=nominal)
        model = hs.Model("limits", model.states, model.parameters, contacts=[contact])
    integrator = {"karnopp": "exact", "jenkins": "exact", "dahl": "dop853"}.get(law, "rodas5p")
    options = {} if integrator == "exact" else {"rtol": 1e-9}
    sol = hs.simulate(model, (0, t[-1]), integrator=integrator, **options)
    assert sol.success, sol.message
    return float(abs(sol(t)[0] - x).max())


@pytest.mark.parametrize(
    ("law", "scene", "order", "within"),
    [
        ("karnopp", "releases", 2.0, 0.02),
        ("karnopp", "reversals", 1.0, 0.02),
        ("tanh", "releases", 1.0 - log10(4 / 3), 0.1),  # v0 log(1/v0): from log 10^4 to log 10^3
        ("tanh", "reversals", 1.0, 0.02),
        ("arctan", "releases", 2 / 3, 0.07),
        ("jenkins", "releases", 1.0, 0.07),
        ("jenkins", "reversals", 0.5, 0.02),
        ("dahl", "releases", 2 / 3, 0.03),
        ("dahl", "reversals", 0.5, 0.02),
    ],
)
def test_the_error_falls_at_the_order_of_theory(law: str, scene: str, order: float, within: float) -> None:
    wide, narrow = (error(scene, law, small) for small in SMALL)
    assert log10(wide / narrow) == pytest.approx(order, abs=within)
