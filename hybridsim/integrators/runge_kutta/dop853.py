"""This module defines the method of order 8 by Dormand and Prince."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hybridsim.integrators.runge_kutta.dop853_coefficients import E3, E5, A, B, C
from hybridsim.integrators.runge_kutta.method import RungeKuttaIntegrator, Tableau


@dataclass(frozen=True)
class Dop853(RungeKuttaIntegrator):
    """Dormand and Prince's method of order 8(5,3) in a compiled loop, with event location by hybridsim.

    It is the method of `scipy-dop853` at about a hundredth of the cost. The dense output is the two-point
    Hermite polynomial of degree 7 on Taylor coefficients; a step that contains an event is repeated up to it.

    When to choose it: smooth modes that are not stiff, from 1e-4 to 1e-13.
    """

    name: ClassVar[str] = "dop853"
    title: ClassVar[str] = "compiled DOP853 with events located on its dense output"
    order: ClassVar[str] = "8(5,3)"
    reference: ClassVar[str] = "Hairer, Norsett and Wanner 1993, doi:10.1007/978-3-540-78862-1, section II.10"
    when: ClassVar[str] = "smooth modes, not stiff; down to 1e-10"
    tableau: ClassVar[Tableau] = Tableau(c=C, a=A, b=B, e=E5, e_low=E3, order=8, error_order=8)
