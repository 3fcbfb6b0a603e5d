"""This module writes a comparison as a table of text for a terminal, with notes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.compare.regularised import exponent_text, exponents
from hybridsim.analysis.compare.rows import QUANTITIES, Row
from hybridsim.analysis.compare.timing import ENOUGH
from hybridsim.errors import printable

if TYPE_CHECKING:
    from hybridsim.analysis.compare.comparison import Comparison
    from hybridsim.analysis.compare.errors_against_reference import Errors

_NAMES = dict(zip(QUANTITIES, ("state", "last period", "event time", "graph")))
_VERSIONS = ("numpy", "scipy", "numba", "scikit-sundae")


def table(comparison: Comparison) -> str:
    """Return the heading, a block of rows for each line of the comparison, and the notes."""
    names = {**_NAMES, "state": "state error"} | (
        {"event_time": "event time / T"} if comparison.period else {}
    )
    errors = (names[quantity] for quantity in comparison.quantities)
    header = ("", *errors, "wall time", "min .. max", "rhs", "guards", "steps", "modes")
    cells = [_cells(comparison, row) for row in comparison.rows]
    widths = [max(map(len, column)) for column in zip(header, *(line for line in cells if line))]
    text = [_aligned(header, widths)]
    for label, block in itertools.groupby(zip(comparison.rows, cells), key=lambda item: item[0].label):
        text.append(label)
        for failure, group in itertools.groupby(block, key=lambda item: "" if item[1] else _failure(item[0])):
            same = list(group)
            if failure:
                text.append(f"  {', '.join(setting(row) for row, _ in same)}: {failure}")
            else:
                text += [_aligned(line, widths) for _, line in same]
    return printable("\n".join([*_heading(comparison), "", *text, "", *_notes(comparison)]))


def setting(row: Row) -> str:
    """Return the varied setting in short form: "rtol 1e-06", or "T/1200" for the step."""
    name, value = row.setting
    if name == "steps_per_period":
        return f"T/{value:g}"
    short = f"{value:.0e}"
    return f"{name} {short if value < 1 and float(short) == value else f'{value:g}'}"


def milliseconds(seconds: float) -> str:
    """Return a wall time as text with three digits."""
    return f"{seconds * 1e3:.3g} ms" if seconds < 0.9995 else f"{seconds:.3g} s"


def versions(facts: Mapping[str, Any]) -> str:
    """Return the versions and the machine of a result as one line of text."""
    packages = ", ".join(f"{name} {facts[name]}" for name in _VERSIONS if facts.get(name))
    machine = f"{facts.get('system')} {facts.get('processor')}, {facts.get('cpus')} CPUs"
    return f"hybridsim {facts.get('hybridsim')}, {facts.get('python')}, {packages}; {machine}"


def _failure(row: Row) -> str:
    return f"{row.status}: {row.message}" if row.message else row.status


def _cells(comparison: Comparison, row: Row) -> tuple[str, ...]:
    """Return the cells of a row; empty for a failure."""
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


def _aligned(cells: tuple[str, ...], widths: list[int]) -> str:
    first, *numbers, last = cells
    inner = [cell.rjust(width) for cell, width in zip(numbers, widths[1:])]
    return "  ".join([first.ljust(widths[0]), *inner, last])


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
    """Return errors as text in the units of the table; by default the difference of the second reference."""
    readings = {name: comparison.scaled(errors or comparison.difference, name) for name in QUANTITIES}
    return ", ".join(f"{_NAMES[name]} {value:.1e}" for name, value in readings.items() if value) or "nothing"


def _graph_notes(comparison: Comparison) -> list[str]:
    if "graph" not in comparison.quantities:
        return []
    unit = "periods" if comparison.period else "run lengths"
    return [f"Graph: Hausdorff distance of the completed graphs, in {unit} and amplitudes, to 1 %."]


def _form_notes(comparison: Comparison) -> list[str]:
    fitted = exponents(comparison)
    if not fitted:
        return []
    lines = ["Against the set-valued law, as v0 falls (work in evaluations):"]
    for label, powers in fitted.items():
        error, work = map(exponent_text, powers)
        lines.append(f"  {label}: error ~ v0^{error}, work ~ v0^{work}")
    return lines


def turns(count: int) -> str:
    """Describe the number of repetitions behind a median time."""
    return "one turn" if count == 1 else f"median over {count} turns"


def _hash(facts: Mapping[str, Any]) -> str:
    text = facts.get("model_sha256")
    return f"SHA-256 {text[:12]}..." if text else "made of Python functions"


def _notes(comparison: Comparison) -> list[str]:
    unit = "periods T" if comparison.period else "the model's unit of time"
    facts = comparison.provenance
    counted = any(row.setting[0] == "steps_per_period" for row in comparison.rows)
    return [
        "State errors: the largest error of all states, relative to the state's amplitude in the reference.",
        f'Event times are in {unit}. "< u": below the uncertainty u of the reference.',
        *_graph_notes(comparison),
        *_form_notes(comparison),
        *(["T is a tenth of the run: the model has no period."] if counted and not comparison.period else []),
        f"Wall time of one run: {turns(comparison.repeat)} of all rows, of several calls if they are short,",
        f"after a warm-up; fewer turns of a run that takes more than {ENOUGH / comparison.repeat:.2g} s.",
        versions(facts),
        f"model {facts.get('model')}, {_hash(facts)}",
        *(f"warning: {warning}" for warning in comparison.warnings),
    ]
