"""This module defines objects that show the same text in notebooks as in `print`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any


class Readable:
    """An object whose `repr` is a text of several lines, which notebooks show with aligned columns."""

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def aligned(rows: Iterable[Sequence[str]], indent: str = "") -> list[str]:
    """Return the rows of a text table as lines, with columns of equal width."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        indent + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def in_numbers(values: Iterable[complex]) -> str:
    """Return real or complex numbers as text with six digits each."""
    return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"


def cost_text(stats: Mapping[str, Any]) -> str:
    """Return the cost of a run, without evaluations and rejected steps for a closed form."""
    rejected = f" ({stats['rejected']} rejected)" if stats["rejected"] else ""
    parts = [f"{stats['steps']} steps{rejected}"]
    if stats["rhs_evaluations"]:
        parts.append(f"{stats['rhs_evaluations']} right-hand sides")
    return ", ".join([*parts, f"{stats['wall_time']:.3g} s"])
