"""This module defines the simplified model with equivalent viscous damping, by one-term harmonic balance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hybridsim.analysis.ladder.forces import inlined, need_plain_tables, with_forces, with_parameters
from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, Scene, need_stick
from hybridsim.analysis.ladder.linear_response import LinearResponse, NotLinear
from hybridsim.analysis.steady.steady_state import steady_state
from hybridsim.engine.system.period import system_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import HybridsimError
from hybridsim.expr import evaluate, parse, substitute
from hybridsim.model import Contact, Model, Output
from hybridsim.model.laws.law import SPEED

# Gauss's rule over a quarter cycle. It resolves a Stribeck knee of 1/100 of the largest speed to 1e-10.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(128)
_ANGLES = 0.25 * math.pi * (1.0 + _NODES)


class FirstHarmonic:
    """The first harmonic F1(V) of the friction force at velocity V cos a: (4/pi) integral of slip(V cos a) cos a da."""

    def __init__(self, model: Model, contact: Contact) -> None:
        if contact.normal.names - model.constant_names():
            raise DoesNotApply(f"the normal load of contact {contact.name} varies")
        if contact.law.slip_backward is not None or contact.law.stick_backward is not None:
            raise DoesNotApply(
                f"the friction of contact {contact.name} differs between the two sliding directions"
            )
        self._values = model.parameter_values()
        self._speed = _unused(set(self._values), "speed")
        self._slip = inlined(model, contact.slip_force(parse(self._speed)))
        need_plain_tables(contact)
        self._tables = {
            contact.variable(table.name): table
            for table in contact.law.tables
            if table.over.text == SPEED and not any(table.expressions())
        }
        unknown = self._slip.names - self._values.keys() - self._tables.keys() - {self._speed}
        if unknown:
            raise DoesNotApply(
                f"the friction of contact {contact.name} depends on {', '.join(sorted(unknown))}"
            )
        depends_on_speed = bool(self._slip.names & {self._speed, *self._tables})
        self._constant = None if depends_on_speed else self._slip_at(0.0)

    def __call__(self, speed: float) -> float:
        if self._constant is not None:
            return 4.0 / math.pi * self._constant
        cosines = np.cos(_ANGLES)
        forces = np.array([self._slip_at(float(v)) for v in speed * cosines])
        return float(_WEIGHTS @ (forces * cosines))  # (4/pi) (pi/4) = 1

    def _slip_at(self, v: float) -> float:
        of_tables = {name: table.value(v) for name, table in self._tables.items()}
        return float(evaluate(self._slip, {**self._values, **of_tables, self._speed: v}))


def _unused(taken: set[str], wish: str) -> str:
    while wish in taken:
        wish += "_"
    return wish


Response = Callable[[np.ndarray], np.ndarray]

_SOLVED = 1e-12  # relative change of the dampers at convergence
_MAX_ROUNDS, _MAX_ROUNDS_OF_RUNS = 5000, 60  # rounds with a linear response, and with runs
_BELOW, _NO_END = 1e3, 1e15  # start and end of a search, in dampers of the free motion
_ONE_WAY = 1e-6  # relative to its amplitude: a smaller mean velocity counts as zero
_DRIFTS = "a contact slides in one direction on average, so that friction does not damp its vibration"
_NOTHING = "the harmonic balance has no moving solution: it predicts that friction stops everything"


class EquivalentViscous(LadderStep):
    """The simplified model f = c_eq v, c_eq = F1(V)/V; F1 is the first harmonic of friction at v = V cos(a).

    For Coulomb friction c_eq = 4 mu N/(pi V), a damper that does the same work per cycle. V is the first
    harmonic of the relative velocity in the steady motion of the model with these dampers, at the forcing's
    period. V and c_eq are solved together, for all contacts.
    """

    name = "viscous"
    title = "equivalent viscous damping"
    drops = "stick and all harmonics of friction: a damper takes the same work per cycle at the forcing's frequency"

    def apply(self, scene: Scene) -> Model:
        """Return the model with a viscous damper in place of each contact."""
        model = scene.model
        need_stick(model)
        period = _period(model)
        forces = [FirstHarmonic(model, contact) for contact in model.contacts]
        wishes = {f"c_eq_{c.name}": 0.0 for c in model.contacts}
        changed, names = with_parameters(model, wishes)
        dampers = {
            c.name: substitute(parse("c*(v)"), {"c": parse(names[f"c_eq_{c.name}"]), "v": c.velocity})
            for c in model.contacts
        }
        viscous = with_forces(changed, dampers, "viscous", "equivalent viscous damping")
        order = [names[wish] for wish in wishes]
        try:
            response = LinearResponse(model, 2.0 * math.pi / period)
            c = _solve(response, forces, _MAX_ROUNDS)
            if (np.abs(response.mean(c)) > _ONE_WAY * np.abs(response(c))).any():
                raise DoesNotApply(_DRIFTS)
        except NotLinear:
            c = _solve(_by_runs(viscous, scene, order), forces, _MAX_ROUNDS_OF_RUNS)
        return viscous.with_(**dict(zip(order, c.tolist(), strict=True)))


def _period(model: Model) -> float:
    period = system_period(system_of(model))
    if period is None:
        raise DoesNotApply(
            "the harmonic balance needs a single forcing period, which the model does not have"
        )
    return period


def _by_runs(viscous: Model, scene: Scene, names: list[str]) -> Response:
    """Return the response of a model that is not linear, from its steady state."""
    velocities = {f"{n}_v": c.velocity for n, c in zip(names, scene.model.contacts, strict=True)}
    seen = replace(viscous, outputs=(*viscous.outputs, *(Output(n, e) for n, e in velocities.items())))

    def response(c: np.ndarray) -> np.ndarray:
        damped = seen.with_(**dict(zip(names, c.tolist(), strict=True)))
        try:
            steady = steady_state(damped, tol=1e-9, progress=scene.progress)
        except HybridsimError as error:
            raise DoesNotApply(f"the model with dampers has no steady motion: {error.message}") from error
        if not steady.success or steady.multiple > 1:
            raise DoesNotApply(
                f"the model with dampers has no periodic motion with the forcing period: {steady.message}"
            )
        found = np.array([steady.harmonic(name, 1) for name in velocities])
        for name, wave in zip(velocities, found, strict=True):
            if abs(steady.mean[name]) > _ONE_WAY * abs(wave):
                raise DoesNotApply(_DRIFTS)
        return found

    return response


def _solve(response: Response, forces: list[FirstHarmonic], most: int) -> np.ndarray:
    """Return the damping coefficients (contacts,) that are consistent with the motion that they produce.

    The search starts at small dampers, so that it finds the solution with the largest motion. A single damper
    is found by bisection of log(F1(V(c))/(c V(c))), several by rounds of c <- F1(V(c))/V(c) with half steps
    in the logarithm.
    """
    c = _first(response, forces)
    if len(c) == 1:
        return _solve_one(lambda value: _balanced(response, forces, np.array([value]))[0], float(c[0]))
    largest = _NO_END * c
    for _ in range(most):
        balanced = _balanced(response, forces, c)
        if (np.abs(balanced - c) <= _SOLVED * balanced).all():
            return balanced
        c = np.sqrt(c * balanced)
        if (c > largest).any():
            raise DoesNotApply(_NOTHING)
    raise DoesNotApply(f"the harmonic balance did not converge in {most} rounds")


def _solve_one(balanced: Callable[[float], float], start: float) -> np.ndarray:
    from scipy.optimize import brentq

    low = start / _BELOW
    if balanced(low) < low:
        raise DoesNotApply(
            "the harmonic balance has no solution whose damping exceeds 1/1000 of the first estimate of the damping"
        )
    high = 2.0 * low
    while balanced(high) > high:
        low, high = high, 2.0 * high
        if high > _NO_END * start:
            raise DoesNotApply(_NOTHING)
    root = brentq(lambda z: math.log(balanced(math.exp(z))) - z, math.log(low), math.log(high), xtol=_SOLVED)
    return np.array([math.exp(root)])


def _balanced(response: Response, forces: list[FirstHarmonic], c: np.ndarray) -> np.ndarray:
    speeds = np.abs(response(c))
    if not (np.isfinite(speeds) & (speeds > 0.0)).all():
        raise DoesNotApply(_NOTHING)
    return np.array([force(float(v)) / v for force, v in zip(forces, speeds, strict=True)])


def _first(response: Response, forces: list[FirstHarmonic]) -> np.ndarray:
    """Return an estimate from the motion without friction or, if that motion is unbounded, with small damping."""
    try:
        found = _balanced(response, forces, np.zeros(len(forces)))
    except (np.linalg.LinAlgError, DoesNotApply):
        found = _balanced(response, forces, np.full(len(forces), 1e-6))
    if not (found > 0.0).all():
        raise DoesNotApply("a contact has no normal load, so there is no friction for a damper to replace")
    return found
