"""This module warns of normal loads that are zero at the time of a linearization, and change with time."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.signals import Signal
from hybridsim.engine.system.system import System
from hybridsim.expr.grammar import TIME
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.one_sided import number_of


def zero_loads(system: System, t: float, x: np.ndarray) -> tuple[str, ...]:
    """Return a warning for each contact whose load is zero at time t and states x, and depends on time.

    A load is left out if it depends on a variable that the modes of a component set.
    """
    model = system.written
    meanings, inputs = Meanings(model), {declared.name for declared in model.inputs}
    numbers = {**model.parameter_values(), **model.discrete_values(), TIME: t}
    numbers |= dict(zip(system.names, x.tolist(), strict=True))
    for declared, signal in zip(system.model.inputs, system.signals, strict=True):
        numbers[declared.name] = _value(signal, t)
    return tuple(
        f"the normal load of {contact.name} is 0 at t = {t:g}, at which the model is linearized, and it changes with "
        "time: give the model its final load as a constant"
        for contact in model.contacts
        if meanings.depended_on(contact.normal.names) & {TIME, *inputs}
        and number_of(contact.normal.tree, numbers, meanings.lookup) == 0.0
    )


def _value(signal: Signal, t: float) -> float:
    """Return the value of an input just after time t."""
    c0, c1, c2, c3, start, offset = signal.piece(Instant(t), True)
    d = -start
    if signal.kind == "chirp" or signal.shape == "sine":
        return offset + c3 * math.sin(c0 + d * (c1 + d * c2))
    return c0 + d * (c1 + d * (c2 + d * c3))
