"""This module follows a forced mechanical system from period to period of its forcing."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.analysis.structures.scales import FLOOR, masses_of, natural_sizes, with_floor
from hybridsim.analysis.structures.slight_slips import slight_slip
from hybridsim.engine.system.period import common_multiple
from hybridsim.errors import SimulationError, UsageError
from hybridsim.mechanics.codes import DONE
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.series_loop.mechanical_arrays import build, rates_of
from hybridsim.mechanics.series_loop.node_segments import NodeSegments
from hybridsim.mechanics.series_loop.run import MechanicalRun
from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory

_SAMPLES = 64  # per period, for the sizes of the states
_RESTS = 1e-12  # a smaller range relative to the largest size of its kind is rest
_ABSOLUTE = 1e-3  # absolute tolerance of a state, in units of the relative tolerance times its size


def forcing_period_of(system: MechanicalSystem) -> float:
    """Return the common period of all forces and bases of a system.

    Raises
    ------
    UsageError
        Without a harmonic force or base, or if their periods have no common multiple.
    """
    rates = [abs(rate) for rate in rates_of(system) if rate != 0.0]
    if not rates:
        raise UsageError(
            f"{system.name} has no harmonic force or base motion, so the period of its motion is unknown",
            remedy="use hs.steady_state(system.to_model()), or add an hs.Harmonic to the forcing",
        )
    period = common_multiple([2.0 * math.pi / rate for rate in rates])
    if period is None:
        raise UsageError(
            f"{system.name} is forced with angular frequencies that have no common period: "
            + ", ".join(f"{rate:.9g}" for rate in rates),
            remedy="use frequencies with ratios of small whole numbers, or simulate the system",
        )
    return period


class PeriodMap:
    """The map of the states (2n,) over one period of the forcing, which begins and ends at phase zero.

    States are in the order of the arrays of `MechanicalRun`: positions, then velocities. The modes of the
    contacts are carried from period to period. natural, masses: see `natural_sizes` and `masses_of`.
    """

    def __init__(self, system: MechanicalSystem, period: float, x: np.ndarray, rtol: float) -> None:
        self.system, self.period, self.periods = system, period, 0
        built = build(system)
        self.masses = masses_of(system, built)
        self.natural = natural_sizes(system, built, period)
        self._run = MechanicalRun(built, (0.0, period), x, rtol, np.zeros(len(x)), math.inf, False)
        self._set_tolerances(np.abs(self.x))
        self._run.begin()
        self._require_done()

    @property
    def x(self) -> np.ndarray:
        """The present states (2n,)."""
        return self._run.state.x.reshape(-1).copy()

    @property
    def modes(self) -> np.ndarray:
        """The present modes (m,) of the contacts: 0 for stick, otherwise the direction of slip."""
        return self._run.state.mode.copy()

    @property
    def state_names(self) -> list[str]:
        """The names of the states, in the order that the map uses."""
        system, order = self.system, self._run.built.dofs.tolist()
        return [names[i] for names in (system.names, system.velocities) for i in order]

    @property
    def changes(self) -> bytes:
        """The mode changes of each contact over the last period and its final modes, as bytes for comparison."""
        events = np.concatenate([*self._run.events, np.zeros((0, 4), dtype=np.int64)])[:, :3]
        return events[np.argsort(events[:, 0], kind="stable")].tobytes() + self.modes.tobytes()

    @property
    def slips(self) -> dict[tuple[int, int], int]:
        """How often each contact began to slip in each direction over the last period."""
        events = np.concatenate([*self._run.events, np.zeros((0, 4), dtype=np.int64)])
        begun = events[events[:, 2] != 0][:, [0, 2]]
        found, counts = np.unique(begun, axis=0, return_counts=True)
        return dict(zip(map(tuple, found.tolist()), counts.tolist(), strict=True))

    def snapshot(self) -> tuple[np.ndarray, ...]:
        """Return a copy of the states and modes, for `restore`."""
        return tuple(part.copy() for part in self._run.state)

    def restore(self, snapshot: tuple[np.ndarray, ...]) -> None:
        """Return to earlier states and modes, also after a run that ended early."""
        for part, former in zip(self._run.state, snapshot, strict=True):
            part[...] = former
        self._run.code = DONE

    def put(self, x: np.ndarray) -> None:
        """Set the states (2n,) without changing the modes; the next period corrects the velocities."""
        self._run.state.x[:] = x.reshape(2, -1)
        self._run.state.stamp[:] = -1.0  # no event has just made anything zero

    def advance(self) -> np.ndarray:
        """Follow the motion for one period, and return the states at its end."""
        self._carry_out((0.0, self.period))
        return self.x

    def measure(self) -> tuple[np.ndarray, bool]:
        """Follow the motion for one period, and return the scale (2n,) of each state and whether nothing moves.

        The scale is half the range over the period. It has floors: a fraction of the largest size of the state, and
        the fraction of `with_floor`. The absolute tolerances of later periods follow these sizes.
        """
        self._run.is_recorded = True
        self._carry_out((0.0, self.period))
        self._run.is_recorded = False
        segments = NodeSegments(self._run.built.arrays, self._run.segments)
        states = segments.states(np.linspace(0.0, self.period, _SAMPLES + 1), True)
        largest = np.abs(states).max(axis=0)
        self._set_tolerances(largest)
        half, largest = 0.5 * np.ptp(states, axis=0), np.maximum(largest, self.natural)
        rests = half <= _RESTS * with_floor(largest, self.masses, 1.0)
        return with_floor(np.maximum(half, FLOOR * largest), self.masses), bool(rests.all())

    def slight_slip(self, periods: int, scale: np.ndarray, most: float) -> str:
        """Return a contact that slips slightly over the next periods, or ""; see `has_slight_slip`."""
        run = self.recorded(periods, 0.0)
        self._run.is_recorded = False
        return slight_slip(run, scale, most)

    def recorded(self, periods: int, offset: float) -> SeriesTrajectory:
        """Record the motion over some periods from the time `offset` on; the map cannot be used afterwards."""
        if offset > 0.0:
            self._carry_out((0.0, offset))
        self._run.is_recorded = True
        self._carry_out((offset, offset + periods * self.period))
        return SeriesTrajectory(self.system, self._run, None, "all", (0.0, 0.0))

    def _set_tolerances(self, largest: np.ndarray) -> None:
        """Set the absolute tolerances in proportion to the largest sizes (2n,) of the states."""
        sizes = np.maximum(largest, FLOOR * self.natural)
        sizes[sizes == 0.0] = 1.0
        self._run.state.tolerance[:] = (_ABSOLUTE * self._run.rtol * sizes).reshape(2, -1)

    def _carry_out(self, span: tuple[float, float]) -> None:
        self._run.restart(span)
        self._run.advance()
        self._require_done()
        self.periods += 1

    def _require_done(self) -> None:
        if self._run.code != DONE:
            ended = SeriesTrajectory(self.system, self._run, None, "events", (0.0, 0.0))
            raise SimulationError(
                f"the run towards the steady state ended early ({ended.status}): {ended.message}"
            )
