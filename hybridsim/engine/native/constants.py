"""This module defines constants that several packages share, each with its unit and its reason."""

from __future__ import annotations

UNIT = 2.0**-53  # unit roundoff of a double, relative
EXACTLY = 3  # order of derivatives up to which events are decided
TIGHTEST = 1e-15  # tightest relative tolerance of series: their terms are rounded at a tenth of it
MAX_SEGMENTS = (
    1024  # segments of one call of a compiled loop: enough that the call itself costs nothing beside them
)

# This many consecutive steps, each shorter than this share of local time, make no progress: near a singularity steps
# become too short to change the state, or go back and forth within the tolerance.
STANDSTILL, IN_A_ROW = 2e-11, 10000
BOUND_TERMS = 16  # terms of the series that bounds a guard of a linear mode from below; a power of two
