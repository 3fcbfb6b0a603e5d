"""This module turns the minimum of a fit into its result, with the errors of the values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult

from hybridsim.analysis.fit.doubts import doubts
from hybridsim.analysis.fit.identifiability import undetermined
from hybridsim.analysis.fit.residuals import Residuals
from hybridsim.analysis.fit.result import Fit
from hybridsim.analysis.fit.unknown import Unknown
from hybridsim.model import Model

_AT_BOUND = 1e-6  # of an unknown's size


def summed_up(
    model: Model, residuals: Residuals, unknowns: dict[str, Unknown], best: OptimizeResult,
    noise: dict[str, float], *, is_stated: bool, options: Mapping[str, Any], further: tuple[str, ...] = (),
) -> Fit:  # fmt: skip
    """Return the result with the errors of the values; `further` are warnings about the search."""
    values = residuals.values(best.x)
    weights = 1.0 / np.array([noise[name] for name in residuals.quantity])
    off = residuals.measured - best.predicted
    slopes = residuals.slopes(best.x) * weights[:, None]
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)
    names, sizes = list(values), residuals.sizes.copy()
    for k, (name, unknown) in enumerate(unknowns.items()):
        if not unknown.log:
            sizes[k] = max(abs(values[name]), sizes[k])
    bounds = np.array([unknown.coordinate_bounds for unknown in unknowns.values()])
    at_bound = np.abs(bounds - best.x[:, None]).min(axis=1) <= _AT_BOUND * residuals.sizes
    free = np.flatnonzero(~at_bound)
    values_now = np.array([1.0 if unknowns[name].log else abs(value) for name, value in values.items()])
    per_value = sizes / np.where(values_now > 0.0, values_now, sizes)
    lacking, found = undetermined([names[k] for k in free], slopes[:, free] * sizes[free], per_value[free])
    units = np.array(
        [sizes[k] * (values[name] if unknowns[name].log else 1.0) for k, name in enumerate(names)]
    )
    covariance = np.full((len(names), len(names)), np.nan)
    covariance[np.ix_(free, free)] = found * np.outer(units[free], units[free])
    errors = {name: float(np.sqrt(covariance[k, k])) for k, name in enumerate(names)}
    split, begin, k = [], 0, 0
    for record in residuals.records:
        columns = {}
        for name in record.columns:
            column = np.full(len(record.t), np.nan)
            count = int(residuals.present[k].sum())
            column[residuals.present[k]] = off[begin : begin + count]
            begin, k, columns[name] = begin + count, k + 1, column
        split.append(columns)
    starts = {name: value for name, value in values.items() if name.endswith("(0)")}
    fitted = model.with_(**{name: value for name, value in values.items() if name not in starts})
    fitted = fitted.with_start(**{name.removesuffix("(0)"): value for name, value in starts.items()})
    return Fit(
        model=fitted, values=values, errors=errors, covariance=covariance, noise=noise, residuals=tuple(split),
        cost=float(np.sum((off * weights) ** 2)), samples=len(off), runs=residuals.runs,
        undetermined=tuple(map(str, lacking)),
        warnings=(
            *doubts(residuals, off, noise, [names[k] for k in np.flatnonzero(at_bound)], is_stated=is_stated),
            *further,
        ),
        success=best.status > 0, message=str(best.message), records=residuals.records, unknowns=unknowns,
        settings=dict(options), derivatives=residuals.derivatives,
    )  # fmt: skip
