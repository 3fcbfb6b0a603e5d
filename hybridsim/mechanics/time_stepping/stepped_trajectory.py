"""This module computes the results of a solution from a time-stepping run of a mechanical system."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.mechanics.arrays_trajectory import ArraysTrajectory
from hybridsim.mechanics.powers import SOURCES
from hybridsim.mechanics.time_stepping.arrays import directions
from hybridsim.mechanics.time_stepping.kernels import BOUNCES, STEPS, SWEEPS, UNSETTLED
from hybridsim.solution.event import Event
from hybridsim.solution.run_trajectory import relative_velocity

if TYPE_CHECKING:
    from hybridsim.mechanics.time_stepping.run import SteppedRun

_CONTACT, _IMPACT = {0: "stick", 1: "slip+", -1: "slip-"}, {0: "closed", 1: "open"}


class SteppedTrajectory(ArraysTrajectory):
    """The trajectory of a run of a `MechanicalSystem` by ``moreau``; velocities are linear within a step."""

    integrator = "moreau"
    has_instants = False

    def __init__(
        self, run: SteppedRun, grid: np.ndarray | None, save: str, cost: tuple[float, float]
    ) -> None:
        super().__init__(run.system, run.system.all_contacts, run, grid, save, cost)
        self._event = np.concatenate([*run.events, np.zeros((0, 4), dtype=np.int64)])

    # -- times and states -----------------------------------------------------------------------------------

    @property
    def t_end(self) -> float:
        """Return the last time that the run reached."""
        return float(self.run.time)

    @cached_property
    def own_times(self) -> np.ndarray:
        """Return the times (m,) at the ends of the steps."""
        return self._instants(np.arange(self.run.done + 1))

    def _instants(self, steps: np.ndarray) -> np.ndarray:
        return np.minimum(self.t_start + steps * self.run.step, self.t_end)

    @cached_property
    def _states(self) -> np.ndarray:
        self.require_states()
        return np.concatenate(self.run.states)

    @property
    def own_states(self) -> np.ndarray:
        """Return the states (2n, m) at the ends of the steps."""
        return self._states.T

    def states(self, times: np.ndarray, side: str) -> np.ndarray:
        """Return the states (k, 2n) at given times; the states are equal on both sides of an event."""
        n, first = self.model.n, self._step_of(times)
        after = np.minimum(first + 1, self.run.done)
        d = (times - self.own_times[first])[:, None]
        x, x_after = self._states[first], self._states[after]
        change = (x_after[:, n:] - x[:, n:]) / self.run.step
        return np.concatenate(
            [x[:, :n] + d * (x[:, n:] + self.run.theta * d * change), x[:, n:] + d * change], axis=1
        )

    def _step_of(self, times: np.ndarray, side: str = "+") -> np.ndarray:
        found = np.searchsorted(self.own_times, times, side="right" if side == "+" else "left") - 1
        return np.clip(found, 0, max(self.run.done - 1, 0))

    @property
    def quantities(self) -> tuple[str, ...]:
        """Return the names of forces, relative velocities and gaps."""
        speeds = (f"v_rel({contact.name})" for contact in self.model.contacts)
        return (*self.event_names, *speeds, *(f"gap({i.name})" for i in self.model.impacts))

    def values(self, name: str, times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (k,) of a state, a force (mean over a step), a relative velocity or a gap."""
        if name in self.names:
            return self.states(times, side)[:, self.names.index(name)]
        nc, parts = len(self.model.contacts), self.event_names
        if name in parts:
            k = parts.index(name)
            self.require_states()
            forces = np.concatenate([*self.run.forces, np.zeros((0, len(parts)))])
            mean: np.ndarray = forces[self._step_of(times, side), k]
            return mean if k >= nc else -mean
        k, n, x = self.quantities.index(name) - len(parts), self.model.n, self.states(times, side).T
        values: np.ndarray = (directions(self.model)[[k]] @ (x[n:] if k < nc else x[:n])).ravel()
        return values - self._base(k, times) if k < nc else values + self.run.arrays.gap[k - nc]

    def forces_and_velocities(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return friction forces and relative velocities (k, contacts) at times (k,), after events."""
        names = [contact.name for contact in self.model.contacts]
        forces, velocities = (
            [self.values(n, times, "+") for n in of] for of in (names, map(relative_velocity, names))
        )
        return np.transpose(forces), np.transpose(velocities)

    def _base(self, c: int, times: np.ndarray) -> np.ndarray:
        arrays = self.run.arrays
        constant, sine, cosine = arrays.base[c]
        angle = (
            arrays.rates[arrays.base_rate[c]] * times if arrays.base_rate[c] >= 0 else np.zeros(len(times))
        )
        return np.asarray(constant + sine * np.sin(angle) + cosine * np.cos(angle))

    # -- events ---------------------------------------------------------------------------------------------

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Return all changes of mode."""
        when, _, changes = self.changes
        nothing, found = np.full(len(self.names), np.nan), []
        for i, (step, k) in enumerate(self._event[:, :2].tolist()):
            source, target = (self.mode_names(k)[z] for z in changes[i].tolist())
            x = self._states[step] if self.save == "all" else nothing
            found.append(
                Event(float(when[i]), "transition", self.event_names[k], "", source, target, -1, x, x)
            )
        return tuple(found)

    @cached_property
    def changes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times, contacts or impacts, and modes of all changes."""
        return self._instants(self._event[:, 0]), self._event[:, 1], self._event[:, 2:]

    def event_states(self, component: str, kind: str | None, side: str) -> np.ndarray:
        """Return the states (m, 2n) at the events of one contact or impact."""
        chosen = (self.changes[1] == self.event_names.index(component)) & (kind in (None, "transition"))
        return np.array(self._states[self._event[chosen, 0]])

    def first_mode(self, component: int) -> int:
        """Return the mode of a contact or impact at the start."""
        return int(self.run.first_modes[component])

    def mode_names(self, component: int) -> dict[int, str]:
        """Return the names of the modes of a contact or an impact."""
        return _CONTACT if component < len(self.model.contacts) else _IMPACT

    # -- how the run ended ----------------------------------------------------------------------------------

    @property
    def x_end(self) -> np.ndarray:
        """Return the states (2n,) at the end of the run."""
        return np.concatenate([self.run.state.q, self.run.state.v])

    @property
    def work(self) -> dict[str, float]:
        """Return the energy that the system receives from each source."""
        return dict(zip(SOURCES, self.run.state.work.tolist(), strict=True))

    @property
    def status(self) -> str:
        """Return how the run ended."""
        return str(self.run.status)

    @property
    def message(self) -> str:
        """Return one sentence about how the run ended."""
        if self.status == "finished":
            return f"reached t = {self.t_end!r} with moreau, step {self.run.step:g}"
        if self.run.limit_message:
            return f"stopped at t = {self.t_end!r}: {self.run.limit_message}"
        if self.run.overlaps:
            names = ", ".join(self.run.overlaps[:8])
            return f"stopped at t = {self.t_end!r}: the gap of {names} is below zero"
        return f"stopped at t = {self.t_end!r}: the state is not a number after the next step"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return the warnings of the run: steps whose impulses did not converge."""
        failed = int(self.run.state.counts[UNSETTLED])
        _, _, tolerance, iterations = self.run.settings
        text = (
            f"{failed} steps did not converge to {tolerance:g} in {iterations} iterations: use a smaller step"
        )
        return (text,) if failed else ()

    @property
    def stats(self) -> dict[str, float]:
        """Return the cost: steps, sweeps over contacts, bounces, events, seconds and the largest residual."""
        counts = self.run.state.counts.tolist()
        return {
            "steps": counts[STEPS], "sweeps": counts[SWEEPS], "bounces": counts[BOUNCES], "events": len(self._event),
            "residual": float(self.run.state.residual[0]), "kernel_time": self.run.kernel_time,
            "wall_time": self.cost[0], "compile_time": self.cost[1],
        }  # fmt: skip

    def summary(self) -> list[str]:
        """Return the numbers of events and bounces, and the cost, as text."""
        stats = self.stats
        return [
            f"  events: {stats['events']}, bounces: {stats['bounces']}",
            f"  cost: {stats['steps']} steps, {stats['sweeps']} sweeps, {stats['wall_time']:.3g} s",
        ]
