"""This module finds monitors that are zero at a point of a run and would act after a small change of the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybridsim.analysis.variations.changes import Changes, Place
from hybridsim.analysis.variations.off_zero import OffZero, rates_of
from hybridsim.engine.record.segments import Segment


def monitors_reached(
    changes: Changes, at: Place, segment: Segment, numbers: Sequence[int]
) -> tuple[list[OffZero], list[int]]:
    """Return the monitors at zero that would act after a small change, and the numbers of monitors that stay zero.

    at : the start of the segment; one step later the monitor shows its side if its rate is zero. numbers : of the
    monitors to judge.
    """
    monitors, system = changes.system.model.monitors, changes.system
    numbers = tuple(k for k in numbers if monitors[k].action != "record")
    if not numbers:
        return [], []
    later, off, staying = replace(at, s=float(segment.s[:2][-1]), x=segment.x[:2][-1]), [], []
    rates, t = rates_of(system, at.s, at.x, at.p, at.z), at.origin + at.s
    for k, one, then in zip(
        numbers, changes.of(at, (), numbers), changes.of(later, (), numbers), strict=True
    ):
        if not one.is_zero:
            continue
        rate = one.along(rates) or (0.0 if then.is_zero else then.value)
        fires = rate != 0.0 and monitors[k].direction in ("both", "up" if rate > 0.0 else "down")
        if one.moves.any() and fires:
            lost = one.moves & (one.by * rate < 0.0)
            off.append(OffZero(t, f"monitor {monitors[k].name}", one.moves, lost, np.zeros(at.Y.shape)))
        staying += [k] if rate == 0.0 else []
    return off, staying
