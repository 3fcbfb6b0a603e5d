"""This module recognises a forced linear oscillator with one Coulomb contact, and returns its exact motion.

It uses the declarations of the model (one contact whose force does not depend on the speed, rates that are
linear in the states, one sine) and never its name.
"""

from __future__ import annotations

import cmath
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hybridsim.expr import Expression
from hybridsim.model import Model
from hybridsim.reference.closed_forms.affine import Affine, NotAffine, affine
from hybridsim.reference.closed_forms.closed_form import ClosedForm
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator, Motion
from hybridsim.reference.trajectory import ExactEvent, Trajectory

TITLE = "closed form of the forced oscillator with Coulomb friction"
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Recognised:
    """A recognised system with its closed form, and the names of its position and velocity."""

    system: ForcedCoulombOscillator
    position: str
    velocity: str


def coulomb_oscillator(model: Model, t_span: tuple[float, float]) -> ClosedForm | None:
    """Return the exact motion of the model forward in time, or None if the model has another form."""
    found = recognise(model)
    if found is None or t_span[1] < t_span[0]:
        return None
    system, contact, start = found.system, model.contacts[0], model.start_values()
    x0, v0 = start[found.position], start[found.velocity]
    # The same system with all numbers changed in their last digits. The difference shows the uncertainty that
    # is inherent in double precision.
    nudged = replace(
        system,
        mass=system.mass * (1 - _EPS),
        damping=system.damping * (1 + _EPS),
        stiffness=system.stiffness * (1 + _EPS),
        force=system.force * (1 - _EPS),
        frequency=system.frequency * (1 + _EPS),
    )
    swap = model.states[0].name == found.velocity

    def trajectory(motion: Motion) -> Trajectory:
        def states(t: NDArray[np.float64], side: str) -> NDArray[np.float64]:
            return motion(t)[::-1] if swap else motion(t)  # the motion is continuous, so both sides are equal

        events = tuple(ExactEvent(c.t, contact.name, c.source, c.target) for c in motion.changes)
        return Trajectory(states, t_span, events, {contact.name: motion.first_mode})

    return ClosedForm(
        TITLE,
        exact=trajectory(system.motion(x0, v0, t_span)),
        nudged=trajectory(nudged.motion(x0 * (1 - _EPS), v0 * (1 + _EPS), t_span)),
    )


def recognise(model: Model) -> Recognised | None:
    """Return the oscillator that a model declares, or None for any other model."""
    automata = model.surfaces or model.impacts or model.components
    plain = not (automata or model.discrete or model.inputs or model.schedules)
    if not plain or len(model.states) != 2 or len(model.contacts) != 1:
        return None
    if any(monitor.action != "record" for monitor in model.monitors):
        return None
    try:
        return _read_model(model)
    except (NotAffine, ValueError):  # ValueError: overdamped, or driven at resonance without damping
        return None


def _read_model(model: Model) -> Recognised | None:
    contact, component = model.contacts[0], model.all_components()[0]
    force = contact.name
    values, definitions = model.parameter_values(), dict(model.definitions)
    unknowns = {state.name for state in model.states} | {force}

    def read(expression: Expression) -> Affine:
        return affine(expression, unknowns, values, definitions)

    modes = {mode.name: mode for mode in component.modes}
    slip, backward = read(modes["slip+"].set[force]), read(modes["slip-"].set[force])
    limits = {guard.name: read(guard.expr) for guard in modes["stick"].guards}
    limit = limits["upper"].constant
    coulomb = (
        slip.is_constant
        and backward == Affine(-slip.constant)
        and limits == {"upper": Affine(limit, {force: -1.0}), "lower": Affine(limit, {force: 1.0})}
        and not any(mode.der for mode in component.modes)
    )
    rates = {state.name: read(state.der) for state in model.states}
    for position, velocity in itertools.permutations(rates):
        moves = Affine(0.0, {velocity: 1.0})
        if coulomb and read(contact.velocity) == moves and rates[position] == moves:
            system = _oscillator(rates[velocity], (position, velocity), force, slip.constant, limit)
            return Recognised(system, position, velocity) if system else None
    return None


def _oscillator(
    rate: Affine, names: tuple[str, str], force: str, slip_force: float, stick_limit: float
) -> ForcedCoulombOscillator | None:
    """Return the oscillator with the rate v' = constant + sum of linear terms + one sine, or None."""
    linear: Mapping[str, float] = rate.linear
    if not linear.keys() <= {*names, force} or not linear.get(force, 0.0) < 0 or len(rate.waves) > 1:
        return None
    mass = -1 / linear[force]
    (frequency, phasor), *_ = [*rate.waves.items(), (1.0, 0j)]
    return ForcedCoulombOscillator(
        mass=mass,
        damping=-linear.get(names[1], 0.0) * mass,
        stiffness=-linear.get(names[0], 0.0) * mass,
        slip_force=slip_force,
        stick_limit=stick_limit,
        force=abs(phasor) * mass,
        frequency=frequency,
        phase=cmath.phase(phasor),
        offset=rate.constant * mass,
    )
