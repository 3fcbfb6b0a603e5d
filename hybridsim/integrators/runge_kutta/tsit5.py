"""This module defines the method of order 5(4) by Tsitouras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.integrators.runge_kutta.method import RungeKuttaIntegrator, Tableau

_C = np.array([0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0])
_A = np.zeros((7, 7))
_A[1, :1] = 0.161
_A[2, :2] = -0.008480655492356989, 0.335480655492357
_A[3, :3] = 2.8971530571054935, -6.359448489975075, 4.3622954328695815
_A[4, :4] = 5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525
_A[5, :5] = 5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383
_A[6, :6] = (
    0.09646076681806523,
    0.01,
    0.4798896504144996,
    1.379008574103742,
    -3.290069515436081,
    2.324710524099774,
)
# weights of order 5 minus those of order 4
_E = np.array(
    [
        -0.00178001105222577714,
        -0.0008164344596567469,
        0.007880878010261995,
        -0.1447110071732629,
        0.5823571654525552,
        -0.45808210592918697,
        1 / 66,
    ]
)


@dataclass(frozen=True)
class Tsit5(RungeKuttaIntegrator):
    """Tsitouras' pair of order 5(4) in a compiled loop, with event location by hybridsim.

    It has seven stages. The last one is at the end of the step, with the weights of order 5. The dense output
    is the two-point Hermite polynomial of degree 7 on Taylor coefficients; a step that contains an event is
    repeated up to it.

    When to choose it: tolerances of 1e-3 to 1e-6, smooth modes that are not stiff; below 1e-6 `dop853` is
    faster.
    """

    name: ClassVar[str] = "tsit5"
    title: ClassVar[str] = "compiled Tsitouras 5(4) with events located on its dense output"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Tsitouras 2011, doi:10.1016/j.camwa.2011.06.002"
    when: ClassVar[str] = "loose tolerances: smooth modes, not stiff"
    tableau: ClassVar[Tableau] = Tableau(c=_C, a=_A, b=_A[6], e=_E, order=5, error_order=5)
