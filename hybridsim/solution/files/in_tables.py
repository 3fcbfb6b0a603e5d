"""This module converts the table of a run to CSV, NPZ, pandas and xarray."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

from hybridsim.presentation.tables import Table, event_columns, event_frame
from hybridsim.solution.files.tabulated import equal_steps
from hybridsim.solution.integrals.energies import Energies

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class InTables(Energies):
    """The results of a run in several formats, as a part of `Solution`."""

    def table(self, points: int | None = None) -> Table:
        """Return times, states, quantities and modes as columns of a table.

        Parameters
        ----------
        points : the number of equally spaced times, both ends included. Without it the times are ``sol.t``: the
            integrator's own steps with both sides of each event, or the grid of `simulate`.
        """
        if points is None and self._grid is None:
            return self._trajectory.table(None)
        times = self.t if points is None else equal_steps(self.t_start, self.t_end, points)
        if len(times):
            self._within(times, "+")
        return self._trajectory.table(times)

    def to_csv(self, path: str | PathLike[str], points: int | None = None) -> None:
        """Write the table as a CSV file."""
        self.table(points).to_csv(path)

    def to_npz(self, path: str | PathLike[str], points: int | None = None) -> None:
        """Write the table and the events to a file for `numpy.load`."""
        self.table(points).to_npz(path, event_columns(self.events, self.names))

    def to_pandas(self, points: int | None = None) -> pd.DataFrame:
        """Return the table as a data frame over t; modes are categorical, and ``attrs`` holds the units."""
        return self.table(points).to_pandas()

    def to_xarray(self, points: int | None = None) -> xr.Dataset:
        """Return the table as a data set over t; modes are coordinates, and ``attrs`` holds the units."""
        return self.table(points).to_xarray()

    def events_to_pandas(self) -> pd.DataFrame:
        """Return the events as a data frame with one row per event: t, kind, component, ..., states."""
        return event_frame(self.events, self.names)
