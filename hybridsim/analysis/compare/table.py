"""This module writes the parts of a comparison as text: settings, times, versions and rows of a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hybridsim.analysis.compare.rows import Row

TARGET = 1e-6  # the state error at which the cheapest run is named
_VERSIONS = ("numpy", "scipy", "numba", "scikit-sundae")


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


def fastest(rows: Iterable[Row]) -> Row | None:
    """Return the fastest run with the right modes and a state error of at most `TARGET`."""
    found = [
        (row.cost.wall_time, k, row)
        for k, row in enumerate(rows)
        if row.errors and row.cost and not row.errors.wrong_modes and row.errors.state <= TARGET
    ]
    return min(found)[2] if found else None


def cheapest(rows: Iterable[Row]) -> str:
    """Return a text that names the fastest run with the right modes and a state error of at most `TARGET`."""
    row = fastest(rows)
    if row is None or row.cost is None:
        return f"no run reaches {TARGET:.0e} with the right modes"
    return f"cheapest at {TARGET:.0e}: {row.label} ({setting(row)}), {milliseconds(row.cost.wall_time)}"


def failure_of(row: Row) -> str:
    """Return the reason why a run has no result."""
    return f"{row.status}: {row.message}" if row.message else row.status


def aligned_cells(cells: tuple[str, ...], widths: list[int]) -> str:
    """Return the cells of one row of the table as text, with numbers aligned to the right."""
    first, *numbers, last = cells
    inner = [cell.rjust(width) for cell, width in zip(numbers, widths[1:])]
    return "  ".join([first.ljust(widths[0]), *inner, last])


def turns(count: int) -> str:
    """Return a text that says how often a run was repeated for its median time."""
    return "one turn" if count == 1 else f"median over {count} turns"


def model_hash(facts: Mapping[str, Any]) -> str:
    """Return the hash of a model file as text."""
    text = facts.get("model_sha256")
    return f"SHA-256 {text[:12]}..." if text else "made of Python functions"
