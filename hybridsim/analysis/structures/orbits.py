"""This module represents coordinates and contacts of a mechanical run by polynomials on short intervals."""

from __future__ import annotations

import numpy as np

from hybridsim.analysis.polynomials.orbit import Orbit
from hybridsim.analysis.polynomials.resolving import orbit_from
from hybridsim.mechanics.series_loop.node_segments import NodeSegments
from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory
from hybridsim.solution.run_trajectory import relative_velocity


class _Coordinate:
    """Samples the position and the velocity of one coordinate in the segments of its node."""

    def __init__(self, names: tuple[str, str], series: np.ndarray) -> None:
        self.names, self._series = names, series

    def __call__(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        value, slope = np.zeros(len(s)), np.zeros(len(s))
        for coefficient in self._series[index].T[::-1]:
            slope = slope * s + value
            value = value * s + coefficient
        return np.stack([value, slope], axis=1)


class _Contacts:
    """Samples the forces and the relative velocities of all contacts between two times of the run."""

    def __init__(self, run: SeriesTrajectory, begins: np.ndarray) -> None:
        contacts = run.event_names
        self.names = (*contacts, *map(relative_velocity, contacts))
        self._run, self._begins = run, begins

    def __call__(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        return np.concatenate(self._run.forces_and_velocities(self._begins[index] + s), axis=1)


def orbit_of_coordinate(run: SeriesTrajectory, segments: NodeSegments, i: int) -> Orbit:
    """Return the position and the velocity of the i-th coordinate over a run."""
    arrays, x = run.run.built.arrays, int(np.flatnonzero(run.run.built.dofs == i)[0])
    j = arrays.dof_node[x]
    own = slice(segments.ptr[j], segments.ptr[j + 1])
    begins = segments.begins[own]
    lengths = np.diff(np.append(begins, run.t_end))
    series = segments.series[segments.row[own] + (x - arrays.node_dof[j])]
    sample = _Coordinate((run.model.names[i], run.model.velocities[i]), series)
    index = np.flatnonzero(lengths > 0.0)
    return orbit_from(
        sample, index, np.zeros(len(index)), lengths[index], lambda k, s: begins[k] - run.t_start + s
    )


def orbit_of_contacts(run: SeriesTrajectory) -> Orbit:
    """Return the forces and the relative velocities of all contacts over a run."""
    times = np.unique(run.own_times)
    begins, lengths = times[:-1], np.diff(times)
    sample, index = _Contacts(run, begins), np.arange(len(begins))
    return orbit_from(sample, index, np.zeros(len(index)), lengths, lambda k, s: begins[k] - run.t_start + s)
