"""This module defines the result of a comparison: one row per run, as text, CSV or JSON."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.compare.errors_against_reference import Errors
from hybridsim.analysis.compare.regularised import exponent_text, exponents
from hybridsim.analysis.compare.rows import QUANTITIES, Reading, Row
from hybridsim.analysis.compare.table import (
    aligned_cells,
    cheapest,
    failure_of,
    milliseconds,
    model_hash,
    setting,
    turns,
    versions,
)
from hybridsim.analysis.compare.timing import ENOUGH
from hybridsim.arguments import cannot_be, known_name
from hybridsim.errors import printable
from hybridsim.files import csv_records, json_record
from hybridsim.presentation.readable import Readable
from hybridsim.presentation.tables import library

if TYPE_CHECKING:
    import pandas as pd

_NAMES = dict(zip(QUANTITIES, ("state", "last period", "event time", "graph")))


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

    def plot(self) -> Any:
        """Draw error against cost, one panel for each kind of error; see `hybridsim.plot.work_precision`.

        It returns the axes; ``hybridsim.plot.save`` writes them to a file.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").work_precision(self)

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
        """Return the uncertainty of the reference in the units of `reading`, or 0 if the uncertainty is unknown."""
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
        """The names of the compared integrators and regularised laws, in order."""
        return tuple(dict.fromkeys(row.label for row in self.rows))

    def table(self) -> str:
        """Return the comparison as text."""
        names = {**_NAMES, "state": "state error"} | ({"event_time": "event time / T"} if self.period else {})
        errors = (names[quantity] for quantity in self.quantities)
        header = ("", *errors, "wall time", "min .. max", "rhs", "guards", "steps", "modes")
        cells = [_cells(self, row) for row in self.rows]
        widths = [max(map(len, column)) for column in zip(header, *(line for line in cells if line))]
        text = [aligned_cells(header, widths)]
        for label, block in itertools.groupby(zip(self.rows, cells), key=lambda item: item[0].label):
            text.append(label)
            for failure, group in itertools.groupby(
                block, key=lambda item: "" if item[1] else failure_of(item[0])
            ):
                same = list(group)
                if failure:
                    text.append(f"  {', '.join(setting(row) for row, _ in same)}: {failure}")
                else:
                    text += [aligned_cells(line, widths) for _, line in same]
        return printable("\n".join([*_heading(self), "", *text, "", *_notes(self)]))

    def to_csv(self, path: str | Path) -> None:
        """Write one line per row; times are in the model's unit, wall times in seconds."""
        csv_records(path, self.records())

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame with one row per run and the columns of `to_csv`."""
        return library("pandas").DataFrame(self.records())

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain Python values."""
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
        """Return the rows as plain Python values."""
        return [self._record(row) for row in self.rows]

    def to_json(self, path: str | Path | None = None) -> str:
        """Return all results as JSON text, with versions, machine and model hash. With a path, also write the text."""
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


def _cells(comparison: Comparison, row: Row) -> tuple[str, ...]:
    """Return the cells of a row; the cells of a failed run are empty."""
    if row.errors is None or row.cost is None:
        return ()
    readings = [comparison.reading(row, quantity) for quantity in comparison.quantities]
    low, high = min(row.cost.wall_times), max(row.cost.wall_times)
    counts = (row.cost.rhs_evaluations, row.cost.guard_evaluations, row.cost.steps)
    return (
        f"  {setting(row)}",
        *(str(reading) if reading else "-" for reading in readings),
        milliseconds(row.cost.wall_time),
        f"{milliseconds(low)} .. {milliseconds(high)}" if high > low else "once",
        *map(str, counts),
        "none" if row.errors.sequence is None else str(row.errors.sequence),
    )


def _heading(comparison: Comparison) -> list[str]:
    (t0, t1), period = comparison.t_span, comparison.period
    periods = f" ({(t1 - t0) / period:g} periods)" if period else ""
    lines = [
        comparison.title,
        f"  time       {t0:g} to {t1:g}{periods}",
        f"  reference  {comparison.reference}",
    ]
    if comparison.uncertainty is not None:
        lines.append(f"             uncertain by: {differences(comparison, comparison.uncertainty)}")
    if comparison.difference is not None:
        lines.append(f"             {comparison.second_reference} differs by: {differences(comparison)}")
    return lines


def differences(comparison: Comparison, errors: Errors | None = None) -> str:
    """Return errors as text in the table's units. The default errors are the difference of the two references."""
    readings = {name: comparison.scaled(errors or comparison.difference, name) for name in QUANTITIES}
    return ", ".join(f"{_NAMES[name]} {value:.1e}" for name, value in readings.items() if value) or "nothing"


def _graph_notes(comparison: Comparison) -> list[str]:
    if "graph" not in comparison.quantities:
        return []
    unit = "periods" if comparison.period else "run lengths"
    return [f"Graph: Hausdorff distance of the completed graphs, in {unit} and amplitudes, to 1 %."]


def _form_notes(comparison: Comparison) -> list[str]:
    fitted = exponents(comparison.rows)
    if not fitted:
        return []
    lines = ["Against the set-valued law, as v0 falls (work in evaluations):"]
    for label, powers in fitted.items():
        error, work = map(exponent_text, powers)
        lines.append(f"  {label}: error ~ v0^{error}, work ~ v0^{work}")
    return lines


def _notes(comparison: Comparison) -> list[str]:
    unit = "periods T" if comparison.period else "the model's unit of time"
    facts = comparison.provenance
    counted = any(row.setting[0] == "steps_per_period" for row in comparison.rows)
    result = cheapest(comparison.rows)
    return [
        f"{result[0].upper()}{result[1:]}.",
        "State errors: the largest error of all states, relative to the state's amplitude in the reference.",
        f'Event times are in {unit}. "< u": below the uncertainty u of the reference.',
        *_graph_notes(comparison),
        *_form_notes(comparison),
        *(["T is a tenth of the run: the model has no period."] if counted and not comparison.period else []),
        f"Wall time of one run: {turns(comparison.repeat)} of all rows, of several calls if they are short,",
        f"after a warm-up; fewer turns of a run that takes more than {ENOUGH / comparison.repeat:.2g} s.",
        versions(facts),
        f"model {facts.get('model')}, {model_hash(facts)}",
        *(f"warning: {warning}" for warning in comparison.warnings),
    ]
