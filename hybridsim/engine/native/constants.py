"""Constants that several packages share, each with its unit and its reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

EXACTLY = 3  # order of derivatives up to which events are decided


# This many consecutive steps, each shorter than this share of local time, make no progress: near a singularity steps
# become too short to change the state, or go back and forth within the tolerance.
STANDSTILL, IN_A_ROW = 2e-11, 10000
BOUND_TERMS = 16  # terms of the series that bounds a guard of a linear mode from below; a power of two
