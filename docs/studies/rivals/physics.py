"""What the rivals are told of a scene: its equations, written once over whatever mathematics a library has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Forces = Callable[[Any, Any], tuple[Any, ...]]


@dataclass(frozen=True)
class Friction:
    """Masses that rub: x_j' = v_j, m_j v_j' = push_j - f_j, with states x_1, v_1, x_2, v_2, ...

    In slip f_j = s_j slip_j(s_j (v_j - belt_j)), s_j = +-1; in stick v_j = belt_j while |push_j| <= limit_j.

    Parameters
    ----------
    x0 : initial states.
    masses, belts, limits : one of each mass.
    push : of a module with sin, exp, ... makes the function (t, x) -> forces on the masses, without friction.
    slip : of such a module makes the function (speeds,) -> friction forces in slip; None for the limits.
    """

    x0: tuple[float, ...]
    masses: tuple[float, ...]
    belts: tuple[float, ...]
    limits: tuple[float, ...]
    push: Callable[[Any], Forces]
    slip: Callable[[Any], Callable[[Any], tuple[Any, ...]]] | None = None

    @property
    def contacts(self) -> int:
        """Number of masses, each with a contact."""
        return len(self.masses)

    def slipping(self, m: Any) -> Callable[[Any], tuple[Any, ...]]:
        """Friction forces in slip at some speeds."""
        if self.slip is not None:
            return self.slip(m)
        limits = self.limits
        return lambda speeds: limits


@dataclass(frozen=True)
class Impact:
    """x' = v, v' = acceleration(t, (x, v)), and v -> -restitution v where x reaches the wall from below."""

    x0: tuple[float, ...]
    acceleration: Callable[[Any], Callable[[Any, Any], Any]]
    wall: float
    restitution: float


@dataclass(frozen=True)
class Oscillator:
    """The numbers of m x'' + c x' + k x + f = F0 sin(omega t), |f| <= limit, for those who know its solution."""

    m: float
    c: float
    k: float
    limit: float
    F0: float
    omega: float
