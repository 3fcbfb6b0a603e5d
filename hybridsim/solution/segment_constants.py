"""This module reads what is constant in a segment of a run without computing its motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.record.blocks import SegmentBlock, SegmentList


class SegmentConstants(NamedTuple):
    """What is constant in a segment: its modes (C,) and its run-time vector."""

    z: np.ndarray
    p: np.ndarray


def constants_of(block: SegmentBlock | SegmentList, i: int) -> SegmentConstants:
    """Return what is constant in a segment of a block; its motion is not computed."""
    if isinstance(block, SegmentList):
        return SegmentConstants(block[i].z, block[i].p)
    return SegmentConstants(block.modes[i], block.vectors[i])
