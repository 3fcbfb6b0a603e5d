"""This module defines the result of `compare_laws`: one row per law, as a table and as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from hybridsim.analysis.compare.table import milliseconds
from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.sweep.last_period import MeasuredPeriod
from hybridsim.analysis.sweep.named_measures import units_of_readings
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.solution import Solution

_SETTLED = 1e-3  # the residual above which a motion has visibly not settled


@dataclass(frozen=True)
class LawRow(Measures):
    """The run of a model under one law. A measure is None if the run failed or lacks this measure."""

    label: str
    model: Model
    solution: Solution
    contact: str
    quantity: str
    is_period: bool  # whether the solution is one period of the forcing
    measured: Mapping[str, Any] = field(default_factory=dict)  # the readings of `measure`, by name

    @property
    def amplitude_of_quantity(self) -> float | None:
        """(max - min)/2 of the quantity of the comparison."""
        return self.amplitude[self.quantity] if self._has(self.quantity) else None

    @property
    def stops(self) -> int | None:
        """Number of intervals of stick; None for a law without stick.

        In a period, an interval across the end counts once, and permanent stick is not counted.
        """
        if not (self.solution.success and self.contact in self._contacts):
            return None
        if self.is_period:
            return int(self.stops_per_period[self.contact])
        hold = self.held_mode(self.contact)
        return sum(each.mode == hold and each.t1 > each.t0 for each in self.solution.modes[self.contact])

    @property
    def energy_loss(self) -> float | None:
        """Work of the friction force, the integral of the force times the relative velocity."""
        found = self.solution.success and self.contact in self.dissipated
        return self.dissipated[self.contact] if found else None

    @property
    def residual(self) -> float | None:
        """Largest change of a state over the measured period, relative to half of its range; None without a period."""
        if not (self.solution.success and self.is_period):
            return None
        return MeasuredPeriod(self.solution, self.solution.t_end - self.solution.t_start).residual

    def _has(self, quantity: str) -> bool:
        return self.solution.success and quantity in self.amplitude


@dataclass(frozen=True)
class LawComparison(Readable):
    """The motion of one model under several friction laws in one contact.

    Parameters
    ----------
    title : str
        The title of the model.
    contact, quantity : str
        The contact that has the laws, and the quantity whose amplitude is measured.
    t_span : tuple of float
        The measured interval: the last period of the forcing, or the whole run.
    rows : tuple of LawRow
        One row per law with its ``label``, ``model``, ``solution`` and measures. ``measured`` contains the readings
        by name. A reading is None if the run failed, or if the law lacks it. ``residual`` tells how closely the
        measured period repeats.
    readings : tuple of str, optional
        Names of the readings that replace amplitude, stops and energy loss.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.compare_laws("dfcs", ["coulomb", ("coulomb", {"mu": 0.25})])
    >>> found.labels
    ('coulomb', 'coulomb (mu=0.25)')
    """

    title: str
    contact: str
    quantity: str
    t_span: tuple[float, float]
    rows: tuple[LawRow, ...]
    readings: tuple[str, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the laws; no two names are equal."""
        return tuple(row.label for row in self.rows)

    @property
    def units(self) -> dict[str, str]:
        """The declared units of the readings, by name."""
        return units_of_readings(self.readings, self.rows[0].model)

    def __repr__(self) -> str:
        t0, t1 = self.t_span
        head = (
            "law",
            *(self.readings or (f"amplitude of {self.quantity}", "stops", "energy loss")),
            "wall time",
        )
        lines = [f"{self.title}: laws of contact {self.contact}, t = {t0:g} to {t1:g}"]
        lines += aligned([head, *(_cells(row) for row in self.rows)], "  ")
        failed = [row for row in self.rows if not row.solution.success]
        moving = [row for row in self.rows if row.residual is not None and row.residual > _SETTLED]
        return "\n".join(
            [
                *lines,
                *(f"{row.label}: {row.solution.message}" for row in failed),
                *(f"{row.label}: has not settled, {_change(row)}; use a longer t_span" for row in moving),
            ]
        )

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as plain Python values."""
        return [
            {
                "label": row.label,
                "status": row.solution.status,
                "message": row.solution.message,
                "amplitude": row.amplitude_of_quantity,
                "stops": row.stops,
                "energy_loss": row.energy_loss,
                **row.measured,
                "wall_time": row.solution.stats["wall_time"],
            }
            for row in self.rows
        ]

    def plot(self, x: str | None = None) -> Any:
        """Draw the friction loops of all laws, beside a bar chart of the amplitudes or of the first measure.

        Returns the axes; ``hybridsim.plot.save`` writes them to a file.

        Parameters
        ----------
        x : str, optional
            Quantity along the axis of the loops, such as "v" or the relative velocity "v_rel(f)"; by default the
            quantity of the comparison.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").law_comparison(self, x)


def _change(row: LawRow) -> str:
    return f"a state changes by {100.0 * (row.residual or 0.0):.2g} % of its amplitude in the measured period"


def _cells(row: LawRow) -> tuple[str, ...]:
    values = (
        row.measured.values() if row.measured else (row.amplitude_of_quantity, row.stops, row.energy_loss)
    )
    run = row.solution
    return (
        row.label,
        *map(_cell, values),
        milliseconds(run.stats["wall_time"]) if run.success else run.status,
    )


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, str | int) else f"{value:.6g}"
