"""This module linearises a model about a point in one combination of modes, and computes the eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.equilibria.field import Field, is_driven, modes_of
from hybridsim.analysis.equilibria.zero_loads import zero_loads
from hybridsim.calls import refusing
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, in_numbers

_STEPS = 50
_DUST = 1e-10  # of the largest state: a smaller state may be rounding
_CLOSED = 1e-13  # of the terms of a rate: a smaller rate is zero to rounding
_HALVINGS = 20
_ALIKE = 1e-9  # of the terms of a rate: Jacobians that differ by less are equal


@dataclass(frozen=True)
class Linearization(Readable):
    """The linear system d' = A d for small changes d of the free states about x, in one combination of modes.

    Parameters
    ----------
    states : tuple of str
        Names of the m free states; states that the modes hold on a constraint are not among them.
    A : array
        Shape (m, m), the Jacobian.
    x : array
        (n,) all states of the model at the point.
    is_equilibrium : bool
        Whether all rates vanish there.
    admissible : bool
        Whether the modes can hold there: all their guards are >= 0.
    warnings : tuple of str
        Reasons to doubt the result, such as a normal load that is 0, or small, at the time of the linearization.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sliding = hs.linearize("belt", "slip-")
    >>> sliding.states, sliding.A.shape, sliding.stable
    (('x', 'v'), (2, 2), False)
    """

    states: tuple[str, ...]
    A: np.ndarray
    x: np.ndarray
    is_equilibrium: bool
    admissible: bool
    warnings: tuple[str, ...] = ()

    def plot(self) -> Any:
        """Draw the eigenvalues in the complex plane, in rad per unit of t; see `hybridsim.plot.eigenvalues`.

        It returns the axes; ``hybridsim.plot.save`` writes them to a file.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").eigenvalues(self)

    def __repr__(self) -> str:
        remarks = [] if self.is_equilibrium else ["not an equilibrium"]
        remarks += [] if self.admissible else ["the modes do not last at this point"]
        return "\n".join(
            [
                ", ".join([f"Linearization: {'stable' if self.stable else 'not stable'}", *remarks]),
                f"  about x = {in_numbers(self.x)}; free states {', '.join(self.states) or 'none'}",
                f"  eigenvalues {in_numbers(self.eigenvalues)}",
                *(f"  warning: {text}" for text in self.warnings),
            ]
        )

    @cached_property
    def _modes(self) -> tuple[np.ndarray, np.ndarray]:
        values, vectors = np.linalg.eig(self.A)
        order = np.lexsort((-values.imag, -values.real))
        return values[order].astype(complex), vectors[:, order].astype(complex)

    @property
    def eigenvalues(self) -> np.ndarray:
        """Complex eigenvalues (m,), in order of falling real part."""
        return self._modes[0]

    @property
    def eigenvectors(self) -> np.ndarray:
        """Right eigenvectors in columns (m, m), in the order of the eigenvalues."""
        return self._modes[1]

    @property
    def growth(self) -> float:
        """Largest real part of the eigenvalues: if positive, small motions grow, as in squeal."""
        return float(self.eigenvalues.real.max(initial=-np.inf))

    @property
    def stable(self) -> bool:
        """Whether all small motions decay."""
        return self.growth < 0.0

    @property
    def frequencies(self) -> np.ndarray:
        """Angular frequencies of the oscillating pairs, in the order of the eigenvalues."""
        return self.eigenvalues.imag[self.eigenvalues.imag > 0.0]

    @property
    def damping_ratios(self) -> np.ndarray:
        """Damping ratio ``-Re/|lambda|`` of each oscillating pair; negative for growing motions."""
        pairs = self.eigenvalues[self.eigenvalues.imag > 0.0]
        return -pairs.real / np.abs(pairs)


@refusing
def linearize(
    model: Model | str | PathLike[str],
    mode: Mapping[str, str] | str | None = None,
    *,
    params: Mapping[str, Any] | None = None,
    at: Mapping[str, float] | Sequence[float] | None = None,
    t: float = 0.0,
) -> Linearization:
    """Linearise a model about a point in one combination of modes, and compute the eigenvalues.

    The Jacobian is exact to rounding, because the expressions are differentiated. At corners (`abs`, `min`,
    `max`, conditionals, pieces of a table) and jumps of a rate, the side on which the point lies is used. A
    point exactly on one of them is refused if the sides differ. Over a parameter in `hs.sweep`, the function
    finds the onset of a friction-induced instability, where the growth of steady sliding passes zero.

    Parameters
    ----------
    model : str, path or Model
        As in `simulate`.
    mode : mapping of str to str, or str, optional
        The mode of each component by name, such as {"f": "slip+"}; a string if there is one component.
    params : mapping of str to str or float, optional
        Parameter values that replace the declared ones.
    at : mapping of str to float or sequence of float, optional
        The states, as x0 of `simulate`. By default the equilibrium that Newton's method finds from the
        model's start; for a model that is forced in time, the start itself.
    t : float, optional
        The time at which a forced model is frozen.

    Returns
    -------
    Linearization
        The linear system.

    Raises
    ------
    UsageError
        For modes or states that the model does not have, or a point on a corner.
    SimulationError
        If no equilibrium is found.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sliding = hs.linearize("belt", "slip-")
    >>> sliding.stable, float(round(sliding.eigenvalues[0].real, 3))  # friction falls with speed
    (False, 0.586)
    """
    model = arguments.chosen_model(model, params)
    system = system_of(model)
    start, _ = arguments.start_values(model, at, "at")
    x = system.start_state(start)
    z, by_state = modes_of(system, mode)
    field = Field(system, z, arguments.number(t, "t"), by_state).at_sides(x)
    if at is None and not is_driven(system):
        x = equilibrium_near(field, x)
    x = field.projected(x)
    field = field.at_sides(x)
    f, A, g, _ = field(x)
    free = field.free
    _refuse_borders(field, x, A)
    return Linearization(
        tuple(system.names[i] for i in free),
        A[np.ix_(free, free)],
        x,
        bool((np.abs(f) <= _CLOSED * _terms(A, field.sizes(x))).all()),
        bool((g >= 0.0).all()),
        zero_loads(system, field.t, x),
    )


def _refuse_borders(field: Field, x: np.ndarray, A: np.ndarray) -> None:
    """Reject a point on a corner or a jump at which the rates or the Jacobians of the two sides differ."""
    system = field.system
    rates = field(x)[0]
    scale = field.sizes(x)
    bound = _CLOSED * _terms(A, scale)
    for c, mode in field.borders(x):
        z = field.z.copy()
        z[c] = mode
        across = Field(system, z, field.t, field.by_state)
        f, other, *_ = across(x)
        free = across.free
        gap = np.abs(other - A) @ scale
        if free == field.free and (gap <= _ALIKE * bound / _CLOSED).all() and (abs(f - rates) <= bound).all():
            continue
        raise UsageError(
            f"the point lies on the corner {system.automata[c].name}: the linearizations on its two sides "
            "differ",
            remedy="pass a point on one side of the corner as `at`",
        )


def equilibrium_near(field: Field, x: np.ndarray) -> np.ndarray:
    """Return an equilibrium near x by Newton's method; the equilibria may form a continuum."""
    x = field.projected(x)
    field = field.at_sides(x)
    f, A, *_ = field(x)
    for _ in range(_STEPS):
        columns = A[:, field.free]
        scale = np.abs(columns).max(axis=1, initial=0.0)
        scale[scale == 0.0] = 1.0
        move = np.zeros(len(x))
        move[field.free] = np.linalg.lstsq(columns / scale[:, None], -f / scale, rcond=None)[0]
        for _ in range(_HALVINGS):
            trial = field.projected(x + move)
            there = field.at_sides(trial)
            found = there(trial)
            if np.abs(found[0] / scale).sum() < np.abs(f / scale).sum():
                break
            move *= 0.5
        else:
            break  # converged to rounding, or diverged
        field, x, f, A = there, trial, found[0], found[1]
    x, f, A = _without_dust(field, x, f, A)
    if (np.abs(f) <= _CLOSED * _terms(A, field.sizes(x))).all():
        return x
    modes = ", ".join(f"{c}: {m}" for c, m in field.system.mode_names(field.z).items())
    raise SimulationError(
        f"no equilibrium of model {field.system.model.name} was found from its initial state"
        + (f", in the modes {modes}" if modes else ""),
        remedy="use initial values closer to an equilibrium, declare nominal values, or set `at` to the "
        "point of the linearization",
    )


def _without_dust(
    field: Field, x: np.ndarray, f: np.ndarray, A: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Set states that are zero within rounding to zero, unless this change increases the rates."""
    scale = np.abs(A).max(axis=1, initial=0.0)
    scale[scale == 0.0] = 1.0
    for j in field.free:
        if 0.0 < abs(x[j]) <= _DUST * np.abs(x).max():
            trial = x.copy()
            trial[j] = 0.0
            found = field(field.projected(trial))
            if np.abs(found[0] / scale).sum() <= np.abs(f / scale).sum():
                x, f, A = field.projected(trial), found[0], found[1]
    return x, f, A


def _terms(A: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the sum of the absolute values of the terms of each rate."""
    return np.abs(A) @ sizes + np.finfo(float).tiny
