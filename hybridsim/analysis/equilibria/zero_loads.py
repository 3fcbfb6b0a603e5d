"""This module warns of normal loads that are zero or small at a linearization, or that settle at another value."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.period import common_period
from hybridsim.engine.system.signals import Signal
from hybridsim.engine.system.system import System
from hybridsim.expr.grammar import TIME
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.contact import Contact
from hybridsim.model.smoothing.one_sided import number_of

_SMALL = 1e-3  # relative to the largest load: below it, the friction of the contact hardly affects the result
_SHIFT, _UNIT = 2.0**-30, 2.0**-50  # relative changes: for a difference, and of a few roundings
_SAMPLES = 256  # of a period, for its largest load
# Times in units of the latest time of the model. A load that is equal at all of them has settled. Their ratios are
# irrational, so that no wave has one phase at all of them.
_FAR = [1e7 * math.sqrt(2.0 + k) for k in (0, 1, 3, 4, 5, 6, 8, 9, 10, 11, 12)]


def zero_loads(system: System, t: float, x: np.ndarray) -> tuple[str, ...]:
    """Return a warning for each contact whose load is zero or small at time t and states x, or settles elsewhere.

    Only loads that depend on time are examined. A load is small relative to the largest one over a period of the
    forcing and at the times of tables, with the same states. A quantity that a schedule sets depends on time. A load is
    left out if it depends on a variable that the modes of a component set.
    """
    model = system.written
    meanings, timed = Meanings(model), {TIME, *(declared.name for declared in model.inputs)}
    timed |= {name for schedule in model.schedules for name in schedule.reset}
    states = dict(zip(system.names, x.tolist(), strict=True))
    numbers = {**model.parameter_values(), **model.discrete_values(), **states}
    found = []
    for contact in model.contacts:
        if not meanings.depended_on(contact.normal.names) & timed:
            continue
        load = _load(contact, system, meanings, numbers, t)
        if load is None:
            continue
        later = [_load(contact, system, meanings, numbers, time) for time in _other_times(system, t)]
        largest = max((other for other in later if other is not None), default=0.0)
        rounding = _rounding(contact, system, meanings, numbers, t, load)
        final, remedy = (
            _final(contact, system, meanings, numbers, t),
            "give the model its final load as a constant",
        )
        if load == 0.0 or load < _SMALL * largest or load <= rounding:
            compared = f", below {_SMALL:g} of its largest value {largest:.4g}" if load and largest else ""
            compared = ", zero within rounding" if load and load <= rounding and not largest else compared
            found.append(
                f"the normal load of {contact.name} is {load:.4g} at t = {t:g}{compared}. The model is linearized at "
                f"this time, but the load depends on time: {remedy}"
            )
        elif final is not None and abs(final - load) > _SMALL * max(abs(final), load):
            found.append(
                f"the normal load of {contact.name} is {load:.4g} at t = {t:g} and settles at {final:.4g}. The model "
                f"is linearized at this time: {remedy} if the final state is of interest"
            )
    return tuple(found)


def _rounding(
    contact: Contact, system: System, meanings: Meanings, numbers: Mapping[str, float], t: float, load: float
) -> float:
    """Return the largest change of a load that rounding errors of the time and of its numbers can cause."""
    moved = [_load(contact, system, meanings, numbers, t * (1.0 + _SHIFT))]
    for name in meanings.depended_on(contact.normal.names) & numbers.keys():
        shifted = {**numbers, name: numbers[name] * (1.0 + _SHIFT)}
        moved.append(_load(contact, system, meanings, shifted, t))
    return sum(abs(other - load) for other in moved if other is not None) * (_UNIT / _SHIFT)


def _load(
    contact: Contact, system: System, meanings: Meanings, numbers: Mapping[str, float], t: float
) -> float | None:
    """Return the load of a contact at a time, or None if it is unknown."""
    signals = zip(system.model.inputs, system.signals, strict=True)
    here = {TIME: t} | {declared.name: _value(signal, t) for declared, signal in signals}
    return number_of(contact.normal.tree, {**numbers, **here}, meanings.lookup)


def _final(
    contact: Contact, system: System, meanings: Meanings, numbers: Mapping[str, float], t: float
) -> float | None:
    """Return the value at which a load settles, or None if it does not settle."""
    latest = max(
        1.0, abs(t), *(abs(time) for declared in system.model.inputs for time in declared.times), 1.0
    )
    loads = {_load(contact, system, meanings, numbers, latest * far) for far in _FAR}
    return loads.pop() if len(loads) == 1 else None


def _other_times(system: System, t: float) -> list[float]:
    """Return the times at which a load is compared with its present value."""
    times = [float(knot) for signal in system.signals for knot in signal.knots]
    period = common_period(system)
    return times if period is None else [*times, *(t + period * k / _SAMPLES for k in range(1, _SAMPLES))]


def _value(signal: Signal, t: float) -> float:
    """Return the value of an input just after time t."""
    if signal.shape == "sine":
        return signal.sine(t)
    c0, c1, c2, c3, start = signal.piece(Instant(t), True)
    d = -start
    if signal.kind == "chirp":
        return c3 * math.sin(c0 + d * (c1 + d * c2))
    return c0 + d * (c1 + d * (c2 + d * c3))
