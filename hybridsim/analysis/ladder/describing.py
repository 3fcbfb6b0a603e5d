"""This module computes the first harmonic of the friction force of a contact with sinusoidal velocity."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.analysis.ladder.forces import inlined
from hybridsim.analysis.ladder.ladder_step import DoesNotApply
from hybridsim.expr import evaluate, parse
from hybridsim.model import Contact, Model

# Gauss's rule over a quarter cycle. It resolves a Stribeck knee of 1/100 of the largest speed to 1e-10.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(128)
_ANGLES = 0.25 * math.pi * (1.0 + _NODES)


class FirstHarmonic:
    """F1(V) = (4/pi) integral over a quarter cycle of slip(V cos a) cos a da, with force F1 cos = (F1/V) v."""

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
        unknown = self._slip.names - self._values.keys() - {self._speed}
        if unknown:
            raise DoesNotApply(
                f"the friction of contact {contact.name} depends on {', '.join(sorted(unknown))}"
            )
        self._constant = self._slip_at(0.0) if self._speed not in self._slip.names else None

    def __call__(self, speed: float) -> float:
        if self._constant is not None:
            return 4.0 / math.pi * self._constant
        cosines = np.cos(_ANGLES)
        forces = np.array([self._slip_at(float(v)) for v in speed * cosines])
        return float(_WEIGHTS @ (forces * cosines))  # (4/pi) (pi/4) = 1

    def _slip_at(self, v: float) -> float:
        return float(evaluate(self._slip, {**self._values, self._speed: v}))


def _unused(taken: set[str], wish: str) -> str:
    while wish in taken:
        wish += "_"
    return wish
