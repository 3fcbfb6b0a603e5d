"""This module defines an unknown of a fit: a parameter or the start of a state, with its bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hybridsim.arguments import cannot_be, flag, number
from hybridsim.errors import UsageError, nearest
from hybridsim.model import Model
from hybridsim.model.parts.remedies import remedy_for_parameter


@dataclass(frozen=True)
class Unknown:
    """A parameter or start value that a fit determines.

    Parameters
    ----------
    low, high : float
        Bounds, in the unit of the parameter or state.
    guess : float, optional
        First value. The default is the value of the model if it lies between the bounds, otherwise their middle.
    log : bool, optional
        Whether the fit varies the logarithm; both bounds are then positive and finite. It suits a quantity whose order
        of magnitude is unknown, such as a stiffness.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Unknown(1e3, 1e7, log=True).log
    True
    """

    low: float = -math.inf
    high: float = math.inf
    guess: float | None = None
    log: bool = False

    def __post_init__(self) -> None:
        for name in ("low", "high", *(["guess"] if self.guess is not None else [])):
            object.__setattr__(self, name, number(getattr(self, name), f"`{name}` of an unknown"))
        object.__setattr__(self, "log", flag(self.log, "log"))
        if not self.low < self.high:
            raise UsageError(
                f"the bounds of an unknown are low = {self.low!r} and high = {self.high!r}",
                remedy="use a lower bound below the upper bound",
            )
        if self.guess is not None and not self.low <= self.guess <= self.high:
            raise UsageError(
                f"the guess {self.guess!r} is outside the bounds {self.low!r} and {self.high!r}",
                remedy="use a guess between the bounds",
            )
        if self.log and not (self.low > 0.0 and math.isfinite(self.high)):
            raise UsageError(
                f"an unknown with log=True has the bounds {self.low!r} and {self.high!r}",
                remedy="use positive, finite bounds",
            )

    @property
    def is_bounded(self) -> bool:
        """Whether both bounds are finite."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    @property
    def coordinate_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the coordinate."""
        return self.coordinate(self.low), self.coordinate(self.high)

    def coordinate(self, value: float) -> float:
        """Return the coordinate that the fit varies: the value or its logarithm."""
        return math.log(value) if self.log else value

    def value(self, coordinate: float) -> float:
        """Return the value of the unknown from its coordinate, within the bounds."""
        found = math.exp(coordinate) if self.log else float(coordinate)
        return min(max(found, self.low), self.high)


def start_of(state: str) -> str:
    """Return the name under which a fit varies the start of a state, such as "x(0)"."""
    return f"{state}(0)"


def unknowns_of(model: Model, unknowns: Any) -> dict[str, Unknown]:
    """Return the unknowns by name, each with a guess; a pair of numbers is a lower and an upper bound."""
    if not isinstance(unknowns, Mapping) or not unknowns:
        raise cannot_be(
            "unknowns", unknowns, "use a dict of names and bounds, such as {'mu': (0.1, 0.6), 'x(0)': (0, 1)}"
        )
    current = model.parameter_values() | {start_of(s): v for s, v in model.start_values().items()}
    found = {}
    for name, declared in unknowns.items():
        if name not in current:
            raise UsageError(
                f"`unknowns` contains {name!r}, which is not a parameter or start value of model {model.name}",
                remedy=remedy_for_parameter(model, str(name))
                if not str(name).endswith("(0)")
                else nearest(str(name), current, kind="start values"),
            )
        unknown = _unknown(name, declared)
        guess = unknown.guess
        if guess is None:
            guess = current[name]
        if not unknown.low <= guess <= unknown.high:
            if not unknown.is_bounded:
                raise UsageError(
                    f"the value {guess!r} of {name} in the model is outside the bounds {unknown.low!r} and "
                    f"{unknown.high!r}",
                    remedy=f"use hs.Unknown({unknown.low!r}, {unknown.high!r}, guess=...)",
                )
            guess = unknown.value(0.5 * sum(unknown.coordinate_bounds))
        found[str(name)] = Unknown(unknown.low, unknown.high, guess, unknown.log)
    return found


def _unknown(name: Any, declared: Any) -> Unknown:
    if isinstance(declared, Unknown):
        return declared
    remedy = f"use (low, high), or hs.Unknown(low, high, guess=...) for {name}"
    try:
        low, high = declared
    except (TypeError, ValueError):
        raise cannot_be("unknowns", declared, remedy) from None
    return Unknown(
        number(low, f"lower bound of {name}", remedy), number(high, f"upper bound of {name}", remedy)
    )
