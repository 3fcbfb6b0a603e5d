"""This module computes derivatives of the run-time vector: of parameters, discrete states, angles and inputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.analysis.variations.values.parameters import start_slopes
from hybridsim.analysis.variations.values.signal_slopes import SignalSlopes
from hybridsim.analysis.variations.values.table_slopes import TableSlopes, TableValue
from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.model.smoothing.steps_in_time import constant_inputs


class VectorSlopes:
    """Derivatives of the run-time values with respect to discrete states, parameters and values of tables.

    Parameters
    ----------
    at : the start of the run.
    tables : the values of tables.
    """

    def __init__(self, system: System, at: Instant, tables: Sequence[TableValue] = ()) -> None:
        self.system = system
        layout, module = system.layout, system.code.module
        P = layout.parameters
        p: list[Any] = list(system.vector(at, np.zeros(layout.discrete)))
        p[:P] = with_slopes(p[:P], np.eye(P))
        out: list[Any] = [0.0] * layout.phases
        differentiated(module.rates)(0.0, [], p, [], out)
        self.rates = values_and_slopes(out, P)[1]  # of the forcing's angular rates
        self._signals = self._of_signals()
        inputs = system.model.inputs
        self._tables = [
            (one.number, TableSlopes(inputs[one.number], one.value, system.values)) for one in tables
        ]
        n, d = system.n, layout.discrete
        self._fixed = np.zeros(
            (n + 1 + layout.size, n + 1 + d + P + len(tables))
        )  # the part that does not depend on the instant
        self._fixed[: n + 1, : n + 1] = np.eye(n + 1)
        self._fixed[n + 1 :][layout.discrete_slice, n + 1 : n + 1 + d] = np.eye(d)
        self._fixed[n + 1 : n + 1 + P, n + 1 + d : n + 1 + d + P] = np.eye(P)
        self.arguments = [*system.names, "t", *(q.name for q in system.model.discrete), *system.values]
        self.arguments += [f"{inputs[one.number].name}[{one.value}]" for one in tables]

    def _of_signals(self) -> list[SignalSlopes]:
        model, width = self.system.model, self.system.layout.parameters
        if not model.inputs:
            return []
        unit = np.eye(width)
        starts = start_slopes([each.start for each in model.discrete], model, unit)
        slopes = dict(zip((each.name for each in model.parameters), unit, strict=True))
        slopes |= dict(zip((each.name for each in model.discrete), starts, strict=True))
        values = {**model.discrete_values(), **constant_inputs(model), **self.system.values}
        slopes = {name: np.zeros(width) for name in values} | slopes
        return [
            SignalSlopes(declared, signal, values, slopes, width)
            for declared, signal in zip(model.inputs, self.system.signals, strict=True)
        ]

    def of(self, p: np.ndarray) -> np.ndarray:
        """Return the derivatives (size of p, d + P + V) of the run-time vector p with respect to all constants."""
        n = self.system.n
        return self.seeds(p)[n + 1 :, n + 1 :]

    def seeds(self, p: np.ndarray) -> np.ndarray:
        """Return derivatives of the formulas' arguments with respect to states, local time and all constants."""
        layout, found = self.system.layout, self._fixed.copy()
        below = found[self.system.n + 1 :, self.system.n + 1 + layout.discrete :]
        P = layout.parameters
        origin = float(p[layout.origin_at])
        if layout.phases:
            below[layout.phases_at : layout.signals_at, :P] = origin * self.rates
        for k, signal in enumerate(self._signals):
            if not signal.is_fixed:
                at = layout.signals_at + SIGNAL_SLOTS * k
                below[at : at + SIGNAL_SLOTS, :P] = signal.coefficients(origin, p[at : at + SIGNAL_SLOTS])
        for v, (number, table) in enumerate(self._tables):
            at = layout.signals_at + SIGNAL_SLOTS * number
            below[at : at + SIGNAL_SLOTS, P + v] = table.coefficients(origin)
        return found

    @property
    def is_fixed(self) -> bool:
        """Whether the derivatives depend only on the origin of local time, as `seeds_and_rates` assumes."""
        return not self._tables and all(signal.is_fixed for signal in self._signals)

    def seeds_and_rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return `seeds` for a local time with origin 0, and their derivatives with respect to the origin."""
        layout, by_origin = self.system.layout, np.zeros_like(self._fixed)
        below = by_origin[self.system.n + 1 :, self.system.n + 1 + layout.discrete :]
        below[layout.phases_at : layout.signals_at, : layout.parameters] = self.rates
        return self._fixed, by_origin

    def constants(self) -> np.ndarray:
        """Return the values (P + V,) of the parameters and of the values of tables."""
        return np.array([*self.system.values.values(), *(table.value for _, table in self._tables)])

    def lifted(self, p: np.ndarray, d: np.ndarray, Yd: np.ndarray, G: np.ndarray) -> list[Any]:
        """Return the run-time values of a model as dual numbers in M directions.

        d, Yd : values (d,) and derivatives (d, M) of the discrete states. G (P + V, M) : of the others.
        """
        layout = self.system.layout
        values, slopes = p.copy(), self.of(p) @ np.concatenate([Yd, G])
        values[layout.discrete_slice] = d
        found: list[Any] = with_slopes(values, slopes)
        for at in (layout.origin_at, layout.pin_at):
            found[at] = float(p[at])
        return found

    def knots(self, t: Instant) -> list[tuple[str, np.ndarray]]:
        """Return the inputs with a knot at an instant, within rounding, with the derivatives (P + V,) of the time."""
        slack = 4.0 * math.ulp(float(t))
        found = []
        for one in self._signals:
            knot = one.signal.next_knot(t.plus(-slack), True)
            if knot is not None and abs(knot.minus(t)) <= slack:
                found.append((one.declared.subject, np.append(one.knot(knot), np.zeros(len(self._tables)))))
        return found
