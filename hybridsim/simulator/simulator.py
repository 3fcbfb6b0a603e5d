"""This module defines the class `Simulator`, which runs a model over whole spans or step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.calls import refusing
from hybridsim.errors import UsageError, nearest
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model
from hybridsim.preparation import Values, prepared
from hybridsim.simulate import ALL_PARTS, KEYWORDS, simulate
from hybridsim.simulator.current_state import CurrentState
from hybridsim.simulator.ownership import Ownership
from hybridsim.simulator.position import Position, advanced, begun, changed, require_running
from hybridsim.simulator.saved_state import SavedState, model_of, require_fit, source_of
from hybridsim.solution.event import Event
from hybridsim.solution.run import Run
from hybridsim.solution.solution import Solution


class Simulator(CurrentState):
    """A model with an integrator and its settings, for many runs or for one run in steps.

    `run` simulates a whole span. `start` and `advance` go from instant to instant, for example with a controller or
    another simulator that sets inputs of kind "held" in between. One thread at a time uses a simulator: the one that
    made it. A `copy` belongs to the thread that takes it.

    Parameters
    ----------
    model : str, path or Model
        A `Model`, the name of a packaged model, or the path of a ``.toml`` file.
    integrator : str, optional
        A name from `list_integrators`, or "auto", as in `simulate`. "auto" selects it again at each start.
    rtol, atol : float, mapping of str to float or sequence of float, optional
        Error control, as in `simulate`.
    max_step, first_step : float, optional
        Largest step, and first step after a start, as in `simulate`.
    **options : Any
        Options of the integrator.

    Raises
    ------
    UsageError
        If an argument does not fit the model or the integrator.
    ModelError
        If the model is faulty.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sim = hs.Simulator("dfcs", integrator="exact")
    >>> sim.start(0.0)
    ()
    >>> sim.advance(0.002)
    (<transition f stick -> slip+ at t = 0.00171998458>,)
    >>> sim.t, sim.modes
    (0.002, {'f': 'slip+'})
    """

    @refusing
    def __init__(
        self,
        model: Model | str | PathLike[str],
        *,
        integrator: str = "auto",
        rtol: float | None = None,
        atol: float | Mapping[str, float] | Sequence[float] | None = None,
        max_step: float = math.inf,
        first_step: float | None = None,
        **options: Any,
    ) -> None:
        if isinstance(model, MechanicalSystem):
            raise UsageError(
                "a MechanicalSystem cannot be run in steps",
                remedy="use hs.simulate, or convert the system to a model by system.to_model()",
            )
        self.model = arguments.chosen_model(model, None)
        self._settings: dict[str, Any] = {
            "integrator": integrator, "rtol": rtol, "atol": atol, "max_step": max_step, "first_step": first_step,
        }  # fmt: skip
        self._options = options
        self._prepared((0.0, 0.0), Values())  # checks the arguments, and binds the model once
        self._position: Position | None = None
        self._first: Position | None = None  # just after the last start
        self._mine = Ownership(self.model.name)

    def _prepared(self, t_span: tuple[float, float], values: Values) -> Run:
        """Return a prepared run with the settings of the simulator."""
        run, _ = prepared(
            self.model, t_span, values, t_eval=None, save="events", limits=None, options=self._options,
            keywords=KEYWORDS, **self._settings,
        )  # fmt: skip
        return run

    def _commit(self, position: Position) -> None:
        self._position = position

    # -- whole runs -----------------------------------------------------------------------------------------

    @refusing
    def run(
        self,
        t_span: tuple[float, float],
        *,
        params: Mapping[str, Any] | None = None,
        x0: Mapping[str, float] | Sequence[float] | None = None,
        z0: Mapping[str, str] | None = None,
        t_eval: Sequence[float] | None = None,
        keep: str | float = ALL_PARTS,
        limits: Mapping[str, float] | None = None,
        progress: Callable[[float], None] | bool | None = None,
        **former: Any,
    ) -> Solution:
        """Simulate a whole span and return its solution, as `simulate` does; the steps of `advance` are not affected.

        Parameters
        ----------
        t_span : tuple of float
            (t0, t1).
        params, x0, z0, limits : mapping, optional
            As in `simulate`.
        t_eval, keep, progress : optional
            As in `simulate`.
        **former : Any
            Deprecated names of arguments, as in `simulate`.

        Returns
        -------
        Solution
            The solution.
        """
        return simulate(
            self.model, t_span, params=params, x0=x0, z0=z0, t_eval=t_eval, keep=keep, limits=limits,
            progress=progress, **former, **self._settings, **self._options,
        )  # fmt: skip

    # -- steps ----------------------------------------------------------------------------------------------

    @refusing
    def start(
        self,
        t0: float = 0.0,
        *,
        params: Mapping[str, Any] | None = None,
        x0: Mapping[str, float] | Sequence[float] | None = None,
        z0: Mapping[str, str] | None = None,
    ) -> tuple[Event, ...]:
        """Start a run at t0 and return the events of that instant.

        Parameters
        ----------
        t0 : float, optional
            The time of the start.
        params, x0, z0 : mapping, optional
            As in `simulate`. A held input in x0 has that value from the start.

        Returns
        -------
        tuple of Event
            The events at t0, such as a clock that ticks there.

        Raises
        ------
        UsageError
            If an argument does not fit the model or the integrator.
        SimulationError
            If no motion begins from these values.
        """
        with self._mine("start"):
            begin = arguments.finite_number(t0, "t0")
            begun(self._prepared((begin, begin), Values(params, x0, z0)), self._commit)
            found = self._taken()
            self._first = self._position
            return found

    @refusing
    def advance(self, to: float, inputs: Mapping[str, float] | None = None) -> tuple[Event, ...]:
        """Advance to a later time, and return the events on the way and at that time.

        Parameters
        ----------
        to : float
            The time to reach.
        inputs : mapping of str to float, optional
            Held inputs to set at the present time, before going on; see `set`.

        Returns
        -------
        tuple of Event
            The events since the last call, in order of time.

        Raises
        ------
        UsageError
            If an argument does not fit, or the run has ended.
        SimulationError
            If the motion cannot be continued to this time. The simulator is then just after the last event.
        """
        with self._mine("advance"):
            position = require_running(self._position, "advance")
            discrete = self._with(position, inputs)
            target = arguments.finite_number(to, "to")
            if target < position.t:
                raise UsageError(
                    f"`to` is {to!r}, but the simulator is already at {position.t!r}",
                    remedy="use a later time, or sim.restore() for an earlier state",
                )
            if discrete is not None:
                changed(position, discrete, self._commit)
                position = require_running(self._position, "advance")
            if target > position.t:
                advanced(position, target, self._commit)
            return self._taken()

    @refusing
    def set(self, inputs: Mapping[str, float]) -> tuple[Event, ...]:
        """Set held inputs at the present time and return the events that this change causes at once.

        A changed value is a further change at this instant: corners and modes are judged again with it. A value that
        is equal to the present one changes nothing.

        Parameters
        ----------
        inputs : mapping of str to float
            New values by name. The other inputs keep theirs.

        Returns
        -------
        tuple of Event
            The events, for example the release of a contact.

        Raises
        ------
        UsageError
            For an unknown input or a value that is not a finite number.
        SimulationError
            If no motion is possible with these values. The simulator then stands just before the change.
        """
        with self._mine("set"):
            position = require_running(self._position, "set")
            discrete = self._with(position, inputs)
            if discrete is not None:
                changed(position, discrete, self._commit)
            return self._taken()

    def _with(self, position: Position, inputs: Any) -> np.ndarray | None:
        """Return the discrete values with new inputs, or None if no value changes."""
        if inputs is None:
            return None
        if not isinstance(inputs, Mapping):
            raise arguments.cannot_be("inputs", inputs, "use a dict of names and numbers")
        held_indices, former = position.held_indices, position.discrete
        discrete = former.copy()
        for name, value in inputs.items():
            if name not in held_indices:
                raise UsageError(
                    f"`inputs` contains {name!r}, which is not a held input of model '{self.model.name}'",
                    remedy=nearest(str(name), held_indices, kind="held inputs"),
                )
            discrete[held_indices[name]] = arguments.finite_number(value, f"`inputs` of {name}")
        return None if discrete.tobytes() == former.tobytes() else discrete

    def _taken(self) -> tuple[Event, ...]:
        """Return the events that were not returned by earlier calls."""
        position = self._current
        if position.events:
            self._position = position._replace(events=())
        return position.events

    # -- copies ---------------------------------------------------------------------------------------------

    def copy(self) -> Simulator:
        """Return an independent copy in the same state, which belongs to the calling thread.

        Returns
        -------
        Simulator
            The copy.
        """
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        other._mine = Ownership(self.model.name)
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: object) -> Simulator:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the model as text and the state as numbers; the simulator belongs to the thread that unpickles it."""
        saved = [position and SavedState(position, self._about) for position in (self._position, self._first)]
        return _unpickled, (source_of(self.model), self._settings | self._options, *saved)

    def save(self) -> SavedState:
        """Return the present state, which can be pickled and restored by `restore`.

        Returns
        -------
        SavedState
            The state; it never changes.
        """
        return SavedState(self._current, self._about)

    @property
    def _about(self) -> str:
        """The settings as text; a saved state can be restored only in a simulator with equal settings."""
        return repr((self._settings, self._options))

    @refusing
    def restore(self, saved: SavedState) -> None:
        """Restore a saved state of this simulator, or of another simulator with the same model.

        Parameters
        ----------
        saved : SavedState
            What `save` returned.

        Raises
        ------
        UsageError
            If the state belongs to another model or to other settings.
        """
        with self._mine("restore"):
            if not isinstance(saved, SavedState):
                raise arguments.cannot_be("saved", saved, "use a result of sim.save()")
            require_fit(saved, self.model, self._about)
            self._position = saved.position

    def reset(self) -> None:
        """Restore the state just after the last start."""
        with self._mine("reset"):
            require_running(self._first, "reset")
            self._position = self._first


def _unpickled(
    source: Any, settings: dict[str, Any], now: SavedState | None, first: SavedState | None
) -> Simulator:
    """Return a simulator from its pickled parts."""
    simulator = Simulator(model_of(source), **settings)
    simulator._position = None if now is None else now.position
    simulator._first = None if first is None else first.position
    return simulator
