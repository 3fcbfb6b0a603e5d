"""This module finds contacts of a mechanical run that slip by less than the tolerance."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from hybridsim.analysis.steady.on_guard import has_slight_slip
from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory

_FRACTIONS = np.array([0.25, 0.5, 0.75])  # of a slip, at which its velocity is read


def slight_slip(run: SeriesTrajectory, scale: np.ndarray, most: float) -> str:
    """Return a contact that has a slight slip over one period of a motion, or ""; see `has_slight_slip`.

    scale (2n,): size of each state, in the order of the arrays.
    """
    if not run.components:
        return ""
    arrays = run.run.built.arrays
    weights = csr_array(
        (np.abs(arrays.w_val), arrays.w_col, arrays.w_ptr), shape=(len(arrays.con_node), len(scale) // 2)
    )
    sizes = np.empty(len(run.components))
    sizes[run.run.built.contacts] = (weights * scale[len(scale) // 2 :]).max(axis=1).toarray()
    when, contacts, changes = run.changes
    phases = []
    for c in range(len(sizes)):
        own = contacts == c
        begins = np.append(run.t_start, when[own])
        lengths = np.diff(begins, append=run.t_end)
        sticks = np.append(run.first_mode(c), changes[own, 1]) == 0
        lasts = lengths > 0.0
        phases.append((begins[lasts], lengths[lasts], sticks[lasts]))
    times = [
        (begins[:, None] + lengths[:, None] * _FRACTIONS)[~sticks].ravel()
        for begins, lengths, sticks in phases
    ]
    _, velocities = run.forces_and_velocities(np.concatenate(times))
    ends = np.cumsum([len(part) for part in times])
    for c, (end, (_, _, sticks)) in enumerate(zip(ends, phases, strict=True)):
        largest = np.zeros(len(sticks))
        own = np.abs(velocities[end - len(times[c]) : end, c]).reshape(-1, len(_FRACTIONS))
        largest[~sticks] = own.max(axis=1) / sizes[c]
        if has_slight_slip(sticks, largest, most):
            return str(run.event_names[c])
    return ""
