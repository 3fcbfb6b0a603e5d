"""This module defines the result of a run: times, states, dense output, events, modes, outputs and cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.solution.event import Event
from hybridsim.solution.explain.explanation import explain
from hybridsim.solution.in_pictures import InPictures
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.run import Run
from hybridsim.solution.summary import as_text, in_html

if TYPE_CHECKING:
    from hybridsim.engine.record.block_list import SegmentBlockList
    from hybridsim.engine.system.system import System
    from hybridsim.solution.explain.explanation import Explanation

_GOOD = ("finished", "terminated")


class Solution(InPictures):
    """The result of `simulate` for every model and integrator; ``sol(t)`` is the dense output.

    Attributes
    ----------
    model : Model or MechanicalSystem
        What was simulated.
    integrator : str
        Name of the integrator.
    t : array
        Times (m,), in the unit of t of the model: ``t_eval`` as far as the run came, otherwise the steps, with
        every event time twice. For a `MechanicalSystem` with ``moreau`` they are the ends of the steps.
    y : array
        States (n, m) at the times t, as in SciPy: one row per state, in the unit of the state, and one column
        per time, with x- and x+ at the two entries of an event time. The rows follow ``names``.

    Other Parameters
    ----------------
    trajectory : object
        Passed on by `simulate`; do not construct a solution by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", (0, 0.1))
    >>> sol(0.05).shape, len(sol.events)
    ((2,), 27)
    >>> sol.names
    ('x', 'v')
    >>> hs.simulate(hs.two_blocks_on_belt(), (0, 1)).names
    ('q1', 'q2', 'v1', 'v2')
    """

    # -- the run of a `Model`, for other parts of the package -------------------------------------------------

    @property
    def _of_model(self) -> ModelTrajectory:
        """Return the trajectory of a run of a `Model`; for other runs, raise an error."""
        if not isinstance(self._trajectory, ModelTrajectory):
            raise UsageError(
                f"{self.model.name} is a MechanicalSystem, whose runs cannot be saved, resumed, explained or "
                "differentiated",
                remedy="simulate system.to_model() (if the contact velocities are independent), write the table "
                "and the events with to_npz(), or start a new run from x0=sol.x_end",
            )
        return self._trajectory

    @property
    def _run(self) -> Run:
        return self._of_model.run

    @property
    def _system(self) -> System:
        return self._of_model.system

    @property
    def _segments(self) -> SegmentBlockList:
        return self._of_model.segments

    def explain(self, number: int | Event) -> Explanation:
        """Explain an event: guards that reached zero, modes that could hold just after, and the reason.

        Parameters
        ----------
        number : the index of the event in `events`, or an event of `events` or `corners`.

        Raises
        ------
        UsageError
            If there is no such event, ``keep`` did not store the data that is needed, or a `MechanicalSystem` was
            simulated.

        Examples
        --------
        >>> import hybridsim as hs
        >>> sol = hs.simulate("dfcs", t_span=(0, 0.01))
        >>> print(sol.explain(0).reason)
        slip+ is the only mode that is admissible just after
        """
        return explain(self, number)

    # -- how it went ----------------------------------------------------------------------------------------

    @property
    def status(self) -> str:
        """How the run ended: "finished" at t1, "terminated" by a monitor or schedule, or the reason why it stopped."""
        return self._trajectory.status

    @property
    def success(self) -> bool:
        """Whether the run reached its end or was terminated by a monitor or schedule."""
        return self.status in _GOOD

    @property
    def chosen_because(self) -> str:
        """Why `auto` chose the integrator, as text; empty if the integrator was named."""
        return self._trajectory.reason

    @property
    def message(self) -> str:
        """One sentence about how the run ended."""
        return self._trajectory.message

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run: near-grazings, undecided events, accumulation, chattering, jumps, stiffness."""
        return self._trajectory.warnings

    @property
    def stats(self) -> dict[str, float]:
        """Cost of the run: numbers of steps, evaluations, events and restarts; times in seconds.

        wall_time covers the whole run. kernel_time is the part of it in the compiled mode loop, for methods
        that have one. A `MechanicalSystem` counts steps of the whole system, ``nodes_restarted``, and with ``moreau``
        sweeps over the contacts and bounces; ``residual`` is then the largest residual of any step, the last
        change of an impulse relative to the largest impulse of its step.
        """
        return self._trajectory.stats

    # -- on disk, and on ------------------------------------------------------------------------------------

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a solution in the form of its file; models with Python functions cannot be pickled."""
        from hybridsim.solution.files.archive import of_bytes, to_bytes

        if not isinstance(self._trajectory, ModelTrajectory):
            return Solution, (self._trajectory,)
        return of_bytes, (to_bytes(self),)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the run to one file: the model, its settings, the trajectory, and the checkpoint to resume from.

        `hybridsim.load_solution` reads it. The file is a zip of NumPy arrays and one text; it contains no
        code.

        Parameters
        ----------
        path : the file; the usual suffix is .hsol.

        Raises
        ------
        UsageError
            For a model of Python functions or a `MechanicalSystem`, or if the file cannot be written.
        """
        from hybridsim.solution.files.archive import save

        save(self, path)

    @refusing
    def resume(
        self,
        t_end: float | None = None,
        *,
        limits: Mapping[str, float] | None = None,
        progress: Callable[[float], None] | bool | None = None,
    ) -> Solution:
        """Resume the run from just after its last event, and return the solution of the whole run.

        The result is bit for bit that of an uninterrupted run: after Ctrl-C, after a limit, or beyond the
        original end. Beyond the original end it agrees only to the tolerances for the methods of SciPy and
        SUNDIALS and for ``rodas5p``, because their first step depends on the distance to the end.

        Parameters
        ----------
        t_end : the new end; without it the original end.
        limits, progress : as in `simulate`; limits count from here.

        Raises
        ------
        UsageError
            If the run has already reached its end, or cannot continue (a terminating monitor, an error, a
            `MechanicalSystem`).

        Examples
        --------
        >>> import hybridsim as hs
        >>> part = hs.simulate("dfcs", t_span=(0, 0.1), limits={"events": 5}, integrator="scipy-dop853")
        >>> part.status, part.resume().status
        ('limit', 'finished')
        """
        from hybridsim.solution.resume import resumed

        return resumed(self, t_end, limits, progress)

    # -- as SciPy's OdeResult --------------------------------------------------------------------------------

    @property
    def sol(self) -> Solution:
        """The dense output, with the name that SciPy uses."""
        return self

    @property
    def nfev(self) -> int:
        """Number of evaluations of the right-hand side, with the name that SciPy uses."""
        return self._measured("nfev", self.stats.get("rhs_evaluations"), "a Model")

    @property
    def njev(self) -> int:
        """No result: SciPy counts Jacobians under this name, and hybridsim does not."""
        raise AttributeError(
            f"a Solution has no njev, because Jacobians are not counted; `stats` has {', '.join(self.stats)}",
            name="njev",
        )

    @property
    def t_events(self) -> list[np.ndarray]:
        """Times of each monitor in the order of declaration, with the name that SciPy uses."""
        return [self.event_times(name, "monitor") for name in self._monitors]

    @property
    def y_events(self) -> list[np.ndarray]:
        """States (events, n) of each monitor, with the name that SciPy uses."""
        found = [
            [e.x_minus for e in self.events if e.component == name and e.kind == "monitor"]
            for name in self._monitors
        ]
        return [np.array(rows).reshape(-1, len(self.names)) for rows in found]

    @property
    def _monitors(self) -> list[str]:
        return [monitor.name for monitor in getattr(self.model, "monitors", ())]

    def __repr__(self) -> str:
        return as_text(self._trajectory)

    def _repr_html_(self) -> str:
        """Return the HTML for notebooks: a summary, a strip of modes for each component, and the events."""
        return in_html(self._trajectory, self.success)
