"""This module computes exact derivatives of the simulated samples of a record with respect to the unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybridsim.analysis.fit.record import Record
from hybridsim.analysis.fit.unknown import start_of
from hybridsim.analysis.variations.both_sides import BothSides
from hybridsim.analysis.variations.over_time import OverTime
from hybridsim.analysis.variations.refused import refuse
from hybridsim.analysis.variations.sensitivities import directions_by
from hybridsim.errors import UsageError
from hybridsim.solution import Solution


class NoDerivative(Exception):
    """Raised if the run of a record has no derivative with respect to an unknown; the text gives the reason."""


def slopes_of_run(
    solution: Solution, record: Record, names: Sequence[str], present: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return the derivatives (m, n) of the samples of a record with respect to the n unknowns.

    names : the unknowns. present : masks (k,) of the times at which each quantity was measured.

    Raises
    ------
    NoDerivative
        If there is none, or none is known.
    """
    starts = {start_of(name): name for name in solution.names}
    parameters = [name for name in names if name not in starts]
    chosen = [starts[name] for name in names if name in starts]
    try:
        refuse(solution)
        directions = directions_by(solution, parameters, chosen, {*record.x0, *chosen})
        found = OverTime(solution, directions, BothSides)
        values = found.along(record.t, tuple(record.columns), "+")
    except (UsageError, ArithmeticError, ValueError) as error:
        raise NoDerivative(str(error).split("\n")[0]) from None
    if not np.isfinite(values).all():
        raise NoDerivative("; ".join(name for name, _ in found.differing()) or "a derivative is not finite")
    ordered = [*(start_of(name) for name in chosen), *parameters]
    columns = [ordered.index(name) for name in names]
    rows = [values[present[name], k] for k, name in enumerate(record.columns)]
    slopes: np.ndarray = np.concatenate(rows)[:, columns]
    return slopes
