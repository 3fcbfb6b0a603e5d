"""A unilateral contact: a gap that cannot become negative, the force that sees to it, and impacts with restitution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hybridsim.expr import Expression, parse
from hybridsim.model.component import Component, Guard, Mode, Surface
from hybridsim.model.declared import Declared

OPEN, CLOSED = "open", "closed"
SPEED = "speed"  # what a restitution calls the speed of approach
# How far from [0, 1] rounding may carry a restitution that is computed: some operations on numbers of size one.
ROUNDING = 8.0 * 2.0**-52


@dataclass(frozen=True)
class Impact(Declared):
    """A unilateral contact; its name p is the normal force, which pushes the bodies apart and never pulls.

    ::

        open   : gap >= 0,                     p = 0
        closed : gap = 0, d(gap)/dt = 0,       p >= 0, solved for from d2(gap)/dt2 = 0
        impact : gap = 0, d(gap)/dt < 0,       an impulse P >= 0 changes the states by (d(rates)/dp) P

    Newton's law gives the speed of separation, e times that of approach. All contacts whose gaps are zero take part in
    one complementarity problem, 0 <= P, u+ + e u- >= 0, P (u+ + e u-) = 0 with u = d(gap)/dt, u- counted as zero where
    it is positive; a frictional contact with a load of p takes part with an impulse of Coulomb's law, up to mu P.

    Parameters
    ----------
    name : str
        Of the normal force p.
    gap : str or float
        Gap function g(t, x) >= 0, a smooth expression of positions: p enters its second derivative and not its first. p
        has to do work along the gap, so that a mass m at height h with gap h has + p/m in its acceleration.
    restitution : str or float
        Coefficient e, from 0 (no rebound) to 1 (no loss); it may use the speed of approach, above zero, by the name
        ``speed``.
    place : Place, optional
        Where it is written, for the messages of errors.

    Raises
    ------
    ModelError
        When the model is checked or compiled, for a gap without a state, one whose first derivative has p,
        and for a restitution outside of [0, 1] that is a number.

    Notes
    -----
    For stops, floors, clearances. A `Component` with a guard and a reset is the general form, for rules that
    are not Newton's.

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
        """Its automaton, of the modes ``open`` and ``closed``."""
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
