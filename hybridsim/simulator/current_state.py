"""This module reads the present state of a simulator between two calls."""

from __future__ import annotations

from typing import Any

from hybridsim.calls import refusing
from hybridsim.errors import UsageError, printable
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.simulator.position import Position
from hybridsim.simulator.read_only import ReadOnly


class CurrentState(Readable):
    """The present time, states, modes, inputs and outputs; see `hybridsim.simulator.simulator.Simulator`."""

    model: Model
    _settings: dict[str, Any]
    _position: Position | None

    def __repr__(self) -> str:
        position, integrator = self._position, self._settings["integrator"]
        if position is None:
            return f"Simulator of {self.model.name} by {integrator}: not started"
        ended = f"; the run has {position.ended}" if position.ended else ""
        rows = {
            "state": [f"{name} = {value:.9g}" for name, value in self.state.items()],
            "inputs": [f"{name} = {value:.9g}" for name, value in self.inputs.items()],
            "modes": [f"{name} {mode}" for name, mode in self.modes.items()],
        }
        head = f"Simulator of {self.model.name} by {position.run.method.name}: at t = {self.t:.9g}{ended}"
        table = aligned([(title, ", ".join(values)) for title, values in rows.items() if values], "  ")
        return printable("\n".join([head, *table]))

    @property
    def _current(self) -> Position:
        if self._position is None:
            raise UsageError("the simulator has not started", remedy="call sim.start(t0) first")
        return self._position

    @property
    def t(self) -> float:
        """The present time."""
        return self._current.t

    @property
    def state(self) -> dict[str, float]:
        """The present states by name; this dict is read-only."""
        position = self._current
        states = dict(zip(position.run.system.names, position.x.tolist(), strict=True))
        return ReadOnly(states, "sim.state", "use sim.start(t0, x0={name: value}) to begin with other values")

    @property
    def modes(self) -> dict[str, str]:
        """The present mode of each component, by name; this dict is read-only."""
        system, z = self._current.run.system, self._current.z
        modes = {a.name: a.modes[m] for a, m in zip(system.declared, z.tolist(), strict=False)}
        return ReadOnly(modes, "sim.modes", "use sim.start(t0, z0={name: mode}) to begin in other modes")

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of the held inputs; this dict is read-only."""
        position = self._current
        inputs = {name: float(position.discrete[k]) for name, k in position.held_indices.items()}
        return ReadOnly(
            inputs, "sim.inputs", "use sim.set({name: value}) or sim.advance(to, inputs={name: value})"
        )

    @property
    def ended(self) -> str:
        """The reason why the run has ended, such as a monitor; empty while the run can continue."""
        return self._current.ended

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings since the start."""
        return tuple(f"{m} ({n} times)" if n > 1 else m for m, n in self._current.warnings.items())

    @refusing
    def output(self, name: str) -> float:
        """Return the present value of a state, output, input, definition, force, or ``v_rel(contact)``.

        Parameters
        ----------
        name : str
            Name of the quantity, as in `Solution.output`.

        Returns
        -------
        float
            The value just after everything that happened so far at this time, new inputs included.

        Raises
        ------
        UsageError
            For an unknown name.
        """
        return self._current.value(name)
