"""This module computes tables of linear modes for many parameter values together."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.linear.matrix_template import template_of
from hybridsim.engine.linear.tables import (
    LinearTables,
    of_matrices,
    usable_modes,
)
from hybridsim.engine.linear.units import horizon_class
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.system.system import System

_COMPUTED = ("rates", "offsets", "weights")  # fields of the atoms that depend on the parameters


class EnsembleTables:
    """Tables of linear modes for all points of a group, as `tables_of` makes them for one point.

    Parameters
    ----------
    numbers : of the points (m,).
    fields : the fields of the tables by name; those that differ between points are stacked along the first axis.
    modes : the number of vectors of modes.

    Attributes
    ----------
    first : the tables of the first point, whose type is that of all points, for kernels.
    addresses : addresses (m,) of the packed tables of all points.
    """

    def __init__(self, numbers: np.ndarray, fields: dict[str, np.ndarray], modes: int) -> None:
        self.numbers = numbers
        self.form = len(fields["kinds"]), len(fields["factors"]), modes, fields["values"].shape[1]
        counts = {name: modes if name not in _COMPUTED else 1 for name in LinearTables._fields}
        shared = {name for name in LinearTables._fields if _is_shared(name)}
        self._arrays = fields  # keep the arrays alive, because the packs hold only addresses
        self.first: Any = packed(
            LinearTables(
                **{
                    name: array
                    if name in shared
                    else array[0]
                    if name in _COMPUTED
                    else array[: counts[name]]
                    for name, array in fields.items()
                }
            )
        )
        steps = [
            0 if name in shared else fields[name].strides[0] * counts[name] for name in LinearTables._fields
        ]
        rows = np.tile(self.first.table, (len(numbers), 1))
        by_array = rows.reshape(len(numbers), len(steps), -1)
        by_array[:, :, 0] += np.arange(len(numbers))[:, None] * np.array(steps, dtype=np.int64)
        self._rows = rows
        self.addresses = rows.ctypes.data + np.arange(len(numbers)) * rows.strides[0]


def _is_shared(name: str) -> bool:
    return name in ("kinds", "term_start", "sources", "factors", "phases")


def ensemble_tables(
    system: System, modes: np.ndarray, parameters: np.ndarray, horizons: np.ndarray
) -> list[EnsembleTables]:
    """Return tables of some combinations of modes at many points: parameters (N, P), horizons (N,).

    There is one group for each order of magnitude of the horizon and each template. Points with tables that are not
    finite are left out.
    """
    classes = np.array([horizon_class(float(h)) for h in horizons])
    groups, left = [], np.arange(len(parameters))
    while len(left):
        template, _ = template_of(system, modes, parameters[left[0]])
        registers, holds = template.recipe.values_at(parameters[left])
        chosen, registers = left[holds], registers[holds]
        for horizon in np.unique(classes[chosen]):
            among = classes[chosen] == horizon
            made = _group(system, template, chosen[among], registers[among], float(horizon))
            if made is not None:
                groups.append(made)
        left = left[~holds]
    return groups


def _group(
    system: System, template: Any, numbers: np.ndarray, registers: np.ndarray, horizon: float
) -> EnsembleTables | None:
    A, rows = template.matrices(registers)
    modes = A.shape[1]
    count = A.shape[0] * modes
    A, rows = (part.reshape(count, *part.shape[2:]) for part in (A, rows))  # stacked along the first axis
    usable = usable_modes(A, rows, system.n)
    known = usable.reshape(-1, modes).any(axis=1)
    numbers, registers = numbers[known], registers[known]
    A, rows, usable = (part[np.repeat(known, modes)] for part in (A, rows, usable))
    if not len(numbers):
        return None
    first, _ = of_matrices(template.atoms(registers[0]), A, rows, usable, system.n, horizon)
    fields = {name: getattr(first, name) for name in LinearTables._fields}
    atoms = zip(LinearTables._fields, template.atoms(registers), strict=False)
    fields |= {name: np.ascontiguousarray(array) for name, array in atoms if name in _COMPUTED}
    return EnsembleTables(numbers, fields, modes)
