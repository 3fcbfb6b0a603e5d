"""This module defines a record of a fit: measured quantities over time, and settings of this experiment only."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hybridsim.analysis.fit.unknown import start_of
from hybridsim.arguments import as_real, cannot_be, finite_number, is_row, text
from hybridsim.errors import UsageError, nearest
from hybridsim.model import Model
from hybridsim.model.toml.table_file import column_names, read_columns
from hybridsim.model.units.parse import write_unit
from hybridsim.model.units.quantities import declared_quantities
from hybridsim.model.units.seconds import REMEDY, SECOND, in_seconds


@dataclass(frozen=True)
class Record:
    """A measurement: times, and values of states, outputs or other quantities of a model at these times.

    Parameters
    ----------
    data : mapping of str to sequence of float, path or DataFrame
        The column ``t`` contains increasing times (k,), in the unit of the model's time. Each other column (k,)
        has the name and unit of a quantity of the model. NaN, or an empty cell of a file, marks a missing sample.
        A path names a CSV file whose first line contains the names.
    quantities : mapping of str to str, optional
        Quantity of the model, or ``t``, by column, if the names differ; ``dropped`` then lists the other columns.
    params : mapping of str to str or float, optional
        Parameters that this experiment had, such as the speed of a belt.
    x0 : mapping of str to float, optional
        Start values of this experiment.
    t0 : float, optional
        Time at which the run starts; the default is the first time of the record.
    time_unit : str, optional
        Unit of the column ``t``, such as "ms". The times are then converted to seconds.

    Examples
    --------
    >>> import hybridsim as hs
    >>> record = hs.Record({"t": [0, 0.1, 0.2], "x": [1.0, 0.9, 0.7]}, params={"N": 20})
    >>> record.t.shape
    (3,)
    """

    data: Any
    quantities: Mapping[str, str] | None = None
    params: Mapping[str, Any] = field(default_factory=dict)
    x0: Mapping[str, float] = field(default_factory=dict)
    t0: float | None = None
    time_unit: str | None = None

    def __post_init__(self) -> None:
        for name in ("quantities", "params", "x0"):
            value = getattr(self, name)
            if not isinstance(value, Mapping) and (value is not None or name != "quantities"):
                raise cannot_be(name, value, "use a dict of names, such as {'position': 'x'}")
        columns, dropped = _columns(self.data, self.quantities)
        if "t" not in columns:
            raise UsageError(
                f"the `data` of the record have no column 't'; the columns are: "
                f"{', '.join((*columns, *dropped)) or 'none'}",
                remedy="the column of the times must have the name t; rename it with quantities={'time': 't'}, "
                "or with --column time=t on the command line",
            )
        t = self._times(columns.pop("t"))
        if len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0.0).all():
            raise UsageError(
                "the times of the record do not increase", remedy="sort the record by time, without repeats"
            )
        start = float(t[0]) if self.t0 is None else finite_number(self.t0, "t0")
        if start > t[0]:
            raise UsageError(
                f"t0 is {start!r}, after the first time {float(t[0])!r} of the record",
                remedy="use a t0 at or before the first time of the record",
            )
        if not columns:
            raise _nothing_measured(dropped)
        for name, values in columns.items():
            if len(values) != len(t):
                raise UsageError(
                    f"column {name!r} has {len(values)} values, but there are {len(t)} times",
                    remedy="use one value for each time, and NaN for a missing value",
                )
            if np.isinf(values).any():
                raise UsageError(
                    f"column {name!r} contains an infinite value", remedy="use NaN for a missing value"
                )
        for name, value in (("t", t), ("t0", start), ("columns", columns), ("dropped", dropped)):
            object.__setattr__(self, name, value)

    t: np.ndarray = field(init=False, repr=False)
    columns: dict[str, np.ndarray] = field(init=False, repr=False)
    dropped: tuple[str, ...] = field(init=False, repr=False)

    def __repr__(self) -> str:
        names = f"t = {self.t[0]:g} to {self.t[-1]:g}; {', '.join(self.columns)}"
        dropped = f"; dropped: {', '.join(self.dropped)}" if self.dropped else ""
        return f"<Record: {len(self.t)} times, {names}{dropped}>"

    def _times(self, column: np.ndarray) -> np.ndarray:
        if self.time_unit is None:
            return column
        unit = text(self.time_unit, "time_unit")
        times = in_seconds(column.tolist(), unit)
        if times is None:
            raise cannot_be("time_unit", unit, REMEDY)
        return np.array(times)

    def require_quantities(self, model: Model, known: tuple[str, ...]) -> None:
        """Raise an error for a column that is not a quantity of the model, and for times in another unit."""
        units = declared_quantities(model) if self.time_unit is not None else None
        if units is not None and units.time is not None and units.time.differs(SECOND):
            raise UsageError(
                f"`time_unit` gives times in s, but the time of model {model.name} is in {write_unit(units.time)}",
                remedy="remove `time_unit`, and use times in the unit of the model",
            )
        for name in self.columns:
            if name not in known:
                raise UsageError(
                    f"model {model.name} has no quantity {name!r}, but a record has a column of this name",
                    remedy=f"{nearest(name, known, kind='quantities')}; "
                    "to select and rename columns, use hs.Record(data, quantities={column: quantity}), "
                    "or --column COLUMN=QUANTITY on the command line",
                )


def records_of(records: Any) -> tuple[Record, ...]:
    """Return a list of records. A single record may be passed without a list, as data or as a path."""
    if isinstance(records, list | tuple):
        if not records:
            raise cannot_be("records", records, "use at least one record")
        return tuple(one if isinstance(one, Record) else Record(one) for one in records)
    return (records if isinstance(records, Record) else Record(records),)


def refuse_unknowns_of_records(records: tuple[Record, ...], unknowns: Iterable[str]) -> None:
    """Raise an error if a record sets a quantity that is unknown, because all records share the unknowns."""
    for name in unknowns:
        for record in records:
            if name in record.params or name in map(start_of, record.x0):
                raise UsageError(
                    f"a record sets {name}, which is also one of the `unknowns`",
                    remedy=f"remove {name} from the record or from the `unknowns`; all records share the "
                    "unknowns",
                )


def _nothing_measured(dropped: tuple[str, ...]) -> UsageError:
    """Return the error for a record without a quantity; `dropped` are the columns that `quantities` leaves out."""
    if not dropped:
        return UsageError(
            "the record has times but no measured quantity", remedy="add a column for each quantity"
        )
    return UsageError(
        f"`quantities` selects no measured quantity, and drops the columns {', '.join(dropped)}",
        remedy=f"add the measured columns, such as quantities={{{dropped[0]!r}: QUANTITY}}, "
        f"or --column {dropped[0]}=QUANTITY on the command line",
    )


def _columns(
    data: Any, quantities: Mapping[str, str] | None
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the times and the columns by quantity, and the columns that `quantities` does not select."""
    is_file = isinstance(data, str | PathLike)
    if not is_file and not (hasattr(data, "keys") and hasattr(data, "__getitem__")):
        raise cannot_be("data", data, "use a dict of columns, a DataFrame or the path of a CSV file")
    names = column_names(Path(data)) if is_file else list(data.keys())  # a DataFrame has keys, too
    for name in quantities or ():
        if name not in names:
            raise UsageError(
                f"`quantities` contains {name!r}, which is not a column of the record",
                remedy=nearest(str(name), [str(each) for each in names], kind="columns"),
            )
    chosen = {name: name for name in names} if quantities is None else dict(quantities)
    for quantity, count in Counter(chosen.values()).items():
        if count > 1:
            raise UsageError(
                f"`quantities` assigns {count} columns to {quantity}",
                remedy="use a separate record for each column, or declare an output in the model for each sensor",
            )
    if "t" in names and "t" not in chosen.values():
        chosen["t"] = "t"
    ordered = sorted(chosen, key=lambda name: str(chosen[name]) != "t")
    if is_file:
        if "t" not in chosen.values():
            return dict.fromkeys(map(str, names), np.empty(0)), ()
        values = [np.array(column) for column in read_columns(Path(data), ordered, may_lack=True)]
    else:
        values = [_numbers(data[name], str(name)) for name in ordered]
    dropped = tuple(str(name) for name in names if name not in chosen)
    return {str(chosen[name]): column for name, column in zip(ordered, values, strict=True)}, dropped


def _numbers(column: Any, name: str) -> np.ndarray:
    """Return real numbers (k,); None and NaN become NaN."""
    if not is_row(column):
        raise UsageError(f"column {name!r} of `data` is {column!r}", remedy="use a sequence of numbers")
    values = [math.nan if value is None else as_real(value) for value in column]
    if None in values:
        raise UsageError(
            f"column {name!r} contains a value that is not a number",
            remedy="use a number at each time, and NaN where a number is missing",
        )
    return np.array(values, dtype=float)
