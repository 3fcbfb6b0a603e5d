"""This module computes the harmonic response of a linear model whose contacts are viscous dampers.

x' = A x + b e^{iwt} - B F,    V = W x + u e^{iwt},    F_i = c_i V_i
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Mapping

import numpy as np

from hybridsim.expr import evaluate
from hybridsim.model import Input, Model
from hybridsim.reference.closed_forms.affine import Affine, NotAffine, affine

_SAME = 1e-9  # relative; closer frequencies are equal, because parameters carry rounding errors


class NotLinear(Exception):
    """Raised if the rates or relative velocities are not linear in the states."""


class LinearResponse:
    """Relative velocities of a forced linear model as functions of the contacts' damping coefficients."""

    def __init__(self, model: Model, frequency: float) -> None:
        automata = model.surfaces or model.impacts or model.components
        if automata or model.discrete or model.schedules or model.flow is not None:
            raise NotLinear("the model has modes, schedules or Python functions")
        states, forces = [s.name for s in model.states], [c.name for c in model.contacts]
        values, definitions = model.parameter_values(), dict(model.definitions)
        unknowns = {*states, *forces, *(i.name for i in model.inputs)}
        try:
            rates = [affine(s.der, unknowns, values, definitions) for s in model.states]
            slides = [affine(c.velocity, unknowns, values, definitions) for c in model.contacts]
        except NotAffine as fault:
            raise NotLinear("the rates are not linear in the states") from fault
        inputs = {i.name: first_harmonic(i, frequency, values) for i in model.inputs}
        self._frequency = frequency
        self._A, self._B = _matrix(rates, states), _matrix(rates, forces)
        self._W = _matrix(slides, states)
        self._b0, self._u0 = (
            np.array([_mean(a, model.inputs, values) for a in rows]) for rows in (rates, slides)
        )
        self._b, self._u = (np.array([_wave(a, frequency, inputs) for a in rows]) for rows in (rates, slides))

    def __call__(self, dampers: np.ndarray) -> np.ndarray:
        """Return complex amplitudes (contacts,) of the relative velocities, for damping coefficients c."""
        B = self._B * dampers
        resistance = 1j * self._frequency * np.eye(len(self._A)) - self._A - B @ self._W
        x = np.linalg.solve(resistance, self._b + B @ self._u)
        return np.asarray(self._W @ x + self._u)

    def mean(self, dampers: np.ndarray) -> np.ndarray:
        """Return the mean relative velocities (contacts,)."""
        B = self._B * dampers
        x = np.linalg.lstsq(self._A + B @ self._W, -(self._b0 + B @ self._u0), rcond=None)[0]
        return np.asarray(self._W @ x + self._u0)


def _matrix(rows: list[Affine], names: list[str]) -> np.ndarray:
    return np.array([[row.linear.get(name, 0.0) for name in names] for row in rows]).reshape(
        len(rows), len(names)
    )


def _wave(row: Affine, frequency: float, inputs: Mapping[str, complex]) -> complex:
    """Return the complex amplitude of the forcing terms in one rate."""
    own = sum(-1j * p for w, p in row.waves.items() if abs(w - frequency) <= _SAME * frequency)
    return complex(own + sum(row.linear.get(name, 0.0) * wave for name, wave in inputs.items()))


def _mean(row: Affine, inputs: Iterable[Input], values: Mapping[str, float]) -> float:
    """Return the mean of the forcing terms in one rate over a period, without the terms of the states."""
    total = row.constant
    for declared in inputs:
        number = {name: float(evaluate(e, values)) for name, e in declared.expressions.items()}
        square = 2.0 * number["duty"] - 1.0 if declared.shape == "square" else 0.0
        total += row.linear.get(declared.name, 0.0) * (number["offset"] + number["amplitude"] * square)
    return total


def first_harmonic(declared: Input, frequency: float, values: Mapping[str, float]) -> complex:
    """Return the complex amplitude of a periodic input at a frequency, or 0 if the frequencies differ."""
    if declared.kind != "wave" or declared.period is None:
        raise NotLinear(f"the input {declared.name} is not periodic")
    number = {name: float(evaluate(e, values)) for name, e in declared.expressions.items()}
    period = number["period"]
    if abs(2.0 * math.pi / period - frequency) > _SAME * frequency:
        return 0j
    shape = {
        "sine": -1j,
        "triangle": -8j / math.pi**2,
        "sawtooth": 2j / math.pi,
        "square": 2j / math.pi * (cmath.exp(-2j * math.pi * number.get("duty", 0.5)) - 1.0),
    }[declared.shape or "sine"]
    return number["amplitude"] * shape * cmath.exp(-1j * frequency * number["phase"])
