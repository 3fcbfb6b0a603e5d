"""This module defines a run as a table, and exports it to CSV, NPZ, pandas and xarray."""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.files import whole_file

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True)
class Table:
    """The quantities and modes of a run at given times.

    Parameters
    ----------
    t : times (k,).
    columns : values (k,) by the name of a state, discrete state, output or other quantity.
    modes : for each component the names of its modes, and the index (k,) of the active mode at each time.
    units : declared units by name, including that of ``t``.
    about : name of the model, integrator, status and further facts about the run.
    """

    t: np.ndarray
    columns: Mapping[str, np.ndarray]
    modes: Mapping[str, tuple[tuple[str, ...], np.ndarray]]
    units: Mapping[str, str]
    about: Mapping[str, str]

    def mode_names(self, component: str) -> np.ndarray:
        """Return the names of the modes (k,) of a component."""
        names, numbers = self.modes[component]
        return np.array(names, dtype=np.str_)[numbers]

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write a CSV file with t, the quantities in full precision, and the modes."""
        with whole_file(path) as partly, open(partly, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *self.columns, *map(mode_title, self.modes)])
            numbers = [self.t, *self.columns.values()]
            texts = [self.mode_names(component) for component in self.modes]
            for k in range(len(self.t)):
                row = [repr(float(column[k])) for column in numbers]
                writer.writerow(row + [column[k] for column in texts])

    def to_npz(self, path: str | PathLike[str], events: Mapping[str, np.ndarray]) -> None:
        """Write an NPZ file with an array per quantity, ``mode(c)``, ``events/...`` and ``about.json``."""
        arrays = {"t": self.t, **self.columns}
        arrays |= {mode_title(component): self.mode_names(component) for component in self.modes}
        arrays |= {f"events/{name}": values for name, values in events.items()}
        about = {**self.about, "units": dict(self.units)}
        # numpy.savez cannot store a state called `file`, which is one of its arguments
        with whole_file(path) as partly, zipfile.ZipFile(partly, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, values in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, np.ascontiguousarray(values), allow_pickle=False)
            archive.writestr("about.json", json.dumps(about, indent=1))

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame over t, with a categorical column for the mode of each component."""
        pandas = library("pandas")
        columns: dict[str, Any] = dict(self.columns)
        for component, (names, numbers) in self.modes.items():
            columns[mode_title(component)] = pandas.Categorical.from_codes(numbers, categories=list(names))
        frame = pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))
        frame.attrs = {**self.about, "units": dict(self.units)}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return a data set over t with units, and with a coordinate for the mode of each component."""
        xarray = library("xarray")
        variables = {
            name: ("t", values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.columns.items()
        }
        unit = {"units": self.units["t"]} if "t" in self.units else {}
        coordinates = {"t": ("t", self.t, unit)}
        coordinates |= {mode_title(c): ("t", self.mode_names(c), {}) for c in self.modes}
        return xarray.Dataset(variables, coordinates, attrs=dict(self.about))


def mode_title(component: str) -> str:
    """Return the column name for the modes of a component; no quantity can have this name."""
    return f"mode({component})"


def event_columns(events: Sequence[Any], states: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the events as columns of equal length: t, kind, ..., and ``x-`` and ``x+`` of each state x."""
    columns = {"t": np.array([e.t for e in events], dtype=float)}
    for name in ("kind", "component", "guard", "source", "target"):
        columns[name] = np.array([getattr(e, name) for e in events], dtype=np.str_)
    columns["direction"] = np.array([e.direction for e in events], dtype=int)
    for side, field in (("-", "x_minus"), ("+", "x_plus")):
        values = np.array([getattr(e, field) for e in events], dtype=float).reshape(-1, len(states))
        columns |= {f"{name}{side}": values[:, i] for i, name in enumerate(states)}
    return columns


def event_frame(events: Sequence[Any], states: Sequence[str]) -> pd.DataFrame:
    """Return the events as a data frame with one row per event."""
    return library("pandas").DataFrame(event_columns(events, states))


def library(name: str) -> Any:
    """Import pandas or xarray; raise an error if the library is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise UsageError(f"{name} is not installed", remedy=f"run 'pip install {name}'") from None
