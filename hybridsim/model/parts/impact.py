"""This module defines unilateral contacts: a gap, its normal force, and impacts with restitution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hybridsim.expr import Expression, parse
from hybridsim.model.parts.component import Component, Guard, Mode, Surface
from hybridsim.model.parts.declared import Declared

OPEN, CLOSED = "open", "closed"
SPEED = "speed"  # the name of the approach speed in a restitution
# Largest rounding error of a computed restitution outside [0, 1]: a few operations on numbers of size one.
ROUNDING = 8.0 * 2.0**-52


@dataclass(frozen=True)
class Impact(Declared):
    """A unilateral contact; its name is the normal force, which pushes the bodies apart.

    ::

        open   : gap >= 0,                     p = 0
        closed : gap = 0, d(gap)/dt = 0,       p >= 0, computed from d2(gap)/dt2 = 0
        impact : gap = 0, d(gap)/dt < 0,       an impulse P >= 0 changes the states by (d(rates)/dp) P

    By Newton's impact law the separation speed is e times the approach speed. All contacts with zero gap form one
    complementarity problem, 0 <= P, u+ + e u- >= 0, P (u+ + e u-) = 0, with u = d(gap)/dt and u- = 0 if it is positive.
    A frictional contact with the load p takes part with a Coulomb impulse of at most mu P.

    Parameters
    ----------
    name : str
        Name of the normal force p.
    gap : str or float
        Gap function g(t, x) >= 0, a smooth expression of positions: p enters its second derivative but not its first.
        p must do work along the gap: a mass m at height h with gap h has + p/m in its acceleration.
    restitution : str or float
        Coefficient e, from 0 (no rebound) to 1 (no energy loss). It may use ``speed``, the positive approach speed.
    place : Place, optional
        Place of the declaration, for error messages.

    Raises
    ------
    ModelError
        When the model is checked or compiled: for a gap without a state, for a gap whose first derivative contains p,
        and for a constant restitution outside [0, 1].

    Notes
    -----
    Use it for stops, floors and clearances. For other impact laws than Newton's use a `Component` with a guard and a
    reset.

    References
    ----------
    J. J. Moreau, in Nonsmooth Mechanics and Applications (Springer, 1988) 1, doi:10.1007/978-3-7091-2624-0_1.

    C. Glocker, F. Pfeiffer, Nonlinear Dyn. 7 (1995) 471, doi:10.1007/BF00121109.

    Examples
    --------
    >>> [mode.name for mode in Impact("p", gap="h", restitution=0.7).component().modes]
    ['open', 'closed']
    """

    name: str
    gap: Expression
    restitution: Expression

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("gap", "restitution")

    def component(self) -> Component:
        """Return the automaton, with the modes ``open`` and ``closed``."""
        return self._component

    @cached_property
    def _component(self) -> Component:
        force, nothing = parse(self.name, self.place), parse(0)
        modes = (
            Mode(OPEN, (Guard("gap", self.gap),), set={self.name: nothing}),
            Mode(CLOSED, (Guard("force", force),)),
        )
        surface = Surface(
            self.gap, self.name, OPEN, None, CLOSED, nothing, nothing, restitution=self.restitution
        )
        return Component(self.name, modes, surface=surface, place=self.place)
