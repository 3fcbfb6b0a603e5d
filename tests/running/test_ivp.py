"""One mode of a model for anybody's solver: the same field, guards and Jacobian, and a stick-slip loop by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from reference.dfcs_closed_form import Oscillator
from scipy.integrate import solve_ivp

import hybridsim as hs
from hybridsim.testing.measuring import SCENES

MODELS = [info.name for info in hs.list_models()] + [str(path) for path in sorted(SCENES.glob("*.toml"))]


@pytest.mark.parametrize("name", MODELS, ids=lambda name: name.rsplit("/")[-1])
def test_the_jacobian_is_the_slope_of_the_field(name: str) -> None:
    """Differences of the field, in every mode and away from corners."""
    model = hs.load(name)
    automata = {c.name: [m.name for m in c.modes] for c in model.all_components()}
    x, h = 0.5 + 0.3 * np.sin(np.arange(1.0, 1.0 + len(model.states))), 1e-6
    for modes in itertools.product(*automata.values()):
        z = dict(zip(automata, modes, strict=True))
        if model.name == "balls-between-walls" and set(modes) == {"closed"}:
            with pytest.raises(hs.UsageError, match="gaps depend on each other"):
                hs.to_ivp(model, z)  # the gaps between two walls add up to 1, and never close all at once
            continue
        fun, _, jac = hs.to_ivp(model, z)
        assert np.isfinite(fun(0.3, x)).all()
        slopes = [(fun(0.3, x + h * e) - fun(0.3, x - h * e)) / (2 * h) for e in np.eye(len(x))]
        expected = np.array(slopes).reshape(len(x), len(x)).T
        assert jac(0.3, x) == pytest.approx(
            expected, rel=1e-7, abs=1e-7 * (1 + np.abs(expected).max(initial=0))
        )


def test_stick_slip_by_hand() -> None:
    """A few periods with solve_ivp and a hand-written choice of the next mode, against the closed form."""
    model = hs.load("dfcs")
    values = model.parameter_values()
    period = 2 * math.pi / values["omega"]
    t, x, mode, changes = 0.0, np.zeros(2), "stick", []
    while t < 3 * period:
        fun, events, _ = hs.to_ivp(model, {"f": mode})
        sol = solve_ivp(
            fun,
            (t, 3 * period),
            x,
            method="DOP853",
            events=events,
            rtol=1e-11,
            atol=1e-16,
            max_step=period / 50,
        )
        t, x = sol.t[-1], sol.y[:, -1]
        if sol.status != 1:
            break
        fired = next(e for e, times in zip(events, sol.t_events, strict=True) if len(times))
        if mode == "stick":
            mode = "slip+" if fired.guard == "upper" else "slip-"
        else:
            x = np.array([x[0], 0.0])
            load = values["F0"] * math.sin(values["omega"] * t) - values["k"] * x[0]
            limit = values["mu"] * values["N"]
            mode = "stick" if abs(load) <= limit else "slip+" if load > 0 else "slip-"
        changes.append((t, mode))
    limit = values["mu"] * values["N"]
    oscillator = Oscillator(
        values["m"], values["c"], values["k"], limit, limit, values["F0"], values["omega"]
    )
    exact = oscillator.run(0.0, 3 * period, 0.0).changes
    number = {"slip+": 1, "slip-": -1, "stick": 0}
    assert [number[mode] for _, mode in changes] == [change.mode for change in exact]
    assert [t for t, _ in changes] == pytest.approx([change.t for change in exact], abs=1e-9 * period)


def test_inputs_are_looked_up_at_any_time() -> None:
    fun, _, _ = hs.to_ivp("square-wave", {"f": "stick"})
    fun_slip, _, _ = hs.to_ivp("square-wave", {"f": "slip+"})
    values = hs.load("square-wave").parameter_values()
    for t in (0.1, 0.7, 0.2, 12.1):  # forth and back: the second half of a period has the other sign
        force = values["F0"] if t % values["period"] < values["period"] / 2 else -values["F0"]
        expected = (force - values["mu"] * values["N"]) / values["m"]
        assert fun_slip(t, [0.0, 0.0])[1] == pytest.approx(expected, rel=1e-14)
        assert fun(t, [0.0, 0.0])[1] == 0.0


@pytest.mark.parametrize(
    ("z", "words"),
    [
        ({}, "component f has no initial mode, so `z` must contain its mode"),
        ({"g": "stick"}, "not a component"),
        ({"f": "sticks"}, "stick"),
    ],
)
def test_refusals(z: dict[str, str], words: str) -> None:
    with pytest.raises(hs.UsageError, match=words):
        hs.to_ivp("dfcs", z)
