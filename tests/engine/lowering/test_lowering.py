"""Generated code against the declaration evaluated by hand, in every mode; what cannot be generated."""

from __future__ import annotations

import json
import math
import os
import random
import subprocess
import sys

import mpmath
import numpy as np
import pytest
from engine.model_truth import ByHand, combinations
from engine.multiple_precision import evaluate
from engine.random_expressions import random_expression
from engine.tapes import STATES, Point

import hybridsim as hs
from hybridsim.engine.lowering.lower import Lowering
from hybridsim.engine.system.instant import Instant, multiple
from hybridsim.engine.system.system import System
from hybridsim.errors import ModelError
from hybridsim.model import (
    Choice,
    Component,
    Contact,
    Discrete,
    FrictionLaw,
    Guard,
    Input,
    Mode,
    Model,
    Monitor,
    Output,
    Schedule,
    State,
)

PACKAGED = [info.name for info in hs.list_models()]
STICTION = FrictionLaw("stiction", slip="mu_k*N", stick="mu_s*N", parameters={"mu_s": 0.5, "mu_k": 0.4})

EVERYTHING = Model(
    "everything",
    states=(
        State("x", 0.1, "v"),
        State("v", 0.2, "(drive - c*v - spring - f)/m"),
        State("q", 0.3, "gain*sin(q) + level"),
        State("r", 0.4, "-r"),
    ),
    parameters={"m": 2, "c": 0.3, "k": 5, "w": 1.7, "T": "2*pi/w", "N0": 4},
    discrete=(Discrete("level", 0.25),),
    definitions={"spring": "k*x*(1 + x**2)", "drive": "3*sin(theta) + u*gain + ramp", "theta": "w*t + 0.3"},
    inputs=(
        Input("u", "wave", shape="triangle", period="T", amplitude=0.7),
        Input("ramp", "table", times=(0, 1, 4), values=(0, 2, -1), interpolation="cubic"),
    ),
    contacts=(Contact("f", velocity="v - 0.1*cos(w*t)", normal="N0 + gain + 0.1*x", law=STICTION),),
    components=(
        Component(
            "amplifier",
            modes=(
                Mode("low", (Guard("up", "1 - q", then=(Choice("high"),)),), set={"gain": "0.5*abs(r)"}),
                Mode(
                    "high",
                    (
                        Guard("down", "min(q, r) + 2", then=(Choice("low"),)),
                        Guard("side", "spring + 9", then=(Choice("low"),)),
                    ),
                    set={"gain": "2 if r > 0 else max(r, -1)"},
                    der={"r": "-2*r + level"},
                ),
            ),
            initial="low",
        ),
    ),
    monitors=(Monitor("fast", "v - gain", direction="up", action="record"),),
    schedules=(Schedule("tick", period=1, reset={"level": "level + x"}),),
    outputs=(
        Output("power", "f*v"),
        Output("state", "1", modes={"f.stick": "0", "amplifier.high": "10 + gain"}),
    ),
)  # fmt: skip


def signals(system: System, p: np.ndarray, s: float) -> dict[str, mpmath.mpf]:
    """Inputs at local time s, from the slots of their pieces (which have tests of their own)."""
    values = {}
    for k, declared in enumerate(system.model.inputs):
        c = [mpmath.mpf(float(v)) for v in p[system.layout.signals_at + 5 * k :][:5]]
        d = mpmath.mpf(s) - c[4]
        line = c[0] + d * (c[1] + d * (c[2] + d * c[3]))
        angle = c[0] + d * (c[1] + d * c[2])
        straight = declared.kind == "table" or declared.shape not in (None, "sine")
        values[declared.name] = line if straight else c[3] * mpmath.sin(angle)
    return values


def close(found: float, true: mpmath.mpf, size: float) -> bool:
    return abs(mpmath.mpf(float(found)) - true) <= 1e-12 * (size + abs(true))


def check_model(model: Model, seed: int, pinned: bool) -> None:
    """Flow, guards, surfaces, monitors and quantities at random states, in every combination of modes."""
    system, rng = System(model, as_written=True), np.random.default_rng(seed)
    for z in combinations(system):
        modes = system.mode_names(z)
        origin, s = Instant(float(rng.uniform(0, 5))), float(rng.uniform(0, 0.01))
        discrete = rng.uniform(-1, 1, len(model.discrete))
        p = system.vector(origin, discrete)
        p[system.layout.pin_at] = 1.0 if pinned else 0.0
        raw = np.array([state.nominal or 1.0 for state in model.states]) * rng.uniform(-1, 1, system.n)
        projected = [
            i for c, states in system.projected.items() if z[c] == system.automata[c].hold for i in states
        ]
        if projected:  # Newton's method from anywhere, and then from a place on the surface
            on_surface = p.copy()
            on_surface[system.layout.pin_at] = 1.0
            for _ in range(10):
                raw = system.project(s, raw, on_surface, z)
        x = system.project(s, raw, p, z)
        held = system.evaluated(z)
        untouched = [i for i in range(system.n) if not pinned or i not in (*held, *projected)]
        assert (x[untouched] == raw[untouched]).all()
        with mpmath.workdps(40):
            t = mpmath.mpf(origin.high) + mpmath.mpf(s)
            names = [d.name for d in model.discrete]
            state = dict(zip(system.names, map(float, x), strict=True))
            hand = ByHand(
                model, modes, t, state, dict(zip(names, discrete, strict=True)), signals(system, p, s)
            )
            slope = [hand.slope()[n] for n in system.names]
            size = float(max([1e-20, *map(abs, slope)]))  # differences in 40 digits leave some 1e-40
            for i, (found, true) in enumerate(zip(system.flow(s, x, p, z), slope, strict=True)):
                if i in held and pinned:
                    assert found == 0.0, "a held state is evaluated, not integrated"
                else:
                    assert close(found, true, size), (modes, system.names[i], found, float(true))
            one = np.array([s]), x[None, :], p, z
            guards = system.rows("guards", system.guard_count, *one)[0]
            for automaton, mode in zip(system.automata, z, strict=True):
                numbers = automaton.guards[mode]
                for g, text in zip(numbers, hand.guards[automaton.name], strict=True):
                    assert close(guards[g], hand.value(text), size), (modes, text)
            for k, c in enumerate(system.surface_of):
                surface = system.rows("surfaces", len(system.surface_of), *one)[0, k]
                component = model.all_components()[c]
                true = hand.value(component.surface.function.text)
                assert close(surface, true, float(np.max(np.abs(x))))
                can_hold = c in system.pins or c in system.projected
                if pinned and can_hold and z[c] == system.automata[c].hold:
                    assert abs(surface) <= 4 * 2.0**-52 * np.max(np.abs(x), initial=1e-300)
                    if component.surface.restitution is not None:
                        assert close(0.0, hand.rate(component.surface.function.text), size)
            monitors = system.rows("monitors", len(model.monitors), *one)[0]
            for found, monitor in zip(monitors, model.monitors, strict=True):
                assert close(found, hand.value(monitor.expr.text), size)
            check_quantities(system, hand, one, size)


def check_quantities(system: System, hand: ByHand, at: tuple[np.ndarray, ...], size: float) -> None:
    model = system.model
    found = dict(
        zip(system.quantities, system.rows("quantities", len(system.quantities), *at)[0], strict=True)
    )
    formulas = {n: n for n in (*hand.formulas, *hand.unknown, *(i.name for i in model.inputs))}
    formulas |= {o.name: o.expr.text for o in model.outputs}
    formulas |= {f"{o.name} in {place}": e.text for o in model.outputs for place, e in o.modes.items()}
    for name, text in formulas.items():
        assert close(found[name], hand.value(text), size), name


@pytest.mark.parametrize("pinned", [True, False])
@pytest.mark.parametrize("name", PACKAGED)
def test_packaged_models_mean_what_they_say(name: str, pinned: bool) -> None:
    check_model(hs.load(name), seed=1, pinned=pinned)


@pytest.mark.parametrize("pinned", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_a_model_with_everything_in_it(seed: int, pinned: bool) -> None:
    EVERYTHING.validate()
    check_model(EVERYTHING, seed, pinned)


@pytest.mark.parametrize("form", ["w*t + 0.25", "theta", "phi - 1", "2*theta/2 - w*(t - t0) + w*t - w*t0"])
def test_an_angle_keeps_its_digits_over_a_million_turns(form: str) -> None:
    """However it is written: in place, or through definitions."""
    model = Model(
        "angle",
        states=(State("x", 0, f"sin({form}) + x*cos({form})"),),
        parameters={"w": 424.26406871192853, "t0": 0.125},
        definitions={"phi": "theta + 1", "theta": "w*t + 0.25"},
    )
    system = System(model)
    for turns in (0, 1000, 10**6):
        origin = multiple(0.0, turns, 2 * math.pi / 424.26406871192853).plus(0.00123)
        found = system.flow(
            1e-3, np.array([0.5]), system.vector(origin, np.zeros(0)), np.zeros(0, dtype=np.int64)
        )
        with mpmath.workdps(50):
            t = mpmath.mpf(origin.high) + mpmath.mpf(origin.low) + mpmath.mpf(1e-3)
            true = ByHand(model, {}, t, {"x": 0.5}).slope()["x"]
            assert abs(mpmath.mpf(found[0]) - true) <= 4e-15


def test_random_expressions_keep_their_values_in_the_generated_code() -> None:
    """Sixty at once, as monitors of one model; the tape's values have tests of their own."""
    pick = random.Random(11)
    texts = [random_expression(pick, 4) for _ in range(60)]
    point = Point(t=0.0)
    model = Model(
        "random",
        states=tuple(State(n, getattr(point, n), "1") for n in STATES),
        parameters={n: getattr(point, n) for n in ("a", "b", "c")},
        monitors=tuple(Monitor(f"m{k}", text, direction="both") for k, text in enumerate(texts)),
    )
    system = System(model, as_written=True)
    for _ in range(20):
        point = Point(*(pick.uniform(-1, 1) for _ in range(4)), pick.uniform(0, 1))
        x = np.array([[getattr(point, n) for n in STATES]])
        p, z = system.vector(Instant(0.0), np.zeros(0)), np.zeros(0, dtype=np.int64)
        found = system.rows("monitors", len(texts), np.array([point.t]), x, p, z)[0]
        with mpmath.workdps(40):
            names = point.motion(mpmath.mpf(0))
            for text, value in zip(texts, found, strict=True):
                true = evaluate(text, names)
                assert abs(mpmath.mpf(float(value)) - true) <= 1e-12 * (1 + abs(true)), text


# -- what cannot be lowered -------------------------------------------------------------------------------------


def refusal(**parts: object) -> str:
    model = Model("bad", **{"states": (State("x", 0, "v"), State("v", 0, "-f")), **parts})
    with pytest.raises(ModelError) as caught:
        Lowering(model).lower()
    return str(caught.value)


CONTACT = Contact("f", velocity="v", normal="1", law=STICTION)


def test_a_force_that_enters_nonlinearly_is_refused() -> None:
    message = refusal(states=(State("x", 0, "v"), State("v", 0, "-f - f**3")), contacts=(CONTACT,))
    assert "the force f enters the motion of f nonlinearly" in message


def test_a_force_that_does_not_act_on_its_velocity_is_refused() -> None:
    message = refusal(states=(State("x", 0, "v - f"), State("v", 0, "-x")), contacts=(CONTACT,))
    assert "the force f does not act on the relative velocity" in message


def test_a_normal_load_that_uses_the_force_it_limits_is_a_circle() -> None:
    message = refusal(contacts=(Contact("f", velocity="v", normal="1 + f", law=STICTION),))
    assert "circle" in message
    assert "f" in message


def test_definitions_that_use_each_other_are_a_circle() -> None:
    message = refusal(states=(State("v", 0, "a"),), definitions={"a": "b + 1", "b": "2*c", "c": "a - v"})
    assert "a, b, c" in message
    assert "circle" in message


def test_two_contacts_on_one_velocity_are_refused() -> None:
    second = Contact("g", velocity="2*v", normal="1", law=STICTION)
    message = refusal(states=(State("v", 0, "-f - g"),), contacts=(CONTACT, second))
    assert "f, g" in message
    assert "not independent" in message
    assert "hs.MechanicalSystem" in message


def test_a_relative_velocity_that_is_linear_in_no_state_is_refused() -> None:
    message = refusal(contacts=(Contact("f", velocity="v**3 + v", normal="1", law=STICTION),))
    assert "not linear in any state" in message


def test_a_relative_velocity_that_depends_on_a_mode_is_refused() -> None:
    switch = Component("s", modes=(Mode("a", set={"e": "1"}), Mode("b", set={"e": "2"})), initial="a")
    message = refusal(
        contacts=(Contact("f", velocity="v - e", normal="1", law=STICTION),), components=(switch,)
    )
    assert "depends on a mode" in message


def test_one_rate_changed_by_two_components_is_refused() -> None:
    def component(name: str) -> Component:
        return Component(name, modes=(Mode("a"), Mode("b", der={"v": "0"})), initial="a")

    message = refusal(states=(State("v", 0, "1"),), components=(component("one"), component("two")))
    assert "one and two" in message


@pytest.mark.parametrize("text", ["sqrt(-v**2)", "1/(v - v)", "log(x - x)"])
def test_what_is_not_real_is_refused_with_its_text(text: str) -> None:
    assert text in refusal(states=(State("x", 0, "v"), State("v", 0, text)))


# -- with and without the compiler ------------------------------------------------------------------------------

RUNS = """
import json, sys
import hybridsim as hs
runs = [("dfcs", (0.0, 0.06), {}), ("dfcs", (0.0, 0.04), {"integrator": "rk4-dichotomy"}),
        ("static-kinetic", (0.0, 12.0), {}), ("bouncing-ball", (0.0, 1.5), {}), ("thermostat", (0.0, 8.0), {}),
        ("sampled-servo", (0.0, 0.1), {}), ("belt", (0.0, 15.0), {"rtol": 1e-7})]
out = []
for name, span, options in runs:
    sol = hs.simulate(name, span, **options)
    events = [[e.t, e.kind, e.component, e.guard, e.source, e.target, e.x_plus.tolist()] for e in sol.events]
    modes = {c: [m.mode for m in intervals] for c, intervals in sol.modes.items()}
    out.append({"status": sol.status, "events": events, "modes": modes, "end": sol.y[:, -1].tolist()})
json.dump(out, sys.stdout)
"""


def run_elsewhere(jit: str) -> list[dict[str, object]]:
    environment = {**os.environ, "HYBRIDSIM_JIT": jit}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RUNS], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_same_events_with_and_without_the_compiler() -> None:
    """Plain Python may differ from machine code in the last digits, and in nothing else."""
    for plain, compiled in zip(run_elsewhere("0"), run_elsewhere("1"), strict=True):
        assert plain["status"] == compiled["status"] == "finished"
        assert plain["modes"] == compiled["modes"]
        assert len(plain["events"]) == len(compiled["events"]) > 0
        for one, other in zip(plain["events"], compiled["events"], strict=True):
            assert one[1:6] == other[1:6]
            assert one[0] == pytest.approx(other[0], rel=1e-12, abs=1e-12)
            assert one[6] == pytest.approx(other[6], rel=1e-9, abs=1e-9)
        assert plain["end"] == pytest.approx(compiled["end"], rel=1e-9, abs=1e-9)
