"""This module computes derivatives of an input of kind "table" with respect to its values.

A piece of a table is linear in the values, also with cubic interpolation. Its derivative with respect to one value is
the piece of the table that has this value 1 and all others 0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.signals import Signal
from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.model.parts.inputs import Input

_NAME = re.compile(r"(.+)\[(\d{1,9})\]")


class TableValue(NamedTuple):
    """One value of an input table, as the index of the input in the model and the index of the value in the table."""

    number: int
    value: int


def table_value(model: Model, name: str) -> TableValue | None:
    """Return the value of a table with a name such as "u[2]", counted from 0; None for another name."""
    found = _NAME.fullmatch(name)
    tables = {each.name: k for k, each in enumerate(model.inputs) if each.kind == "table"}
    if found is None or found[1] not in tables:
        return None
    number, index = tables[found[1]], int(found[2])
    count = len(model.inputs[number].values)
    if index >= count:
        raise UsageError(
            f"the input {found[1]} has only {count} values, so {name} does not exist",
            remedy=f"use an index from 0 to {count - 1}",
        )
    return TableValue(number, index)


class TableSlopes:
    """Derivatives of a table with respect to one of its values."""

    def __init__(self, declared: Input, index: int, parameters: Mapping[str, float]) -> None:
        values = tuple(float(k == index) for k in range(len(declared.values)))
        self.value, self._unit = declared.values[index], Signal(replace(declared, values=values), parameters)

    def coefficients(self, origin: float) -> np.ndarray:
        """Return the derivatives (5,) of the coefficients that describe a table just after an instant."""
        found = np.zeros(SIGNAL_SLOTS)
        found[:4] = self._unit.piece(Instant(origin), True)[:4]
        return found
