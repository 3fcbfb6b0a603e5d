"""This module computes the Lyapunov exponents of a motion: the mean rates at which neighbouring motions move apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.steady.irregular.lyapunov import Growth
from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.variations.sizes import sizes
from hybridsim.arguments import cannot_be
from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, in_numbers
from hybridsim.simulate import simulate

_PARTS = 200  # of the motion; the directions are made orthogonal after each
_BATCHES = 10  # of these parts; their spread gives the errors
_TRANSIENT = 0.1  # of the duration
_FIRST = ("x0", "z0")  # options of the first run


@dataclass(frozen=True)
class LyapunovExponents(Readable):
    """The Lyapunov exponents of a motion, from the largest to the least.

    Parameters
    ----------
    values : array
        (M,) exponents per unit of time. -inf: events such as the start of stick make this change of the state zero.
    errors : array
        (M,) standard errors of the means, from ten consecutive parts of the motion. NaN for an exponent of -inf.
    t_span : tuple of float
        The part of the motion over which they are means.
    warnings : tuple of str, optional
        Contacts that stick, and surfaces along which the motion slides, during the last half of it or longer.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.lyapunov_exponents("belt", 400)
    >>> found.values.shape, found.t_span
    ((2,), (40.0, 440.0))
    """

    values: np.ndarray
    errors: np.ndarray
    t_span: tuple[float, float]
    warnings: tuple[str, ...] = ()

    @property
    def dimension(self) -> float:
        """The Kaplan-Yorke dimension of the attractor; NaN if too few exponents are known for it.

        ::

            D = j + (l_1 + ... + l_j)/abs(l_(j+1))

        j is the largest number of exponents whose sum is not negative (J. L. Kaplan and J. A. Yorke, Lecture Notes in
        Mathematics 730 (1979) 204, doi:10.1007/BFb0064319).
        """
        sums = np.concatenate([[0.0], np.cumsum(self.values)])
        j = int(np.flatnonzero(sums >= 0.0)[-1])
        return j - sums[j] / self.values[j] if j < len(self.values) else math.nan

    def __repr__(self) -> str:
        first, last = self.t_span
        rows = [
            f"Lyapunov exponents from t = {first:.6g} to t = {last:.6g}: {in_numbers(self.values)}",
            f"  standard errors: {in_numbers(self.errors)}",
            *(f"  warning: {text}" for text in self.warnings),
        ]
        return "\n".join(rows)


@refusing
def lyapunov_exponents(
    model: Model | str | PathLike[str],
    duration: float,
    *,
    count: int | None = None,
    transient: float | None = None,
    params: Mapping[str, Any] | None = None,
    progress: Callable[[float], None] | bool | None = None,
    **options: Any,
) -> LyapunovExponents:
    """Compute the Lyapunov exponents of a motion with events.

    ::

        l_i = lim (1/T) log(r_1 r_2 ... r_k)_i

    The r are the diagonal elements of the triangular factors by which orthogonal directions of change grow over
    consecutive parts of the motion (Benettin et al. 1980). The directions follow the variational equations between
    events, and the saltation matrices at events. Use it to tell chaos (a positive exponent) from a regular motion,
    and to measure how fast a disturbance decays. The largest exponent of an autonomous model whose motion does not
    rest is at least zero: a shift in time neither grows nor decays.

    Parameters
    ----------
    model : str, path or Model
        As in `simulate`. A `MechanicalSystem` has to be converted by ``to_model()``.
    duration : float
        Length of time over which the mean is taken.
    count : int, optional
        Number M of exponents, the largest ones. By default all: one for each state and discrete state.
    transient : float, optional
        Length of time that the motion is followed before; by default a tenth of the duration.
    params : mapping, optional
        As in `simulate`.
    progress : bool or callable, optional
        True shows a bar. A function is called with the finished fraction; an exception from it ends the computation.
    **options : Any
        As in `simulate`: x0, z0, integrator, rtol and so on.

    Returns
    -------
    LyapunovExponents
        The exponents with standard errors. The errors do not contain a slow approach to the limit: an exponent of
        zero has an error of the order 1/duration.

    Raises
    ------
    UsageError
        For invalid arguments, a model of Python functions or a `MechanicalSystem`.
    SimulationError
        If the motion ends early, or has no derivative.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.lyapunov_exponents("feeny-moon", 400)
    >>> bool(found.values[0] > 0.05), float(found.values[1])
    (True, -inf)
    """
    if isinstance(model, MechanicalSystem):
        raise UsageError(
            "`model` is a MechanicalSystem, for which exponents are not supported",
            remedy="use model.to_model()",
        )
    model = arguments.chosen_model(model, params)
    report = arguments.callback(progress)
    duration = _length(duration, "duration")
    transient = _TRANSIENT * duration if transient is None else _length(transient, "transient")
    most = len(model.states) + len(model.discrete)
    count = most if count is None else arguments.whole_number(count, "count", 1, most)
    refuse_unknown([lyapunov_exponents, simulate], options)
    first = {name: options.pop(name) for name in list(options) if name in _FIRST}
    motion = Motion(model, options, first)
    before = motion.run(None, 0.5 * transient)
    start = replace(point_at_end(before), at=0.5 * transient)
    largest = np.concatenate([sizes(before), np.abs(start.discrete)])
    growth = Growth(motion, start, count, np.where(largest > 0.0, largest, 1.0))
    growth.over(0.5 * transient)  # the directions settle, too
    rates = np.empty((_PARTS, count))
    for part in range(_PARTS):
        rates[part] = growth.over(duration / _PARTS) * (_PARTS / duration)
        if report is not None:
            report((part + 1) / _PARTS)
    order = np.argsort(-rates.mean(axis=0), kind="stable")
    with np.errstate(invalid="ignore"):  # -inf - (-inf)
        means = rates[:, order].reshape(_BATCHES, -1, count).mean(axis=1)
        errors = means.std(axis=0, ddof=1) / math.sqrt(_BATCHES)
    t_span = (transient, transient + duration)
    return LyapunovExponents(means.mean(axis=0), errors, t_span, tuple(_held(growth, t_span)))


def _held(growth: Growth, t_span: tuple[float, float]) -> Iterator[str]:
    """Yield a warning for each component that sticks, or slides on a surface, for the last half of the motion."""
    first, last = t_span
    for name, since in growth.held_since.items():
        if since <= 0.5 * (first + last):
            yield (
                f"{name} stays in mode {growth.holds[name]} from t = {max(since, first):.6g} to the end. In "
                "this mode a shift of a position neither grows nor decays, so an exponent of 0 does not mean a regular "
                "motion"
            )


def _length(value: Any, what: str) -> float:
    """Return a positive and finite length of time."""
    found = arguments.number(value, what)
    if not 0.0 < found < math.inf:
        raise cannot_be(what, value, "use a positive length of time")
    return found
