"""This module defines the result of a comparison: one row per run, as text, CSV or JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hybridsim.analysis.compare.errors_against_reference import Errors
from hybridsim.analysis.compare.rows import QUANTITIES, Reading, Row
from hybridsim.analysis.compare.table import table
from hybridsim.arguments import cannot_be, known_name
from hybridsim.files import csv_records, json_record
from hybridsim.presentation.readable import Readable


@dataclass(frozen=True)
class Comparison(Readable):
    """The errors and costs of integrators on one model, each at several settings.

    Parameters
    ----------
    title : str
        The title of the model.
    t_span, period : tuple of float, float or None
        The span of the runs; the period of the forcing or None.
    reference : str
        A description of the reference.
    uncertainty : Errors or None
        The distance of the reference from a second one of another kind; None without one.
    rows : tuple of Row
        One row per run, in the order of the request.
    repeat : int
        Timed repetitions.
    provenance : mapping of str to object, optional
        Versions, machine, hash of the model.
    warnings : tuple of str, optional
        Warnings that affect the reliability of the numbers.
    second_reference : str, optional
        A reference of another kind that the first was compared with; "" without one.
    difference : Errors, optional
        Its distance from the first reference.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.compare("dfcs", t_span=(0, 0.03), integrators=["exact"], rtols=[1e-9], repeat=1)
    >>> found.labels
    ('exact',)
    """

    title: str
    t_span: tuple[float, float]
    period: float | None
    reference: str
    uncertainty: Errors | None
    rows: tuple[Row, ...]
    repeat: int
    provenance: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    second_reference: str = ""
    difference: Errors | None = None

    def __repr__(self) -> str:
        return self.table()

    def reading(self, row: Row, quantity: str) -> Reading | None:
        """Return one kind of error of a row (see `QUANTITIES`), or None if this error was not measured.

        Event times are in periods if the model has a period, else in the model's unit of time.
        """
        if not isinstance(row, Row):
            raise cannot_be("row", row, "use a row from `comparison.rows`")
        value, floor = self.scaled(row.errors, quantity), self.floor(quantity)
        if value is None:
            return None
        return Reading(max(value, floor), value <= floor and floor > 0)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The kinds of error that at least one row contains; the error of the states is always included."""
        return tuple(
            name
            for name in QUANTITIES
            if name == "state" or any(getattr(row.errors, name, None) is not None for row in self.rows)
        )

    def floor(self, quantity: str) -> float:
        """Return the uncertainty of the reference in the units of `reading`; 0 if it is unknown."""
        return self.scaled(self.uncertainty, quantity) or 0.0

    def scaled(self, errors: Errors | None, quantity: str) -> float | None:
        """Return an error in the units of `reading`."""
        known_name(quantity, QUANTITIES, "a comparison has no quantity", "quantities")
        if errors is not None and not isinstance(errors, Errors):
            raise cannot_be("errors", errors, "use the errors of a row: `row.errors`")
        value: float | None = getattr(errors, quantity, None)
        return (
            value / self.period if value is not None and quantity == "event_time" and self.period else value
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the compared lines, in order; a line is an integrator or a regularised law."""
        return tuple(dict.fromkeys(row.label for row in self.rows))

    def table(self) -> str:
        """Return the comparison as text."""
        return table(self)

    def __str__(self) -> str:
        return self.table()

    def to_csv(self, path: str | Path) -> None:
        """Write one line per row; times are in the model's unit, wall times in seconds."""
        csv_records(path, self.records())

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain values."""
        return {
            "title": self.title,
            "t_span": list(self.t_span),
            "period": self.period,
            "reference": self.reference,
            "uncertainty": asdict(self.uncertainty) if self.uncertainty else None,
            "second_reference": self.second_reference,
            "difference": asdict(self.difference) if self.difference else None,
            "repeat": self.repeat,
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
            "rows": self.records(),
        }

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as plain values."""
        return [self._record(row) for row in self.rows]

    def to_json(self, path: str | Path | None = None) -> str:
        """Return all results as JSON text, with versions, machine and model hash; write it if a path is given."""
        return json_record(self.to_dict(), path)

    def _record(self, row: Row) -> dict[str, Any]:
        errors, cost = row.errors, row.cost
        record: dict[str, Any] = {
            "integrator": row.integrator,
            "label": row.label,
            "regularized": row.form,
            "setting": row.setting[0],
            "value": row.setting[1],
            "options": dict(row.options),
            "status": row.status,
            "message": row.message,
        }
        for quantity in QUANTITIES:
            reading = self.reading(row, quantity)
            record[f"{quantity}_error"] = getattr(errors, quantity, None)
            record[f"{quantity}_below_uncertainty"] = reading.is_bound if reading else None
        for fault in ("missed", "spurious", "wrong"):
            record[f"{fault}_modes"] = getattr(errors.sequence, fault, None) if errors else None
        record["wall_time"] = cost.wall_time if cost else None
        record["wall_time_min"] = min(cost.wall_times) if cost else None
        record["wall_time_max"] = max(cost.wall_times) if cost else None
        for count in ("repetitions", "compile_time", "rhs_evaluations", "guard_evaluations", "steps"):
            record[count] = getattr(cost, count, None)
        return record
