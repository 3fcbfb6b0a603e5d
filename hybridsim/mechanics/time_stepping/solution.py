"""This module defines the result of a time-stepping run of a mechanical system."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.arguments import as_times, known_name
from hybridsim.mechanics.result import ArraysResult
from hybridsim.mechanics.time_stepping.arrays import directions
from hybridsim.mechanics.time_stepping.kernels import BOUNCES, STEPS, SWEEPS, UNSETTLED
from hybridsim.solution import Event, ModeInterval

if TYPE_CHECKING:
    from hybridsim.mechanics.time_stepping.run import SteppedRun

_CONTACT, _IMPACT = {0: "stick", 1: "slip+", -1: "slip-"}, {0: "closed", 1: "open"}
_WORKS = ("forcing", "damping", "friction", "bases", "impacts")


class SteppedSolution(ArraysResult):
    """The result of simulating a `MechanicalSystem` by ``moreau``; ``sol(t)`` has linear velocities within a step.

    Attributes
    ----------
    t, y : array
        Times (k,) and states (2n, k): the positions in the order of declaration, then the velocities.
    events, modes : object
        Changes of mode, at the beginning of the step with the new mode; bounces are not events.
    work : dict of str to float
        Energy that the system gets from ``forcing``, ``damping``, ``friction``, ``impacts`` and the moving
        ``bases`` of its contacts, over the run. Those of damping, friction and impacts are not positive, up
        to rounding in a step. With theta = 1/2 they add up to the gain of kinetic and elastic energy.
    stats, status, success, message, warnings : object
        As in a `Solution`.

    Other Parameters
    ----------------
    run, grid, save, wall_time, compile_time : object
        Passed on by `simulate`; do not construct it by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate(hs.two_blocks_on_belt(), (0, 1), integrator="moreau", step=0.01)
    >>> sol.status, sol(1.0).shape
    ('finished', (4,))
    """

    integrator = "moreau"

    def __init__(
        self, run: SteppedRun, grid: np.ndarray | None, save: str, wall_time: float, compile_time: float
    ) -> None:
        self.model, self._run, self._grid, self._save = run.system, run, grid, save
        self._cost = (wall_time, compile_time)
        self._event = np.concatenate([*run.events, np.zeros((0, 4), dtype=np.int64)])
        self._parts = run.system.all_contacts

    # -- trajectory -----------------------------------------------------------------------------------------

    @property
    def t_start(self) -> float:
        """First time of the run."""
        return self._run.span[0]

    @property
    def t_end(self) -> float:
        """Last time that the run reached."""
        return self._run.time

    @cached_property
    def _steps(self) -> np.ndarray:
        return self._instants(np.arange(self._run.done + 1))

    def _instants(self, steps: np.ndarray) -> np.ndarray:
        return np.minimum(self._run.span[0] + steps * self._run.step, self.t_end)

    @cached_property
    def _states(self) -> np.ndarray:
        self._require_states()
        return np.concatenate(self._run.states)

    @cached_property
    def t(self) -> np.ndarray:
        """Times (k,): the requested grid up to the end of the run, else the ends of the steps."""
        if self._grid is not None:
            return self._grid[(self._grid >= self.t_start) & (self._grid <= self.t_end)]
        return self._steps

    @cached_property
    def y(self) -> np.ndarray:
        """States (2n, k) at the times t."""
        return self._states.T if self._grid is None else self(self.t)

    def __call__(self, t: Any) -> np.ndarray:
        """Return the states at time t: (2n,) for a number, (2n, k) for k times."""
        times = self._within(t)
        n, first = self.model.n, self._step_of(times)
        after = np.minimum(first + 1, self._run.done)
        d = (times - self._steps[first])[:, None]
        x, x_after = self._states[first], self._states[after]
        change = (x_after[:, n:] - x[:, n:]) / self._run.step
        out = np.concatenate(
            [x[:, :n] + d * (x[:, n:] + self._run.theta * d * change), x[:, n:] + d * change], axis=1
        )
        return out[0] if np.ndim(t) == 0 else out.T

    def _step_of(self, times: np.ndarray) -> np.ndarray:
        found = np.searchsorted(self._steps, times, side="right") - 1
        return np.clip(found, 0, max(self._run.done - 1, 0))

    def output(self, name: str, t: Any = None) -> np.ndarray:
        """Return a quantity over time by its name.

        It is a state; the force of a contact or an impact, as the mean over its step; ``v_rel(f)`` of a
        contact; or ``gap(p)`` of an impact.

        Parameters
        ----------
        t : a number or an array of times; without it ``sol.t``.
        """
        requested = self.t if t is None else t
        times = as_times(requested)
        name = known_name(
            name, [*self.names, *self.quantities], f"{self.model.name} has no quantity", "quantities"
        )
        nc, names = len(self.model.contacts), [part.name for part in self._parts]
        speeds = {f"v_rel({c.name})": k for k, c in enumerate(self.model.contacts)}
        gaps = {f"gap({i.name})": nc + k for k, i in enumerate(self.model.impacts)}
        if name in self.names:
            values = self(times)[self.names.index(name)]
        elif name in names:
            k = names.index(name)
            self(times)
            mean = np.concatenate([*self._run.forces, np.zeros((0, len(names)))])[self._step_of(times), k]
            values = mean if k >= nc else -mean
        else:
            k, n = speeds.get(name, gaps.get(name, 0)), self.model.n
            x = self(times)
            values = (directions(self.model)[[k]] @ (x[n:] if name in speeds else x[:n])).ravel()
            values = (
                values - self._base(k, times) if name in speeds else values + self._run.arrays.gap[k - nc]
            )
        return values[0] if np.ndim(requested) == 0 else values

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of `output` in addition to the states: forces, relative velocities, gaps."""
        speeds = (f"v_rel({contact.name})" for contact in self.model.contacts)
        return (*(p.name for p in self._parts), *speeds, *(f"gap({i.name})" for i in self.model.impacts))

    def _values(self, name: str, t: np.ndarray, right: bool) -> np.ndarray:
        return self.output(name, t)

    def _base(self, c: int, times: np.ndarray) -> np.ndarray:
        arrays = self._run.arrays
        constant, sine, cosine = arrays.base[c]
        angle = (
            arrays.rates[arrays.base_rate[c]] * times if arrays.base_rate[c] >= 0 else np.zeros(len(times))
        )
        return constant + sine * np.sin(angle) + cosine * np.cos(angle)

    # -- events and modes -----------------------------------------------------------------------------------

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All changes of mode in order of time."""
        self._require_events()
        nothing = np.full(2 * self.model.n, np.nan)
        found = []
        for (step, k, source, target), t in zip(self._event.tolist(), self._when.tolist(), strict=True):
            names = self._mode_names(k)
            x = self._states[step] if self._save == "all" else nothing
            found.append(
                Event(t, "transition", self._parts[k].name, "", names[source], names[target], -1, x, x)
            )
        return tuple(found)

    @cached_property
    def _when(self) -> np.ndarray:
        return self._instants(self._event[:, 0])

    def _mode_names(self, k: int) -> dict[int, str]:
        return _CONTACT if k < len(self.model.contacts) else _IMPACT

    def event_times(self, component: str, kind: str | None = None) -> np.ndarray:
        """Return the times of the events of one contact or impact."""
        self._asked(component, kind, [part.name for part in self._parts])
        numbers = [k for k, part in enumerate(self._parts) if part.name == component]
        return self._when[np.isin(self._event[:, 1], numbers) & (kind in (None, "transition"))]

    @cached_property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each contact and impact in order, with the time interval of each."""
        self._require_events()
        found = {}
        for k, part in enumerate(self._parts):
            mine = self._event[:, 1] == k
            times = [self.t_start, *self._when[mine].tolist(), self.t_end]
            numbers = [int(self._run.first_modes[k]), *self._event[mine, 3].tolist()]
            found[part.name] = tuple(
                ModeInterval(self._mode_names(k)[z], a, b)
                for z, a, b in zip(numbers, times[:-1], times[1:], strict=True)
                if b > a or len(numbers) == 1
            )
        return found

    # -- how it went ----------------------------------------------------------------------------------------

    @property
    def x_end(self) -> np.ndarray:
        """States (2n,) at the end of the run; they are available for every value of `save`."""
        return np.concatenate([self._run.state.q, self._run.state.v])

    @property
    def work(self) -> dict[str, float]:
        """Energy that the system receives from each source; see the class."""
        return dict(zip(_WORKS, self._run.state.work.tolist(), strict=True))

    @property
    def status(self) -> str:
        """How the run ended: "finished" at t1, else the reason it stopped."""
        return self._run.status

    @property
    def success(self) -> bool:
        """Whether the run reached its end."""
        return self.status == "finished"

    @property
    def message(self) -> str:
        """One sentence about how the run ended."""
        if self.success:
            return f"reached t = {self.t_end!r} with moreau, step {self._run.step:g}"
        if self._run.limit_message:
            return f"stopped at t = {self.t_end!r}: {self._run.limit_message}"
        if self._run.overlaps:
            names = ", ".join(self._run.overlaps[:8])
            return f"stopped at t = {self.t_end!r}: the gap of {names} is below zero"
        return f"stopped at t = {self.t_end!r}: the state is not a number after the next step"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run: steps whose impulses did not converge."""
        failed = int(self._run.state.counts[UNSETTLED])
        _, _, tolerance, iterations = self._run.settings
        text = (
            f"{failed} steps did not converge to {tolerance:g} in {iterations} iterations: use a smaller step"
        )
        return (text,) if failed else ()

    @property
    def stats(self) -> dict[str, float]:
        """Cost: steps, sweeps over the contacts, bounces, events, seconds; residual: the largest of any step.

        A residual is the last change of an impulse relative to the largest impulse of its step.
        """
        counts = self._run.state.counts.tolist()
        return {
            "steps": counts[STEPS], "sweeps": counts[SWEEPS], "bounces": counts[BOUNCES], "events": len(self._event),
            "residual": float(self._run.state.residual[0]), "kernel_time": self._run.kernel_time,
            "wall_time": self._cost[0], "compile_time": self._cost[1],
        }  # fmt: skip

    def __repr__(self) -> str:
        stats = self.stats
        return "\n".join(
            [
                f"Solution of {self.model.name} by moreau: {self.status}",
                f"  {self.message}",
                f"  events: {stats['events']}, bounces: {stats['bounces']}",
                f"  cost: {stats['steps']} steps, {stats['sweeps']} sweeps, {stats['wall_time']:.3g} s",
                *(f"  warning: {w}" for w in self.warnings),
            ]
        )
