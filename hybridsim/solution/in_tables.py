"""The forms in which the table of a run is given: CSV, NPZ, pandas, xarray."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

from hybridsim.tables import Table, event_columns, event_frame

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from hybridsim.solution.event import Event


class InTables(ABC):
    """What a result with names, events and a table can be written as."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the states, in the order of the rows of y."""

    @property
    @abstractmethod
    def events(self) -> Sequence[Event]:
        """All events in order of time."""

    @abstractmethod
    def table(self, points: int | None = None) -> Table:
        """Times, states, outputs and modes in columns: what all the forms below are made of.

        Parameters
        ----------
        points : how many equal steps of time to take, both ends included; without it ``sol.t``: the integrator's own
            steps with each event time twice, on both its sides, or the grid of `simulate`.
        """

    def to_csv(self, path: str | PathLike[str], points: int | None = None) -> None:
        """Write the `table` as CSV."""
        self.table(points).to_csv(path)

    def to_npz(self, path: str | PathLike[str], points: int | None = None) -> None:
        """Write the `table` and the events for `numpy.load`: ``["x"]``, ``["mode(f)"]``, ``["events/t"]``, ..."""
        self.table(points).to_npz(path, event_columns(self.events, self.names))

    def to_pandas(self, points: int | None = None) -> pd.DataFrame:
        """The `table` as a data frame over t; modes are categorical, units stand in its ``attrs``."""
        return self.table(points).to_pandas()

    def to_xarray(self, points: int | None = None) -> xr.Dataset:
        """The `table` as a data set over t; modes are coordinates, each variable has its unit in its ``attrs``."""
        return self.table(points).to_xarray()

    def events_to_pandas(self) -> pd.DataFrame:
        """The events as a data frame, one row each: t, kind, component, ..., the states before and after."""
        return event_frame(self.events, self.names)
