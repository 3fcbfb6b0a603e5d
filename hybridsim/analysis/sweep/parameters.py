"""This module computes parameters and initial states of many sweep points as arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from hybridsim.analysis.sweep.work.job import Settings
from hybridsim.errors import HybridsimError
from hybridsim.expr import Expression, evaluate
from hybridsim.model import Model
from hybridsim.model.checks.values import checked_names


class Setter:
    """Computes parameters and initial values for the points of a sweep.

    Parameters
    ----------
    model : a valid model.
    names : the names that are set at each point.
    at : returns the model at a point; used if other values depend on the names that are set.
    """

    def __init__(self, model: Model, names: Sequence[str], at: Callable[[Settings], Model]) -> None:
        self._at, self._names = at, tuple(names)
        self._states = [state.name for state in model.states]
        self._parameters = [parameter.name for parameter in model.parameters]
        self._base = np.array(list(model.parameter_values().values()), dtype=float)
        self._start = np.array(list(model.start_values().values()), dtype=float)
        others = [p.value for p in model.parameters if p.name not in names]
        others += [s.start for s in model.states if s.name not in names]
        read_names = set().union(*(expression.names for expression in others), checked_names(model))
        self._is_plain = not read_names & set(names)
        self._known: dict[Expression, float] = {}

    def values(self, points: Sequence[Settings]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return parameters, initial states, and the indices of the valid points, as arrays."""
        parameters = np.tile(self._base, (len(points), 1))
        starts = np.tile(self._start, (len(points), 1))
        if not self._is_plain:
            return parameters, starts, self._one_by_one(points, parameters, starts)
        settings = np.array([[self._number(value) for value in point] for point in points])
        for k, name in enumerate(self._names):
            if name in self._states:
                starts[:, self._states.index(name)] = settings[:, k]
            else:
                parameters[:, self._parameters.index(name)] = settings[:, k]
        return parameters, starts, np.flatnonzero(np.isfinite(settings).all(axis=1))

    def _one_by_one(
        self, points: Sequence[Settings], parameters: np.ndarray, starts: np.ndarray
    ) -> np.ndarray:
        sound = []
        for i, point in enumerate(points):
            try:
                model = self._at(point).validate()
                values, start = model.parameter_values(), model.start_values()
            except HybridsimError:
                continue  # an individual run gives the error
            parameters[i], starts[i] = list(values.values()), list(start.values())
            sound.append(i)
        return np.array(sound, dtype=np.int64)

    def _number(self, setting: float | Expression) -> float:
        """Return the value of a setting, or NaN if it depends on other settings."""
        if not isinstance(setting, Expression):
            return setting
        if setting not in self._known:
            self._known[setting] = evaluate(setting, {}) if setting.is_constant else math.nan
        return self._known[setting]
