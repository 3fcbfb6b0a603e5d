"""This module reads the present state of a simulator between two calls."""

from __future__ import annotations

from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.simulator.position import Position


class CurrentState:
    """The present time, states, modes, inputs and outputs; see `hybridsim.simulator.simulator.Simulator`."""

    _position: Position | None

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
        """The present states by name."""
        position = self._current
        return dict(zip(position.run.system.names, position.x.tolist(), strict=True))

    @property
    def modes(self) -> dict[str, str]:
        """The present mode of each component, by name."""
        system, z = self._current.run.system, self._current.z
        return {a.name: a.modes[m] for a, m in zip(system.declared, z.tolist(), strict=False)}

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of the held inputs."""
        position = self._current
        return {name: float(position.discrete[k]) for name, k in position.held_indices.items()}

    @property
    def ended(self) -> str:
        """The reason why the run has ended, such as a monitor; empty while it can continue."""
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
