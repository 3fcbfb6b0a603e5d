"""This module finds reasons why the result of a fit may be wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hybridsim.analysis.fit.residuals import Residuals

_EXPLAINED = 0.5  # of the variance of a quantity; below, the model does not describe the data
_CORRELATED = 0.5  # correlation of neighbouring residuals; noise of separate samples has about 0
ROUNDING = 1e-6  # of a quantity's deviation; smaller residuals are errors of the runs and no noise
_FACTOR = 100.0  # between the spreads of measured and simulated values; more is a wrong unit
_CHI_SQUARE = 2.0  # ratio of the residuals' mean square to the given noise


def doubts(
    residuals: Residuals,
    off: np.ndarray,
    noise: Mapping[str, float],
    at_bound: Sequence[str],
    *,
    is_stated: bool,
) -> tuple[str, ...]:
    """Return warnings about values at bounds, unexplained data, correlated residuals and wrong noise levels.

    off : (m,), measured minus simulated samples.
    is_stated : whether the noise was given and not estimated.
    """
    found = [f"{name} is at a bound, so that its error is unknown" for name in at_bound]
    for name in residuals.names:
        here = residuals.quantity == name
        spread, size = float(np.std(residuals.measured[here])), float(np.sqrt(np.mean(off[here] ** 2)))
        if spread == 0.0 or size <= ROUNDING * spread:
            continue
        ratio = spread / max(float(np.std(residuals.measured[here] - off[here])), 1e-12 * spread)
        if ratio > 1e11:
            found.append(f"the simulated values of {name} are constant")
        elif not 1.0 / _FACTOR < ratio < _FACTOR:
            found.append(
                f"the measured values of {name} vary {ratio:.3g} times as much as the simulated ones: compare the "
                "units"
            )
        explained = 1.0 - (size / spread) ** 2
        if explained < _EXPLAINED:
            found.append(
                f"the model explains {100 * max(explained, 0.0):.0f} % of the variance of {name}: it does not describe "
                "these data, or the fit ended in a local minimum (use more starts)"
            )
        neighbours = _correlation(residuals, off, name)
        if neighbours > _CORRELATED:
            found.append(
                f"neighbouring residuals of {name} have a correlation of {neighbours:.2f}: the fit ended in "
                "a local minimum (use more starts), the model lacks something, or the noise is correlated; the "
                "errors are too small"
            )
        if is_stated and (excess := (size / noise[name]) ** 2) > _CHI_SQUARE:
            found.append(
                f"the mean square of the residuals of {name} is {excess:.3g} times the given noise: the model lacks "
                "something, or the noise is larger"
            )
    return tuple(found)


def is_local(residuals: Residuals, off: np.ndarray) -> bool:
    """Return whether residuals suggest a local minimum, because they are large or correlated with their neighbours."""
    for name in residuals.names:
        here = residuals.quantity == name
        spread, size = float(np.std(residuals.measured[here])), float(np.sqrt(np.mean(off[here] ** 2)))
        if size > ROUNDING * spread > 0.0 and (
            1.0 - (size / spread) ** 2 < _EXPLAINED or _correlation(residuals, off, name) > _CORRELATED
        ):
            return True
    return False


def _correlation(residuals: Residuals, off: np.ndarray, name: str) -> float:
    """Return the correlation of consecutive residuals of a quantity in the same record."""
    products, before, after, begin, k = 0.0, 0.0, 0.0, 0, 0
    for record in residuals.records:
        for column in record.columns:
            count = int(residuals.present[k].sum())
            if column == name and count > 2:
                part = off[begin : begin + count]
                products += float(part[1:] @ part[:-1])
                before, after = before + float(part[:-1] @ part[:-1]), after + float(part[1:] @ part[1:])
            begin, k = begin + count, k + 1
    return products / math.sqrt(before * after) if before * after > 0.0 else 0.0
