"""This module contains test cases of the dry friction oscillator, with its closed form over the whole run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import hybridsim as hs
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator, Motion
from hybridsim.testing.checks import amplitude, exact_stick, no_transition
from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import Scene, Truth

NAMES = ("m", "c", "k", "Fs", "Fk", "F0", "w")
STUCK = (("exact-stick", exact_stick("f", {"v": 0.0}, rest=("x",))),)


def closed_form(p: Mapping[str, float]) -> ForcedCoulombOscillator:
    """Return the closed-form motion of an oscillator with the parameters `p`."""
    return ForcedCoulombOscillator(p["m"], p["c"], p["k"], p["Fk"], p["Fs"], p["F0"], p["w"])


def at(motion: Motion, t: float) -> tuple[float, float]:
    """Return position and velocity of the closed form at a time."""
    x, v = motion(t)
    return float(x), float(v)


def events(motion: Motion, before: float = math.inf) -> tuple[tuple[float, str], ...]:
    """Return the mode changes of a closed-form motion."""
    return tuple((change.t, f"f:{change.target}") for change in motion.changes if change.t < before)


def states(
    motion: Motion, span: tuple[float, float], count: int
) -> tuple[tuple[float, tuple[float, float]], ...]:
    """Return samples of a closed-form motion at times without events."""
    step = (span[1] - span[0]) / count
    times = [span[0] + (i + 0.37) * step for i in range(count)]
    return tuple((t, at(motion, t)) for t in times)


def oscillator(case: str, **changes: Any) -> Scene:
    """Return a test case with a closed form, which gives all events and samples of the states."""
    fact = CASES[case]
    p = {name: float(fact["params"][name]) for name in NAMES}
    x0, v0 = fact["x0"]
    span: tuple[float, float] = changes.pop("span", tuple(fact["t_span"]))
    motion = closed_form(p).motion(x0, v0, span)
    margin = changes.get("end_margin", 0.0)
    quantities = changes.pop("quantities", ())
    truth = changes.pop("truth", None) or Truth(
        events=events(motion, span[1] - margin if margin else math.inf),
        states=states(motion, span, 40) + ((span[1], at(motion, span[1])),),
        quantities=quantities,
        checks=STUCK,
    )
    unit = 2 * math.pi / (p["w"] if p["F0"] else math.sqrt(p["k"] / p["m"]))
    size = max((abs(row[1] or 0.0) for _, row in truth.states), default=1.0)
    return Scene(
        **{
            "name": case,
            "file": "oscillator",
            "span": span,
            "truth": truth,
            "needs": frozenset({"contacts", "exact-stick"}),
            "params": p,
            "start": {"x": x0, "v": v0},
            "unit": unit,
            "start_is_event": False,
            "speed": size or 1.0,
            **changes,
        }
    )


def den_hartog(case: str) -> Scene:
    """Return the test case of a periodic orbit without stops over ten periods, which ends at a turning point."""
    t0, t1 = CASES[case]["t_span"]
    return oscillator(
        case,
        needs=frozenset({"contacts"}),
        span=(t0, t0 + 10 * (t1 - t0)),
        end_margin=1e-3,
        tol_t=1e-9,
        tol_x=1e-9,
    )


def steady(case: str) -> Scene:
    """Return the test case of a long transient to a steady motion without stops, with known amplitude."""
    fact = CASES[case]
    end, period = fact["t_span"][1], 2 * math.pi / fact["params"]["w"]
    last = (amplitude("x", end - period, end), fact["expected"]["amplitude_last_cycle"])
    # the longest, of 350 periods, still fits at 1e-12 with a method of order 8
    return oscillator(
        case, quantities=(last,), end_margin=1e-3, tol_x=1e-9, effort=5000 if end < 2000 else 9000
    )


def dfcs(name: str, F0: float, ratio: float) -> Scene:
    """Return the test case of the packaged model `dfcs` over a hundred periods from rest."""
    model = hs.load("dfcs").with_(F0=F0, omega=f"{ratio}*sqrt(k/m)")
    p = model.parameter_values()
    limit = p["mu"] * p["N"]
    period = 2 * math.pi / p["omega"]
    motion = ForcedCoulombOscillator(p["m"], p["c"], p["k"], limit, limit, F0, p["omega"]).motion(
        0.0, 0.0, (0.0, 100 * period)
    )
    samples = states(motion, (0.0, 100 * period), 150)
    return Scene(
        name,
        "dfcs",
        (0.0, 100 * period),
        Truth(events(motion), samples, checks=STUCK),
        frozenset({"contacts", "exact-stick"}),
        params={"F0": F0, "omega": f"{ratio}*sqrt(k/m)"},
        unit=period,
        tol_t=1e-9,
        start_is_event=False,
        speed=max(abs(v) for _, (_, v) in samples),
        tolerances=(1e-9, 1e-12),
    )


def backward_orbit() -> Scene:
    """Return the test case of a Den Hartog orbit that runs backward in time through a turning point."""
    case = "DH-r2-f0.2"
    fact = CASES[case]
    p = {name: float(fact["params"][name]) for name in NAMES}
    t0, t1 = fact["t_span"]
    early, late = t0 + 0.25 * (t1 - t0), t0 + 0.75 * (t1 - t0)
    x0, v0 = fact["x0"]
    motion = closed_form(p).motion(x0, v0, (t0, t1))
    turn, _ = fact["expected"]["turning_points"][0]
    samples = tuple((t, at(motion, t)) for t in (early, 0.5 * (early + turn), 0.5 * (late + turn)))
    x, v = at(motion, late)
    return oscillator(
        case,
        name="backward-orbit",
        span=(late, early),
        truth=Truth(((turn, "f:slip-"),), samples),
        start={"x": x, "v": v},
        needs=frozenset({"contacts", "backward", "exact-stick"}),
    )


def backward_stick() -> Scene:
    """Return the test case of a body at rest that runs backward in time, where the past is not unique."""
    return oscillator(
        "FLAG-flag_a",
        name="backward-stick",
        span=(1.0, 0.0),
        truth=Truth(events=None, status="backward-nonunique"),
        start={"x": 0.0, "v": 0.0},
        needs=frozenset({"contacts", "backward", "exact-stick"}),
    )


def threshold() -> Scene:
    """Return the test case of a force that reaches the stick limit and decreases again without any motion."""
    end = CASES["THR-exact"]["t_span"][1]
    truth = Truth(
        (), tuple((t, (0.0, 0.0)) for t in (1.0, math.pi, 7.0, end)), checks=(("", no_transition), *STUCK)
    )
    return oscillator("THR-exact", truth=truth, tol_x=1e-12, floor=1e-12)


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of the dry friction oscillator."""
    return (
        *(oscillator(f"FLAG-flag_{which}") for which in ("a", "b_mus", "d_nodamp")),
        *(den_hartog(f"DH-{which}") for which in ("r2-f0.2", "r0.75-f0.3", "r1.5-f0.5")),
        *(
            steady(f"DHV-{which}")
            for which in (
                "r0.5-z0.1-f0.1",
                "r0.8-z0.05-f0.3",
                "r1-z0.1-f0.4",
                "r1.4-z0.2-f0.3",
                "r1-z0.02-f0.5",
            )
        ),
        threshold(),
        *(oscillator(case, tol_t=1e-9, tol_x=1e-9) for case in ("FREE-1", "FREE-2")),
        dfcs("DFCS-P1", 30, 0.6),
        dfcs("DFCS-P2", 22, 0.64),
        backward_orbit(),
        backward_stick(),
    )
