"""This module contains test cases near the stick limit: small excess forces, decreasing loads, many stops."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from hybridsim.testing.catalogue.oscillators import STUCK, at, closed_form, events, states
from hybridsim.testing.checks import exact_stick, no_transition
from hybridsim.testing.facts import recomputed
from hybridsim.testing.scene import Scene, Truth, named, needs

STICK = needs("contacts", "exact-stick")


def scenes() -> tuple[Scene, ...]:
    """Return all test cases near the stick limit."""
    return _micro_slip(), _fading(), _many_stops(), _between(), _half(), _small(), _at_rest()


def _swing(name: str, periods: float, **changes: Any) -> Scene:
    """Return the test case of an oscillator that starts from rest, with its closed form over some forcing periods."""
    p = {"m": 1.0, "c": 0.0, "k": 1.0, "Fs": 0.3, "Fk": 0.3, "F0": 1.0, "w": 1.0, **changes}
    unit = 2 * math.pi / p["w"]
    span = (0.0, periods * unit)
    motion = closed_form(p).motion(0.0, 0.0, span)
    samples = states(motion, span, 40)
    return Scene(
        name,
        "oscillator",
        span,
        Truth(events(motion), (*samples, (span[1], at(motion, span[1]))), checks=STUCK),
        STICK,
        params=p,
        unit=unit,
        start_is_event=False,
        speed=max(abs(row[1] or 0.0) for _, row in samples),
    )


def _micro_slip() -> Scene:
    """Return the test case of a force that exceeds the stick limit by 1e-4, so that the body slips by 1e-7."""
    found, samples = recomputed("micro-slip")
    return Scene(
        "micro-slip",
        "oscillator",
        (0.0, 40.0),
        Truth(found, samples, checks=STUCK),
        STICK | {"multiple-roots"},  # between release and the peak of the force there is little time
        params={"m": 1, "c": 0, "k": 1, "Fs": 1, "Fk": 1, "F0": 1 + 1e-4, "w": 0.5},
        unit=4 * math.pi,
        start_is_event=False,
        speed=1e-6,
        tol_x=1e-7,
        floor=1e-7,  # a rounding of the forces is 1e-9 of a slip; rtol 1e-10 asks for 1e-3 of one: below this is luck
        tolerances=(1e-8, 1e-10, 1e-12),  # a slip is 1e-7 of the force over the stiffness
    )


def _fading() -> Scene:
    """Return the test case of a stick limit that decreases to the force at t = 5, where slip begins."""
    samples = tuple((t, ((t - 5) ** 3 / 30, (t - 5) ** 2 / 10)) for t in (5.5, 7.0, 9.0))
    checks = (("exact-stick", exact_stick("f", {"v": 0.0}, rest=("x",))),)
    return named(
        "fading-load",
        (0.0, 9.0),
        Truth(((5.0, "f:slip+"),), ((3.0, (0.0, 0.0)), *samples), checks=checks),
        STICK,
        unit=9.0,
        start_is_event=False,
        speed=1.0,
    )


def _many_stops() -> Scene:
    """Return the test case of a body that is pulled slowly and stops many times in each period."""
    swing = _swing("many-stops", 1, w=0.05, c=0.1, Fs=0.1, Fk=0.05)
    return replace(swing, needs=STICK | {"multiple-roots"})  # a slip is short compared with the period


def _between() -> Scene:
    """Return the test case of a pulled slider that stops where the spring force is between slip and stick force.

    In a slip e = 0.2 + 0.8 cos(s) + 0.5 sin(s), and it ends at tan(s/2) = -0.8/0.5, where e = 0.2 - 0.8.
    """
    rate, kinetic, fall = 0.5, 0.2, 0.8
    slip = 2 * (math.pi - math.atan(fall / rate))
    period = slip + 2 * fall / rate
    begins = [1.0 / rate + k * period for k in range(3)]
    changes = [change for t in begins for change in ((t, "f:slip+"), (t + slip, "f:stick"))]
    samples = [(1.0, (rate, 0.0))]
    for t in begins:
        for s in (0.2 * slip, 0.7 * slip):
            e = kinetic + fall * math.cos(s) + rate * math.sin(s)
            samples.append((t + s, (e, rate + fall * math.sin(s) - rate * math.cos(s))))
        samples.append((t + slip + 1.0, (kinetic - fall + rate, 0.0)))
    return Scene(
        "stops-between-limits",
        "static-kinetic",
        (0.0, begins[-1] + slip + 2.0),
        Truth(tuple(changes), tuple(samples), checks=(("exact-stick", exact_stick("f", {"v": 0.0})),)),
        STICK,
        params={"m": 1, "k": 1, "N": 1, "mu_s": 1, "mu_k": kinetic, "v_pull": rate},
        unit=2 * math.pi,
        start_is_event=False,
        speed=rate + fall,
    )


def _half() -> Scene:
    """Return the test case of an undamped oscillator that is driven at half its natural frequency."""
    swing = _swing("half-frequency", 10, w=0.5)
    return replace(swing, floor=1e-9)  # undamped, so the errors of ten periods add up


def _small() -> Scene:
    """Return the test case of an oscillator with forces scaled by 1/1000, and therefore small speeds."""
    return _swing("small-speeds", 10, F0=1e-3, Fs=3e-4, Fk=3e-4, w=0.75, c=0.1)


def _at_rest() -> Scene:
    """Return the test case of a spring that pulls with half of the stick limit, so that nothing moves."""
    samples = tuple((t, (0.5, 0.0)) for t in (1.0, 30.0, 100.0))
    return Scene(
        "resting-load",
        "oscillator",
        (0.0, 100.0),
        Truth((), samples, checks=(("", no_transition), *STUCK)),
        STICK,
        params={"F0": 0},
        start={"x": 0.5},
        unit=2 * math.pi,
        start_is_event=False,
        tol_x=1e-12,
        floor=1e-12,
    )
