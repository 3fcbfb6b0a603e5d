"""This module stores segments whose steps have Taylor series at both ends."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hybridsim.engine.record.hermite import fit_all, right_system, shift_matrix
from hybridsim.engine.record.series_block import SeriesBlock

TERMS = 4  # coefficients of the flow at each end of a step: the dense output has degree 7


class HermiteBlock(SeriesBlock):
    """Segments whose steps have Taylor series at both ends, stored as (steps, n, 2 K)."""

    @cached_property
    def polynomials(self) -> np.ndarray:
        """Return the Hermite polynomials of all steps, computed on demand."""
        out = np.empty_like(self.series)
        fit_all(self.steps, self.series, shift_matrix(TERMS), right_system(TERMS), out)
        return out
