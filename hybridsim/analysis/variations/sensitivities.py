"""This module computes derivatives of a run's end and event times with respect to its start and parameters."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np

from hybridsim.analysis.compare.comparison_request import checked_names
from hybridsim.analysis.variations.both_sides import BothSides, OneSide
from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.over_time import Derivatives, OverTime
from hybridsim.analysis.variations.readings.of_run import ReadingDerivatives, Readings, quantities_of
from hybridsim.analysis.variations.refused import refuse
from hybridsim.analysis.variations.values.parameters import start_slopes, value_slopes
from hybridsim.analysis.variations.values.table_slopes import table_value
from hybridsim.arguments import cannot_be, flag
from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.expr.grammar import TIME
from hybridsim.model.parts.remedies import remedy_for_parameter
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.solution import Solution


@dataclass(frozen=True)
class Sensitivities(Readable):
    """The derivatives of a run and its event times with respect to its initial state and parameters.

    Parameters
    ----------
    states, parameters : tuple of str
        Names of the n states and d discrete states, and of the P chosen parameters.
    by_start : array
        (n + d, n + d), d(state at the end)/d(state at the start): the transition or monodromy matrix.
    by_parameter : array
        (n + d, P), d(state at the end)/d(parameter); starts and parameters that are declared as expressions of
        a parameter change with it.
    times : array
        (E,) the instants inside the run at which modes or states changed; several events may share one.
    times_by_start, times_by_parameter : array
        (E, n + d), (E, P), derivatives of these times.
    warnings : tuple of str
        Guards, surfaces or ends on which the run lies exactly, with the changes that move it off, if the derivatives
        on the two sides differ; the derivatives are then NaN.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.sensitivities(hs.simulate("free-decay", (0, 1)), ["mu"])
    >>> found.states, found.by_start.shape, found.by_parameter.shape
    (('x', 'v'), (2, 2), (2, 1))
    """

    states: tuple[str, ...]
    parameters: tuple[str, ...]
    by_start: np.ndarray
    by_parameter: np.ndarray
    times: np.ndarray
    times_by_start: np.ndarray
    times_by_parameter: np.ndarray
    warnings: tuple[str, ...] = ()
    _over_time: OverTime = field(init=False, repr=False, compare=False)

    @refusing
    def at(self, t: Any, names: str | Sequence[str] | None = None, side: str = "+") -> Derivatives:
        """Return the derivatives of states or other quantities at fixed times.

        Parameters
        ----------
        t : float or sequence of float
            A time or k times of the run.
        names : str or sequence of str, optional
            Names of m states or quantities, as for `Solution.output`; the default is `states`.
        side : str, optional
            At an event, "-" gives the derivatives just before it and "+" those just after it.

        Returns
        -------
        Derivatives
            Arrays ``by_start`` (m, n + d) and ``by_parameter`` (m, P), or (k, m, n + d) and (k, m, P) for k times.
            A quantity that has no derivative at a time, such as sqrt(x) at x = 0, has NaN or infinity there.

        Examples
        --------
        >>> import hybridsim as hs
        >>> found = hs.sensitivities(hs.simulate("dfcs", (0, 0.05)), ["mu", "N"])
        >>> found.at(0.03).by_parameter.shape
        (2, 2)
        >>> found.at([0.01, 0.02, 0.03], "f").by_parameter.shape
        (3, 1, 2)
        """
        chosen = self.states if names is None else checked_names(names, "names")
        return self._over_time.at(t, chosen, side)

    @refusing
    def of(
        self, reading: str, *quantities: str, t_span: tuple[float, float] | None = None
    ) -> ReadingDerivatives:
        """Return an extreme value, an amplitude, an integral or a mean of the run, with its derivatives.

        ::

            maximum     dq at the place of the maximum, where q' = 0; dq + q' dt at an event at the time t
            integral    integral of dq, plus (q- - q+) dt of each event at which q jumps

        dq is the derivative of the quantity q at a fixed time, as `at` returns it. The rule for the maximum is the
        envelope theorem. The integral is that of `Solution.integral`, between the events.

        Parameters
        ----------
        reading : str
            "minimum", "maximum", "amplitude" = (maximum - minimum)/2, "integral", or "mean" = integral/(b - a).
        *quantities : str
            Name of a state or quantity, as for `at`. An integral and a mean accept several, of which they take the
            product, and "t", which is time.
        t_span : (a, b), optional
            A part of the run with fixed ends; by default all of it.

        Returns
        -------
        ReadingDerivatives
            The value, and arrays ``by_start`` (n + d,) and ``by_parameter`` (P,). A derivative that differs on the two
            sides of a guard is NaN, as in `by_parameter`.

        Raises
        ------
        UsageError
            For an unknown name; if the extreme value is reached at several times and a change of the run moves the
            values apart; if it is at an end of the time span at which an event happens; or if the quantity varies
            too fast.

        Examples
        --------
        >>> import hybridsim as hs
        >>> run = hs.simulate("free-decay", (0, 20))
        >>> found = hs.sensitivities(run, ["mu"]).of("minimum", "x")
        >>> found.by_parameter.shape
        (1,)
        """
        names = quantities_of(reading, quantities)
        over = self._over_time
        over.require([name for name in names if name != TIME])
        first, last = over.solution._part(t_span)
        if first == last:
            raise cannot_be("t_span", t_span, "use two different times")
        changes = [*(f"the start of {name}" for name in self.states), *self.parameters]
        value, slopes = Readings(over, first, last, changes).of(reading, names)
        starts = len(self.states)
        title = f"{reading} of {' * '.join(names)}"
        return ReadingDerivatives(title, value, slopes[:starts], slopes[starts:])

    def plot(self, *names: str) -> Any:
        """Draw the derivatives dt/dp of the event times against the event times; see `hybridsim.plot.event_slopes`.

        The names are parameters, or states for the initial values; by default the first six parameters. It returns the
        axes; ``hybridsim.plot.save`` writes them to a file. A run without events, or an unknown name, raises
        `UsageError`.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").event_slopes(self, names)

    def __repr__(self) -> str:
        columns = [f"d/d{name}(0)" for name in self.states] + [f"d/d{name}" for name in self.parameters]
        values = np.hstack([self.by_start, self.by_parameter])
        rows = [
            (name, *(f"{value:.6g}" for value in row)) for name, row in zip(self.states, values, strict=True)
        ]
        return "\n".join(
            [
                f"Sensitivities of a run: of its end, and of {len(self.times)} event times",
                *aligned([("at the end", *columns), *rows], indent="  "),
                *(f"  warning: {text}" for text in self.warnings),
            ]
        )


@refusing
def sensitivities(
    solution: Solution, parameters: Sequence[str] | None = None, *, starts_follow: bool = True
) -> Sensitivities:
    """Differentiate a run and its event times with respect to its initial state and parameters.

    The variational equations Y' = f_x Y + f_p are integrated along the dense output and carried through each event by
    its saltation matrix (`hybridsim.analysis.variations.carried`), including a contact's loss of rank in stick. The
    derivatives hold for a fixed sequence of events; if a graze or a coincidence changes the sequence, there is none.
    They are taken at a fixed end time, even if a monitor ended the run. To get the derivative of the monitor's time,
    set its action to "record" and continue the run past it; the time is then among ``times``.

    Parameters
    ----------
    solution : Solution
        A run of `simulate`, forward in time, with keep="all". The derivatives are as accurate as this run.
    parameters : sequence of str, optional
        Names of the parameters; by default all. "u[2]" is value 2 of the table u, an input, counted from 0. A table
        with the interpolation "previous" stores each value twice, at the start and at the end of its interval.
    starts_follow : bool, optional
        Whether starts that are declared as expressions of parameters change with them, unless the run set others.

    Returns
    -------
    Sensitivities
        The derivatives.

    Raises
    ------
    UsageError
        For a run that was not kept completely, a model of Python functions, an unknown parameter, an event
        whose guard only touches zero, or an impact without a unique outcome.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("free-decay", (0, 1))
    >>> hs.sensitivities(sol, ["mu"]).by_parameter.shape
    (2, 1)
    """
    return _found(solution, parameters, starts_follow, BothSides)


def derivatives(
    solution: Solution, parameters: Sequence[str] | None = None, *, starts_follow: bool = True
) -> Sensitivities:
    """Return the derivatives of a run. On a guard or surface, the derivatives are one-sided, on the run's side."""
    return _found(solution, parameters, starts_follow, OneSide)


def _found(
    solution: Solution,
    parameters: Sequence[str] | None,
    starts_follow: bool,
    sides: type[OneSide],
) -> Sensitivities:
    if not hasattr(solution, "_segments"):
        raise cannot_be("solution", solution, "use the result of hs.simulate")
    model, system = solution.model, solution._system
    names = [p.name for p in model.parameters]
    starts_follow = flag(starts_follow, "starts_follow")
    chosen = tuple(names) if parameters is None else checked_names(parameters, "parameters")
    for name in chosen:
        if name not in names and table_value(model, name) is None:
            raise UsageError(
                f"model {model.name} has no parameter {name!r}",
                remedy=remedy_for_parameter(model, name),
            )
    refuse(solution)
    n, d = system.n, system.layout.discrete
    states = (*solution.names, *(q.name for q in model.discrete))
    changed_by_run = np.array(solution.names)[solution._run.task.x0 != system.start_state({})]
    fixed = set(changed_by_run.tolist()) if starts_follow else set(states)  # stick may have moved them since
    directions = directions_by(solution, chosen, states, fixed)
    found = OverTime(solution, directions, sides)
    end, (times, shifts) = found.at_end(), found.of_times()
    changed = [*(f"the start of {name}" for name in states), *chosen]
    result = Sensitivities(
        states,
        chosen,
        end[:, : n + d],
        end[:, n + d :],
        times,
        shifts[:, : n + d],
        shifts[:, n + d :],
        tuple(
            f"{name}, but a change of {' or '.join(np.array(changed)[mask])} moves it off zero: "
            "derivatives that "
            "differ on the two sides are NaN"
            for name, mask in found.differing()
        ),
    )
    object.__setattr__(result, "_over_time", found)
    return result


def directions_by(
    solution: Solution, parameters: Sequence[str], starts: Sequence[str], fixed: Container[str]
) -> Directions:
    """Return directions for the initial values of some states, followed by directions for some parameters.

    fixed : states and discrete states whose starts do not follow parameters.
    """
    model, P = solution.model, len(solution.model.parameters)
    tables = {name: one for name in parameters if (one := table_value(model, name)) is not None}
    plain = [name for name in dict.fromkeys(parameters) if name not in tables]
    by_each = np.zeros((P + len(tables), len(plain) + len(tables)))
    by_each[:P, : len(plain)] = value_slopes(model, plain)
    by_each[P:, len(plain) :] = np.eye(len(tables))
    by_all = by_each[:, [[*plain, *tables].index(name) for name in parameters]]
    by_parameter = by_all[:P]
    parts = []
    for states in (model.states, model.discrete):
        names = [state.name for state in states]
        slopes = start_slopes([state.start for state in states], model, by_parameter)
        slopes[[name in fixed for name in names]] = 0.0
        chosen = np.array([[float(name == start) for start in starts] for name in names])
        parts.append(np.concatenate([chosen.reshape(len(names), len(starts)), slopes], axis=1))
    changes = np.concatenate([np.zeros((len(by_all), len(starts))), by_all], axis=1)
    return Directions(parts[0], parts[1], changes, tuple(tables.values()))
