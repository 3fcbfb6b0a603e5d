"""This module defines the result of a sweep: arrays over its axes, and a status for every point."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.sweep.axes import POINT
from hybridsim.analysis.sweep.work.job import DONE, NOT_RUN
from hybridsim.arguments import known_name
from hybridsim.errors import printable
from hybridsim.files import json_record, whole_file
from hybridsim.model import Model
from hybridsim.model.free_name import free_name
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.presentation.tables import library

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_SHOWN = 5  # number of statuses that are shown
_STATUS = "status"  # the title of the statuses in tables


@dataclass(frozen=True, eq=False)
class Sweep(Readable):
    """The results of a measure at many values of parameters.

    Parameters
    ----------
    model : Model
        The model with all settings that are the same at every point.
    mode : str
        "grid" or "list".
    axes : mapping of str to array
        Values (k,) of each parameter in order; texts if an expression depends on another axis.
    values : mapping of str to array
        Readings by name. Their shape is that of the grid, or (k,) for a list, with one more dimension if the
        measure is an array. NaN marks missing values.
    status : array
        Of the same shape: "ok", or the error.
    units : mapping of str to str, optional
        Units of axes and readings, as far as they are known.
    measure : str, optional
        The name of the measure.
    interrupted : bool, optional
        Whether Ctrl-C ended it; the points that were not run have the status "not run".
    wall_time, executor : float, str, optional
        The total time in seconds, and the executor that did the work.
    one_by_one : int, optional
        Number of points that were measured one by one in this call. Compiled code measures all others together.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.sweep("dfcs", {"mu": [0.4, 0.5], "N": [30, 40]}, lambda m: m.parameter_values()["N"])
    >>> found.dimensions, found["value"].tolist()
    (('mu', 'N'), [[30.0, 40.0], [30.0, 40.0]])
    """

    model: Model
    mode: str
    axes: Mapping[str, np.ndarray]
    values: Mapping[str, np.ndarray]
    status: np.ndarray
    units: Mapping[str, str] = field(default_factory=dict)
    measure: str = ""
    interrupted: bool = False
    wall_time: float = math.nan
    executor: str = ""
    one_by_one: int = 0

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Name of each dimension of `status`."""
        return tuple(self.axes) if self.mode == "grid" else (POINT,)

    @property
    def failed(self) -> np.ndarray:
        """A mask, in the shape of `status`, of the points that have no result."""
        return self.status != DONE

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the array of results with a given name."""
        return self.values[known_name(name, list(self.values), "the sweep has no", "readings")]

    def __repr__(self) -> str:
        return "\n".join([heading(self), *statuses(self)])

    def table(self) -> str:
        """Return the extremes of each result, and the counts of statuses, as text."""
        rows: list[tuple[str, ...]] = []
        for name, values in self.values.items():
            unit = self.units.get(name, "")
            if values.dtype.hasobject:
                counted = Counter(text for text in values.ravel().tolist() if text != "").most_common(_SHOWN)
                rows.append((name, ", ".join(f"{text} {count}" for text, count in counted), "", unit))
                continue
            numbers = np.abs(values) if np.iscomplexobj(values) else values
            if np.isfinite(numbers).any():
                low, high = (int(find(numbers)) for find in (np.nanargmin, np.nanargmax))
                ends = [f"{numbers.ravel()[k]:.6g} at {_where(self, k, values.shape)}" for k in (low, high)]
                shown = f"|{name}|" if np.iscomplexobj(values) else name
                rows.append((shown, *ends, unit))
        header = ("reading", "least", "greatest", "unit")
        lines = aligned([header, *rows])
        head = [heading(self), *statuses(self)]
        return printable("\n".join([*head, "", *lines] if rows else head))

    def columns(self) -> dict[str, np.ndarray]:
        """Return axes, results and status as columns, one row per point; arrays become ``name[0]``, ...

        A result with the name of another column gets an underscore: the result ``status`` is the column ``status_``.
        """
        if self.mode == "grid":
            grids = np.meshgrid(*self.axes.values(), indexing="ij")
            found = {name: grid.ravel() for name, grid in zip(self.axes, grids, strict=True)}
        else:
            found = dict(self.axes)
        status = free_name(found, _STATUS)
        titles = _Titles([*found, status])
        for name, values in self.values.items():
            rows = values.reshape(self.status.size, -1)
            for k in range(rows.shape[1]):
                title = name if values.ndim == self.status.ndim else f"{name}[{k}]"
                found[titles.unused(title)] = rows[:, k]
        return found | {status: self.status.ravel()}

    def to_csv(self, path: str | Path) -> None:
        """Write one line per point, with numbers in full precision."""
        columns = self.columns()
        with whole_file(path) as partly, open(partly, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            for k in range(self.status.size):
                writer.writerow([_plain(column[k]) for column in columns.values()])

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain Python values; None replaces NaN and infinity."""
        return {
            "model": self.model.name,
            "measure": self.measure,
            "mode": self.mode,
            "dimensions": list(self.dimensions),
            "axes": {name: _nested(values) for name, values in self.axes.items()},
            "values": {name: _nested(values) for name, values in self.values.items()},
            "status": self.status.tolist(),
            "units": dict(self.units),
            "interrupted": self.interrupted,
            "wall_time": self.wall_time if math.isfinite(self.wall_time) else None,
            "executor": self.executor,
            "one_by_one": self.one_by_one,
            "provenance": provenance(self.model),
        }

    def to_json(self, path: str | Path | None = None) -> str:
        """Return all results as JSON text, with versions, machine and model hash. With a path, also write the text."""
        return json_record(self.to_dict(), path)

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame with one row per point: the axes, the results and the status, as in `columns`.

        ``attrs`` holds the name and title of the model, the measure, and the units by name. Without pandas it raises
        `UsageError`.
        """
        frame = library("pandas").DataFrame(self.columns())
        about = {"model": self.model.name, "title": self.model.title, "measure": self.measure}
        frame.attrs = {**about, "units": dict(self.units)}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return an xarray data set over the axes, with the results, their units and the status."""
        xarray = library("xarray")
        where = self.dimensions
        status = free_name([*self.axes, *where], _STATUS)
        titles = _Titles([*self.axes, *where, status])
        variables = {
            titles.unused(name): (self._dimensions_of(name), v, self._unit(name))
            for name, v in self.values.items()
        }
        coordinates = {
            name: (name if self.mode == "grid" else POINT, values, self._unit(name))
            for name, values in self.axes.items()
        }
        about = {"model": self.model.name, "title": self.model.title, "measure": self.measure}
        return xarray.Dataset(variables | {status: (where, self.status.astype(np.str_))}, coordinates, about)

    def plot(self, *names: str, over: str | None = None) -> Any:
        """Draw results as lines over one parameter or as maps over two; see `hybridsim.plot.sweep`.

        Returns the axes; ``hybridsim.plot.save`` writes them to a file.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").sweep(self, *names, over=over)

    def _dimensions_of(self, name: str) -> tuple[str, ...]:
        extra = () if self.values[name].ndim == self.status.ndim else (f"item of {name}",)
        return (*self.dimensions, *extra)

    def _unit(self, name: str) -> dict[str, str]:
        return {"units": self.units[name]} if self.units.get(name) else {}

    def problems(self) -> Iterator[tuple[str, int]]:
        """Yield each error with its number of points, the most frequent error first."""
        counted = Counter(text for text in self.status.ravel().tolist() if text not in (DONE, NOT_RUN))
        yield from counted.most_common()


class _Titles:
    """The titles of the columns of a table, which all differ."""

    def __init__(self, titles: list[str]) -> None:
        self._taken = set(titles)

    def unused(self, title: str) -> str:
        """Return the title, with underscores appended if another column has it."""
        title = free_name(self._taken, title) if title in self._taken else title
        self._taken.add(title)
        return title


def _plain(value: Any) -> Any:
    """Return a number with all its digits, or return a text unchanged."""
    return value if isinstance(value, str) else repr(value.item() if hasattr(value, "item") else value)


def _nested(values: np.ndarray) -> Any:
    """Return lists for JSON: null for NaN and infinity, real and imaginary parts for complex numbers."""
    if np.iscomplexobj(values):
        return {"real": _nested(values.real), "imaginary": _nested(values.imag)}
    if values.dtype.kind != "f":
        return values.tolist()
    plain = values.astype(object)
    plain[~np.isfinite(values)] = None
    return plain.tolist()


def heading(sweep: Sweep) -> str:
    """Return the model, the axes and the names of the results in one line."""
    shape = " x ".join(f"{len(values)} {name}" for name, values in sweep.axes.items())
    return f"Sweep of {sweep.model.name} over {shape}: {', '.join(sweep.values) or 'nothing'}"


def statuses(sweep: Sweep) -> list[str]:
    """Return the number of points per status, with one line per status."""
    counted = Counter(sweep.status.ravel().tolist()).most_common()
    lines = [f"  {count} of {sweep.status.size} points: {text}" for text, count in counted[:_SHOWN]]
    return lines + ([f"  ... and {len(counted) - _SHOWN} other statuses"] if len(counted) > _SHOWN else [])


def _where(sweep: Sweep, k: int, shape: tuple[int, ...]) -> str:
    """Return, as text, the settings of the point that belongs to the k-th value of a result."""
    place = np.unravel_index(k, shape)
    if sweep.mode == "list":
        return ", ".join(_set(name, settings[place[0]]) for name, settings in sweep.axes.items())
    return ", ".join(_set(name, settings[i]) for (name, settings), i in zip(sweep.axes.items(), place))


def _set(name: str, value: object) -> str:
    return f"{name}={value:.6g}" if isinstance(value, float) else f"{name}={value}"
