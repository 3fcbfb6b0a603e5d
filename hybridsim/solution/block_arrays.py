"""This module converts the segments of a run to plain arrays for a file, and restores segments from arrays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.engine.linear.closed_form_block import ClosedFormBlock
from hybridsim.engine.linear.tables import LinearTables, no_tables
from hybridsim.engine.native.simd.products import row_blocks_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.array_forms import (
    Form,
    check_ascending,
    check_finite,
    check_forms,
    check_modes,
    check_range,
)
from hybridsim.engine.record.blocks import SegmentList
from hybridsim.engine.record.chebyshev import chebyshev_dense, chebyshev_series
from hybridsim.engine.record.fixed_blocks import StepSegments
from hybridsim.engine.record.hermite_block import TERMS, HermiteBlock
from hybridsim.engine.record.segments import PiecewiseDense, Segment, end_point
from hybridsim.engine.record.series_block import SeriesBlock
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

Arrays = dict[str, np.ndarray]

_SERIES = ("ends", "steps", "series", "origins", "modes", "vectors", "jumps")
_CLOSED = ("rows", "ends", "coordinates", "origins", "modes", "vectors", "jumps")
_CLASSES: dict[str, Any] = {"series": SeriesBlock, "hermite": HermiteBlock}
_ROW_FORMS: dict[str, Form] = {
    "origins": (float, ("N", 2)),
    "modes": (np.int64, ("N", "C")),
    "vectors": (float, ("N", "P")),
}
_SERIES_FORMS: dict[str, Form] = _ROW_FORMS | {
    "ends": (np.int64, ("N+1",)),
    "steps": (float, ("M", 2)),
    "series": (float, ("M", "n", "K")),
    "jumps": (float, ("N", 2, "n")),
}
_CLOSED_FORMS: dict[str, Form] = _ROW_FORMS | {
    "rows": (np.int64, ("N",)),
    "ends": (float, ("N",)),
    "coordinates": (complex, ("N", "J")),
    "jumps": (float, ("N", 3, "n")),
}
_TABLE_FORMS: dict[str, Form] = {
    "counts": (np.int64, ("K",)),
    "values": (complex, ("K", "J")),
    "upper": (complex, ("K", "J", "J")),
    "ends": (np.int64, ("K", "J")),
    "kinds": (np.int64, ("A",)),
    "rates": (float, ("A",)),
    "offsets": (float, ("A",)),
    "term_start": (np.int64, ("A+1",)),
    "sources": (np.int64, ("T",)),
    "weights": (float, ("T",)),
    "factors": (np.int64, ("M", "D")),
    "phases": (np.int64, (2,)),
    "near": (float, ("K",)),
}
_STEP_FORMS: dict[str, Form] = {
    "origin": (float, (2,)),
    "p": (float, ("P",)),
    "s": (float, ("M",)),
    "x": (float, ("M", "n")),
    "z": (np.int64, ("M", "C")),
    "cuts": (np.int64, ("cuts",)),
}
_SEGMENT_FORMS: dict[str, Form] = _ROW_FORMS | {
    "lengths": (np.int64, ("N",)),
    "knots": (float, ("L",)),
    "states": (float, ("L", "n")),
    "terms": (np.int64, ("T",)),
    "series": (float, ("S", "n")),
}


def taken_apart(blocks: Iterable[Any]) -> Iterator[tuple[str, Arrays]]:
    """Yield the kind and the arrays of each block of segments."""
    tables: list[Any] = []
    for block in blocks:
        if isinstance(block, ClosedFormBlock):
            known = [k for k, other in enumerate(tables) if other is block.tables]
            if not known:
                known = [len(tables)]
                tables.append(block.tables)
                yield "tables", {name: getattr(block.tables, name) for name in LinearTables._fields}
            number = {"tables": np.array(known[0])}
            yield "closed-form", {name: getattr(block, name) for name in _CLOSED} | number
        elif isinstance(block, SeriesBlock):
            first, last = block.ends[0], block.ends[-1]
            arrays = {name: getattr(block, name) for name in _SERIES}
            rows = {name: arrays[name][first:last] for name in ("steps", "series")}
            kind = "hermite" if isinstance(block, HermiteBlock) else "series"
            yield kind, arrays | rows | {"ends": arrays["ends"] - first}
        elif isinstance(block, StepSegments):
            yield "steps", block.arrays()
        else:
            yield "segments", _of_segments(block)


def put_together(system: System, stored: Iterable[tuple[str, Arrays]]) -> list[Any]:
    """Restore the blocks of segments from the arrays of a file.

    Raises
    ------
    ValueError
        For arrays that no run of the system can have written; compiled code never sees them.
    """
    sizes = {"n": system.n, "C": len(system.automata), "P": system.layout.size}
    tables: list[Any] = []
    blocks: list[Any] = []
    for kind, arrays in stored:
        title = f"block of kind '{kind}'"
        if kind == "tables":
            tables.append(_checked_tables(title, arrays, sizes))
        elif kind == "closed-form":
            check_forms(title, arrays, {"tables": (np.int64, ())}, {})
            check_range(f"{title}: its table", arrays["tables"], 0, len(tables) - 1)
            its = tables[int(arrays["tables"])]
            _check_closed(title, system, arrays, sizes, its)
            blocks.append(ClosedFormBlock(system, its, *(arrays[name] for name in _CLOSED)))
        elif kind in _CLASSES:
            _check_series(title, system, arrays, sizes, 2 * TERMS if kind == "hermite" else 0)
            blocks.append(_CLASSES[kind](system, *(arrays[name] for name in _SERIES)))
        elif kind == "steps":
            _check_steps(title, system, arrays, sizes)
            blocks.append(StepSegments.of_arrays(system, arrays))
        elif kind == "segments":
            _check_segments(title, system, arrays, sizes)
            blocks.append(SegmentList(system, _segments(arrays)))
        else:
            raise ValueError(f"unknown kind of block {kind!r}")
    return blocks


def _check_rows(title: str, system: System, arrays: Arrays) -> None:
    """Check the arrays that blocks of every kind have: times and modes of each segment."""
    if not len(arrays["modes"]):
        raise ValueError(f"{title} is empty")
    check_finite(f"{title}: a time", arrays["origins"])
    check_modes(title, arrays["modes"], [len(a.modes) for a in system.automata])


def _check_series(title: str, system: System, arrays: Arrays, sizes: dict[str, int], columns: int) -> None:
    """Check a block of Taylor series; `columns` is the number of coefficients per step, or 0 for any."""
    known = check_forms(title, arrays, _SERIES_FORMS, sizes)
    _check_rows(title, system, arrays)
    ends, steps = arrays["ends"], arrays["steps"]
    if ends[0] != 0 or ends[-1] != known["M"]:
        raise ValueError(f"{title}: the number of steps differs from the sum over the segments")
    check_ascending(f"{title}: the steps of its segments", ends, strictly=True)
    check_finite(f"{title}: a time", steps)
    if known["K"] < 1 or (columns and known["K"] != columns):
        raise ValueError(
            f"{title} has {known['K']} coefficients per step instead of {columns or 'at least 1'}"
        )


def _not_near_a_start(count: int, unknowns: int) -> Arrays:
    """Return arrays that files of earlier versions do not contain."""
    return {"flows": np.zeros((count, unknowns, unknowns)), "near": np.zeros(count)}


def _checked_tables(title: str, arrays: Arrays, sizes: dict[str, int]) -> LinearTables:
    """Return the tables of a closed-form motion after checking them; unneeded tables may be empty."""
    if "near" not in arrays and "counts" in arrays and "factors" in arrays:
        arrays = arrays | _not_near_a_start(len(arrays["counts"]), sizes["n"] + len(arrays["factors"]))
    known = check_forms(title, arrays, _TABLE_FORMS, sizes)
    count, widest, unknowns = known["K"], known["J"], sizes["n"] + known["M"]
    check_forms(title, arrays, {"flows": (float, (count, unknowns, unknowns))}, {})
    check_range(f"{title}: a place of its terms", arrays["term_start"], 0, known["T"])
    check_ascending(f"{title}: the places of its terms", arrays["term_start"])
    check_range(f"{title}: a source", arrays["sources"], 0, sizes["P"] - 1)
    check_range(f"{title}: a factor", arrays["factors"], 0, 2 * known["A"])
    row_blocks = row_blocks_of(np.zeros((1, sizes["n"], 2 * widest))).shape[1:]
    check_forms(title, arrays, {"states": (float, (count, *row_blocks))}, {})
    counts, ends = arrays["counts"], arrays["ends"]
    check_range(f"{title}: a number of coordinates", counts, 0, widest)
    used = np.arange(widest) < counts[:, None]
    if not ((ends > np.arange(widest)) & (ends <= counts[:, None]))[used].all():
        raise ValueError(f"{title}: a block of coordinates ends outside the array")
    present = {name: arrays[name] for name in (*_TABLE_FORMS, "states", "flows")}
    empty = {name: getattr(no_tables(), name) for name in LinearTables._fields}
    tables: LinearTables = packed(LinearTables(**(empty | present)))
    return tables


def _check_closed(title: str, system: System, arrays: Arrays, sizes: dict[str, int], tables: Any) -> None:
    check_forms(title, arrays, _CLOSED_FORMS, sizes | {"J": tables.values.shape[1]})
    _check_rows(title, system, arrays)
    check_range(f"{title}: a row of its table", arrays["rows"], 0, len(tables.counts) - 1)
    check_finite(f"{title}: a time", arrays["ends"])


def _check_steps(title: str, system: System, arrays: Arrays, sizes: dict[str, int]) -> None:
    check_forms(title, arrays, _STEP_FORMS, sizes)
    s, cuts = arrays["s"], arrays["cuts"]
    check_finite(f"{title}: a time", arrays["origin"], s)
    check_modes(title, arrays["z"], [len(a.modes) for a in system.automata])
    if len(s) < 2:
        raise ValueError(f"{title} is empty")
    check_ascending(f"{title}: its time", s)
    check_range(f"{title}: a change of modes", cuts, 1, len(s) - 2)
    check_ascending(f"{title}: its changes of modes", cuts, strictly=True)


def _check_segments(title: str, system: System, arrays: Arrays, sizes: dict[str, int]) -> None:
    known = check_forms(title, arrays, _SEGMENT_FORMS, sizes)
    _check_rows(title, system, arrays)
    lengths, terms, knots = arrays["lengths"], arrays["terms"], arrays["knots"]
    check_finite(f"{title}: a time", knots)
    check_range(f"{title}: a number of knots", lengths, 1, known["L"])
    check_range(f"{title}: a number of terms", terms, 1, known["S"])
    if (
        int(lengths.sum()) != known["L"]
        or int(terms.sum()) != known["S"]
        or len(terms) != known["L"] - known["N"]
    ):
        raise ValueError(f"{title}: the numbers of knots and terms do not match the segments")
    inside = np.ones(max(known["L"] - 1, 0), dtype=np.bool_)
    inside[np.cumsum(lengths)[:-1] - 1] = False
    signs = np.sign(np.diff(knots)[inside])
    if not ((signs == 1.0).all() or (signs == -1.0).all()):
        raise ValueError(f"{title}: the times of a segment are not monotonic")


def _of_segments(segments: list[Segment]) -> Arrays:
    """Return the step times, states and coefficients of all segments, and the steps per segment."""
    series = []
    for segment in segments:
        sizes = np.abs(segment.x).max(axis=0)
        for a, b in zip(segment.s[:-1].tolist(), segment.s[1:].tolist(), strict=True):
            series.append(chebyshev_series(segment.dense, a, b, sizes))
    n = segments[0].x.shape[1]
    return {
        "origins": np.array([segment.origin for segment in segments]),
        "modes": np.array([segment.z for segment in segments]),
        "vectors": np.array([segment.p for segment in segments]),
        "lengths": np.array([len(segment.s) for segment in segments]),
        "knots": np.concatenate([segment.s for segment in segments]),
        "states": np.concatenate([segment.x for segment in segments]),
        "terms": np.array([len(one) for one in series], dtype=np.int64),
        "series": np.concatenate([np.empty((0, n)), *series]),
    }


def _segments(arrays: Arrays) -> Iterator[Segment]:
    series = iter(np.split(arrays["series"], np.cumsum(arrays["terms"])))
    first = 0
    for row, length in enumerate(arrays["lengths"].tolist()):
        origin, z, p = Instant(*arrays["origins"][row].tolist()), arrays["modes"][row], arrays["vectors"][row]
        s, x = arrays["knots"][first : first + length], arrays["states"][first : first + length]
        first += length
        if length == 1:
            yield end_point(origin, z, p, x[0])
        else:
            interpolants = [chebyshev_dense(a, b, next(series)) for a, b in pairwise(s)]
            yield Segment(origin, z, p, s, x, PiecewiseDense(s, interpolants))
