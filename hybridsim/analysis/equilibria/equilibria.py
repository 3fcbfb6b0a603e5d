"""This module finds all equilibria and steady sliding motions of a model, including sets of equilibria."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.equilibria.field import INSIDE, Field, is_driven
from hybridsim.analysis.equilibria.linearize import equilibrium_near
from hybridsim.calls import refusing
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, in_numbers

_MAX_COMBINATIONS = 4096  # combinations of modes that are tried
_ROUNDS = 30
_SETTLED = 1e-14


@dataclass(frozen=True)
class Equilibrium(Readable):
    """An equilibrium in one combination of modes: a single point, or a set of points if bodies stick.

    Parameters
    ----------
    modes : dict of str to str
        The mode of each component.
    x : array
        (n,) states at the point, or in the middle of the set.
    low, high : array
        (n,) least and greatest value of each state over the set; infinite if no guard bounds it.
    growth : float
        Largest real part of the eigenvalues for the free states; 0 along a set.

    Examples
    --------
    >>> import hybridsim as hs
    >>> (stuck,) = hs.equilibria("free-decay")
    >>> stuck.is_point, stuck.low.tolist(), stuck.high.tolist()
    (False, [-1.0, 0.0], [1.0, 0.0])
    """

    modes: dict[str, str]
    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    growth: float

    def __repr__(self) -> str:
        modes = ", ".join(f"{name} {mode}" for name, mode in self.modes.items()) or "no components"
        lines = [f"Equilibrium ({modes}), largest growth {self.growth:.6g}"]
        if self.is_point:
            return "\n".join([*lines, f"  x = {in_numbers(self.x)}"])
        return "\n".join([*lines, f"  x from {in_numbers(self.low)} to {in_numbers(self.high)}"])

    @property
    def is_point(self) -> bool:
        """Whether the equilibrium is a single point."""
        return bool((self.low == self.high).all())


@refusing
def equilibria(
    model: Model | str | PathLike[str], *, params: Mapping[str, Any] | None = None
) -> tuple[Equilibrium, ...]:
    """Find the equilibria and steady sliding motions of an unforced model, in all admissible combinations of modes.

    In each combination of modes Newton's method finds a point with zero rates; points that violate a guard
    are left out. If contacts stick, the points form a set. Linear programs then give the least and greatest
    value of each state over it; they are repeated about their solutions if the model is nonlinear. For a
    nonlinear model the search starts at the model's start values and can miss other equilibria.

    Parameters
    ----------
    model : str, path or Model
        As in `simulate`.
    params : mapping of str to str or float, optional
        Parameter values that replace the declared ones.

    Returns
    -------
    tuple of Equilibrium
        One for each combination of modes. Of a point on a corner of the rates, `growth` is the larger of both sides.

    Raises
    ------
    UsageError
        For a model that is forced in time, or has too many combinations of modes.

    Examples
    --------
    >>> import hybridsim as hs
    >>> (stuck,) = hs.equilibria("free-decay")
    >>> stuck.modes
    {'f': 'stick'}
    """
    model = arguments.chosen_model(model, params)
    system = system_of(model)
    if model.schedules:
        raise UsageError(
            f"schedule {model.schedules[0].name} changes model {model.name} over time, so there "
            "is no equilibrium",
            remedy="use hs.steady_state",
        )
    if is_driven(system):
        raise UsageError(
            f"model {model.name} has forcing that varies with time, so there is no equilibrium",
            remedy="use hs.steady_state for a periodic forcing, hs.linearize to freeze the forcing at one time, or "
            "give the model the final value of the forcing as a constant",
        )
    count = int(np.prod([len(a.modes) for a in system.automata]))
    if count > _MAX_COMBINATIONS:
        raise UsageError(
            f"model {model.name} has {count} combinations of modes; at most {_MAX_COMBINATIONS} are tried",
            remedy="choose the modes yourself with hs.linearize(model, mode)",
        )
    found: list[Equilibrium] = []
    for numbers in product(*(range(len(a.modes)) for a in system.automata)):
        field = Field(system, np.array(numbers, dtype=np.int64))
        equilibrium = _in_modes(field)
        if equilibrium is not None:
            _add(found, equilibrium, INSIDE * field.sizes(equilibrium.x))
    return tuple(found)


def _add(found: list[Equilibrium], new: Equilibrium, rounding: np.ndarray) -> None:
    """Add an equilibrium; one on a corner is stored once, with the larger growth rate of the two sides."""
    for i, old in enumerate(found):
        is_same = old.is_point and new.is_point and old.modes == new.modes
        if is_same and (np.abs(old.x - new.x) <= rounding).all():
            found[i] = max(old, new, key=lambda one: one.growth)
            return
    found.append(new)


def _in_modes(field: Field) -> Equilibrium | None:
    system, free = field.system, field.free
    try:
        x = equilibrium_near(field, system.start_state({}))
    except SimulationError:
        return None
    _, A, _, _ = field(x)
    rank = np.linalg.matrix_rank(_scaled(A[:, free])) if free else 0
    if rank < len(free):
        bounds = _extent(field, x)
        if bounds is None:
            return None
        low, high = bounds
        bounded = np.isfinite(low) & np.isfinite(high)
        middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), x)
        x = _nearest_inside(field, middle, x)
    else:
        low = high = x
    _, A, g, G = field(x)
    rounding = INSIDE * (np.abs(G) @ field.sizes(x))
    # slip at zero velocity is a limit of stick
    slips = np.array([a.has_surface and z != a.hold for a, z in zip(system.automata, field.z, strict=True)])
    if (g <= np.where(slips[system.owner[field.guards]], rounding, -rounding)).any():
        return None
    growth = float(np.linalg.eigvals(A[np.ix_(free, free)]).real.max(initial=-np.inf))
    names = system.mode_names(field.z)
    declared = {a.name: names[a.name] for a in system.declared}
    return Equilibrium(declared, x, low, high, growth)


def _scaled(A: np.ndarray) -> np.ndarray:
    """Scale rows and columns of a matrix to about unit size, so that its numerical rank is meaningful."""
    rows = np.abs(A).max(axis=1, initial=0.0)
    A = A / np.where(rows > 0.0, rows, 1.0)[:, None]
    columns = np.abs(A).max(axis=0, initial=0.0)
    return A / np.where(columns > 0.0, columns, 1.0)


def _extent(field: Field, x: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the range of each state over the equilibria around x, or None if the guards exclude all of them."""
    n = len(x)
    low, high = np.empty(n), np.empty(n)
    for i in range(n):
        for side, bound in ((1.0, low), (-1.0, high)):
            at = _farthest(field, x, i, side)
            if at is None:
                return None
            bound[i] = at
    return low, high


def _farthest(field: Field, x: np.ndarray, i: int, side: float) -> float | None:
    """Return the extreme value of state i, least (side 1) or greatest (side -1), by a sequence of linear programs."""
    at = x
    for _ in range(_ROUNDS):
        solved = _program(field, at, i, side)
        if solved is None:
            return None
        status, found = solved
        if status == "unbounded":
            return -side * np.inf
        if np.abs(found - at).max() <= _SETTLED * max(np.abs(found).max(), np.finfo(float).tiny):
            return float(found[i])
        at = found
    return float(at[i])


def _program(field: Field, at: np.ndarray, i: int, side: float) -> tuple[str, np.ndarray] | None:
    """Minimise side*x_i subject to f + f_x (x - at) = 0 and g + g_x (x - at) >= 0."""
    from scipy.optimize import linprog

    f, A, g, G = field(at)
    n = len(at)
    held = field.projected(at)
    rows, right = [A], [A @ at - f]
    if field.held:  # the constraint values of held states
        slopes = np.array([(field.projected(at + d) - held) for d in np.eye(n)]).T
        rows.append((np.eye(n) - slopes)[field.held])
        right.append((held - slopes @ at)[field.held])
    equal, value = np.concatenate(rows), np.concatenate(right)
    used = np.abs(equal).max(axis=1) > 0.0
    cost = np.zeros(n)
    cost[i] = side
    found = linprog(
        cost,
        A_ub=-G if len(g) else None,
        b_ub=g - G @ at if len(g) else None,
        A_eq=equal[used] if used.any() else None,
        b_eq=value[used] if used.any() else None,
        bounds=(None, None),
        method="highs",
    )
    if found.status == 3:
        return "unbounded", at
    return ("found", field.projected(found.x)) if found.success else None


def _nearest_inside(field: Field, middle: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return an equilibrium near the middle of the set of equilibria."""
    try:
        return equilibrium_near(field, middle)
    except SimulationError:
        return x
