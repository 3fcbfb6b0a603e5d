"""This module computes tables of linear modes for many parameter values together."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.linear.matrix_template import template_of
from hybridsim.engine.linear.tables import LinearTables, of_matrices
from hybridsim.engine.linear.units import horizon_class
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.run.method_kernels import NOT_LINEAR
from hybridsim.engine.system.system import System

_FIELDS = LinearTables._fields
_COMPUTED = ("rates", "offsets", "weights")  # fields of the atoms that depend on the parameters
_SHARED = (
    "kinds",
    "term_start",
    "sources",
    "factors",
    "phases",
    "products",
)  # fields that all points have in common
_HAS_MODES = np.array(
    [name not in _COMPUTED + _SHARED for name in _FIELDS]
)  # fields with a row for each mode
_ITEM_SIZES = np.array([getattr(NOT_LINEAR, name).itemsize for name in _FIELDS])  # bytes
_KINDS, _FACTORS, _VALUES = (_FIELDS.index(name) for name in ("kinds", "factors", "values"))


class EnsembleTables:
    """Tables of linear modes for all points of a group, as `tables_of` makes them for one point.

    Parameters
    ----------
    numbers : of the points (m,).
    tables : a pack with the rows of all points, one point behind the other.
    computed : the fields `_COMPUTED` of all points, by name; one row for each point.
    modes : the number of vectors of modes.

    Attributes
    ----------
    form : the sizes of the tables of a point.
    addresses : addresses (m,) of the packed tables of all points.
    """

    def __init__(self, numbers: np.ndarray, tables: Any, computed: dict[str, np.ndarray], modes: int) -> None:
        count = len(numbers)
        self.numbers = numbers
        self._tables, self._computed = tables, computed  # kept alive, because packs hold only addresses
        whole = tables.table.reshape(len(_FIELDS), -1)  # an address and a shape for each field
        self.form = int(whole[_KINDS, 1]), int(whole[_FACTORS, 1]), modes, int(whole[_VALUES, 2])
        steps = np.where(_HAS_MODES, whole[:, 1:].clip(1).prod(axis=1) // count * _ITEM_SIZES, 0)
        rows = np.tile(whole, (count, 1, 1))
        rows[:, _HAS_MODES, 1] = modes
        for name, array in computed.items():
            k = _FIELDS.index(name)
            rows[:, k, 0], steps[k] = array.__array_interface__["data"][0], array.strides[0]
        rows[:, :, 0] += np.arange(count)[:, None] * steps
        self._rows = rows
        self.addresses = rows.ctypes.data + np.arange(count) * rows.strides[0]

    def first(self) -> Any:
        """Return a copy of the tables of the first point, with array shapes that fit every point."""
        modes, found = self.form[2], {name: getattr(self._tables, name) for name in _FIELDS}
        found |= {name: array[0] for name, array in self._computed.items()}
        return packed(
            LinearTables(
                **{
                    name: array[:modes].copy() if of_modes else array.copy()
                    for (name, array), of_modes in zip(found.items(), _HAS_MODES, strict=True)
                }
            )
        )


def ensemble_tables(
    system: System, modes: np.ndarray, parameters: np.ndarray, horizons: np.ndarray
) -> list[EnsembleTables]:
    """Return tables of some combinations of modes at N points with the given parameters (N, P) and horizons (N,).

    There is one group for each order of magnitude of the horizon and each template. Points with tables that are not
    finite are left out.
    """
    classes = np.array([horizon_class(float(h)) for h in horizons])
    groups, left = [], np.arange(len(parameters))
    while len(left):
        template, of_first = template_of(system, modes, parameters[left[0]])
        if len(left) == 1:
            registers, holds = of_first[None], np.array([True])
        else:
            registers, holds = template.recipe.values_at(parameters[left])
        chosen, registers = left[holds], registers[holds]
        for horizon in sorted(set(classes[chosen].tolist())):
            among = classes[chosen] == horizon
            made = _group(system, template, chosen[among], registers[among], horizon)
            if made is not None:
                groups.append(made)
        left = left[~holds]
    return groups


def _group(
    system: System, template: Any, numbers: np.ndarray, registers: np.ndarray, horizon: float
) -> EnsembleTables | None:
    A, rows, usable = template.matrices(registers)
    modes = len(A) // len(registers)
    known = usable.reshape(-1, modes).any(axis=1)
    numbers, registers = numbers[known], registers[known]
    A, rows, usable = (part[np.repeat(known, modes)] for part in (A, rows, usable))
    if not len(numbers):
        return None
    tables, _ = of_matrices(template.atoms(registers[0]), A, rows, usable, system.n, horizon)
    atoms = zip(_FIELDS, template.atoms(registers), strict=False)
    computed = {name: np.ascontiguousarray(array) for name, array in atoms if name in _COMPUTED}
    return EnsembleTables(numbers, tables, computed, modes)
