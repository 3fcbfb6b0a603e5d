"""This module defines the result of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from scipy.stats import t as student

from hybridsim.analysis.fit.record import Record
from hybridsim.analysis.fit.unknown import Unknown, start_of
from hybridsim.arguments import known_name, number, whole_number
from hybridsim.errors import UsageError
from hybridsim.files import fields_of
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.solution import Solution


@dataclass(frozen=True, repr=False)
class Fit(Readable):
    """The values of unknowns that fit measurements best, with their uncertainty.

    Parameters
    ----------
    model : Model
        The model with the fitted values.
    values, errors : dict of str to float
        Value and standard error of each unknown. The error is infinite if the data do not determine the unknown, and
        NaN if its value is at a bound.
    covariance : array
        (n, n), covariance of the values, in the order of `values`.
    noise : dict of str to float
        Standard deviation of each quantity: the given one, or the one that the residuals have.
    residuals : tuple of dict of str to array
        Measured minus simulated values by quantity, for each record; NaN where a sample is missing.
    cost : float
        Sum of squares of the residuals, each divided by the noise of its quantity.
    samples, runs : int
        Number of samples, and of simulations.
    undetermined : tuple of str
        Combinations of unknowns that the data do not determine.
    warnings : tuple of str
        Reasons for which the values or their errors may be wrong.
    success : bool
        Whether the least-squares method converged.
    message : str
        How it ended.
    records : tuple of Record
        The measurements.
    unknowns : dict of str to Unknown
        Bounds and guess of each unknown.
    settings : mapping
        Options of the runs.
    derivatives : str
        Whether the derivatives were exact or central differences, and why.

    Examples
    --------
    >>> import numpy as np, hybridsim as hs
    >>> t = np.linspace(0, 0.5, 40)
    >>> x = hs.simulate("free-decay", (0, 0.5), params={"mu": 0.3}).output("x", t)
    >>> found = hs.fit("free-decay", {"t": t, "x": x}, {"mu": (0.05, 0.9)})
    >>> round(found.values["mu"], 6)
    0.3
    """

    model: Model
    values: dict[str, float]
    errors: dict[str, float]
    covariance: np.ndarray
    noise: dict[str, float]
    residuals: tuple[dict[str, np.ndarray], ...]
    cost: float
    samples: int
    runs: int
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]
    success: bool
    message: str
    records: tuple[Record, ...]
    unknowns: dict[str, Unknown]
    settings: Mapping[str, Any] = field(default_factory=dict)
    derivatives: str = "exact"

    @property
    def degrees_of_freedom(self) -> int:
        """Number of samples minus number of unknowns."""
        return self.samples - len(self.values)

    @property
    def correlation(self) -> np.ndarray:
        """Correlation (n, n) of the values; NaN for unknowns without a finite error."""
        deviation = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            found: np.ndarray = self.covariance / np.outer(deviation, deviation)
        return np.where(np.isfinite(found), found, np.nan)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the confidence interval of an unknown.

        It is value +/- q error with the quantile q of Student's distribution, and for an unknown with ``log`` the same
        for its logarithm. It holds for independent, normal noise and a model that is linear over the interval.

        Parameters
        ----------
        name : str
            The unknown.
        level : float, optional
            Probability, between 0 and 1.

        Returns
        -------
        tuple of float
            The ends of the interval.
        """
        known_name(name, tuple(self.values), "`name` of an unknown cannot be", "unknowns")
        if not 0.0 < number(level, "level") < 1.0:
            raise UsageError(
                f"`level` cannot be {level!r}", remedy="use a probability between 0 and 1, such as 0.95"
            )
        quantile = float(student.ppf(0.5 + 0.5 * level, max(self.degrees_of_freedom, 1)))
        value, error = self.values[name], self.errors[name]
        if self.unknowns[name].log:
            ratio = float(np.exp(quantile * error / value))
            return value / ratio, value * ratio
        return value - quantile * error, value + quantile * error

    def solution(self, record: int = 0) -> Solution:
        """Simulate a record with the fitted values.

        Parameters
        ----------
        record : int, optional
            Number of the record, from 0.

        Returns
        -------
        Solution
            The run from the start to the last time of the record.
        """
        from hybridsim.analysis.fit.residuals import Residuals

        which = whole_number(record, "record", 0, len(self.records) - 1)
        residuals = Residuals(self.model, self.records, self.unknowns, self.settings)
        return residuals.solution(self.records[which], self.values)

    def plot(self) -> Any:
        """Draw the measured and the simulated values of each record, with the residuals below.

        Returns
        -------
        Figure
            The figure.
        """
        return import_module("hybridsim.plot").fit(self)

    def to_dict(self) -> dict[str, Any]:
        """Return values, errors, 95 % intervals, noise and warnings as plain Python values."""
        return {
            "model": self.model.name,
            **fields_of(self, "success", "message"),
            "unknowns": {
                name: {
                    "value": self.values[name],
                    "error": self.errors[name],
                    "interval": list(self.interval(name)),
                }
                for name in self.values
            },
            "correlation": self.correlation.tolist(),
            "noise": dict(self.noise),
            **fields_of(self, "cost", "samples", "runs"),
            "derivatives": self.derivatives,
            "undetermined": list(self.undetermined),
            "warnings": list(self.warnings),
        }

    def _dropped(self) -> list[str]:
        """Return a line about the columns of the records that were not fitted."""
        names = dict.fromkeys(name for record in self.records for name in record.dropped)
        return [f"  columns not used: {', '.join(names)}"] if names else []

    def __repr__(self) -> str:
        units = {p.name: p.unit for p in self.model.parameters}
        units |= {start_of(s.name): s.unit for s in self.model.states}
        rows = []
        for name, value in self.values.items():
            low, high = self.interval(name)
            rows.append(
                (
                    name,
                    f"{value:.6g}",
                    f"{self.errors[name]:.2g}",
                    f"{low:.6g} .. {high:.6g}",
                    units[name] or "",
                )
            )
        columns = [(name, part) for record in self.residuals for name, part in record.items()]
        sizes = {
            name: float(
                np.sqrt(np.nanmean(np.concatenate([part for each, part in columns if each == name]) ** 2))
            )
            for name in self.noise
        }
        noise = ", ".join(f"{name} {size:.3g}" for name, size in sizes.items())
        return "\n".join(
            [
                f"Fit of {self.model.name}: {self.samples} samples, {self.runs} simulations",
                *aligned([("unknown", "value", "error", "95 % interval", ""), *rows], indent="  "),
                f"  root mean square of the residuals: {noise}",
                *([] if self.success else [f"  not converged: {self.message}"]),
                *(f"  undetermined: {text}" for text in self.undetermined),
                *self._dropped(),
                *(f"  warning: {text}" for text in self.warnings),
            ]
        )
