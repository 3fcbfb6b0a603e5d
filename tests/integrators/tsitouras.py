"""An integrator as a third party would add one: Tsitouras' embedded Runge-Kutta pair of order 5(4)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.runge_kutta import RungeKuttaStepper, Tableau

ROWS = """0.161
-0.008480655492356989 0.335480655492357
2.8971530571054935 -6.359448489975075 4.3622954328695815
5.325864828439257 -11.748883564062828 7.4955393428898365 -0.09249506636175525
5.86145544294642 -12.92096931784711 8.159367898576159 -0.071584973281401 -0.028269050394068383
0.09646076681806523 0.01 0.4798896504144996 1.379008574103742 -3.290069515436081 2.324710524099774"""
ERROR = """-0.00178001105222577714 -0.0008164344596567469 0.007880878010261995 -0.1447110071732629
0.5823571654525552 -0.45808210592918697 0.015151515151515152"""
A = np.zeros((7, 7))
for i, row in enumerate(ROWS.splitlines(), 1):
    A[i, :i] = [float(a) for a in row.split()]
E = np.array([float(e) for e in ERROR.split()])
TABLEAU = Tableau(c=A.sum(axis=1), a=A, b=A[6].copy(), e=E, order=5, error_order=5)


@dataclass(frozen=True)
class Tsitouras(Integrator):
    """Tsitouras' pair of order 5(4) with events located by the engine.

    When to choose it: medium tolerances, smooth modes that are not stiff.
    """

    name: ClassVar[str] = "tsitouras"
    title: ClassVar[str] = "Tsitouras 5(4)"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Tsitouras 2011, doi:10.1016/j.camwa.2011.06.002"
    when: ClassVar[str] = "medium tolerances, smooth modes"
    lacks: ClassVar[dict[str, str]] = {"stiff": "it is explicit: the fastest rate limits its step"}

    def start(self, flow, x0, s_bound, tolerances, first_step, watch):
        """Begin a smooth segment."""
        return RungeKuttaStepper(TABLEAU, flow, x0, s_bound, tolerances, first_step)
