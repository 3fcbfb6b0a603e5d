"""The segments of a run as plain arrays, to be kept in a file, and the way back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.blocks import SegmentList
from hybridsim.engine.chebyshev_pieces import ChebyshevPieces, chebyshev_series
from hybridsim.engine.closed_form_block import ClosedFormBlock
from hybridsim.engine.fixed_blocks import StepSegments
from hybridsim.engine.linear_tables import LinearTables
from hybridsim.engine.packs import packed
from hybridsim.engine.pieces import Segment, end_point
from hybridsim.engine.rk_leaper import HermiteBlock
from hybridsim.engine.series_block import SeriesBlock
from hybridsim.engine.timepair import Instant

if TYPE_CHECKING:
    from hybridsim.engine.system import System

Arrays = dict[str, np.ndarray]

_SERIES = ("ends", "steps", "series", "origins", "modes", "vectors", "jumps")
_CLOSED = ("rows", "ends", "coordinates", "origins", "modes", "vectors", "jumps")
_CLASSES: dict[str, Any] = {"series": SeriesBlock, "hermite": HermiteBlock}


def taken_apart(blocks: Iterable[Any]) -> Iterator[tuple[str, Arrays]]:
    """Kind and arrays of each block; segments in closed form share their tables, which come first."""
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
    """The blocks again."""
    tables: list[Any] = []
    blocks: list[Any] = []
    for kind, arrays in stored:
        if kind == "tables":
            tables.append(
                packed(LinearTables(*(np.ascontiguousarray(arrays[n]) for n in LinearTables._fields)))
            )
        elif kind == "closed-form":
            rows = (arrays[name] for name in _CLOSED)
            blocks.append(ClosedFormBlock(system, tables[int(arrays["tables"])], *rows))
        elif kind in _CLASSES:
            blocks.append(_CLASSES[kind](system, *(arrays[name] for name in _SERIES)))
        elif kind == "steps":
            blocks.append(StepSegments.of_arrays(system, arrays))
        elif kind == "segments":
            blocks.append(SegmentList(system, _segments(arrays)))
        else:
            raise ValueError(f"a block of kind {kind!r}")
    return blocks


def _of_segments(segments: list[Segment]) -> Arrays:
    """Knots and states of all steps in a row, lengths (N,) of the segments in knots, a series for each step."""
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
            yield Segment(
                origin, z, p, s, x, ChebyshevPieces(s, tuple(next(series) for _ in range(length - 1)))
            )
