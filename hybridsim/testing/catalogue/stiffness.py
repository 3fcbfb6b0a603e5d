"""This module contains test cases of stiffness, such as regularized friction, and smooth ones for comparison."""

from __future__ import annotations

import math
from itertools import pairwise

from scipy.integrate import quad

from hybridsim.testing.facts import CASES, recomputed
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases without events; one of them is stiff."""
    stiff = CASES["TANH"]["expected"]["eps_1e_6"]
    return (
        Scene("FMI-vdp", "vdp", (0.0, 20.0), Truth((), recomputed("FMI-vdp")[1]), unit=6.66, speed=3.0),
        Scene(
            "TANH-1e-3",
            "tanh",
            (0.0, 20.0),
            Truth((), recomputed("TANH-1e-3")[1]),
            params={"eps": 1e-3},
            unit=6.28,
            speed=10.0,
            tol_x=1e-7,
        ),
        Scene(
            "TANH-1e-6",
            "tanh",
            (0.0, 20.0),
            Truth((), ((5.0, tuple(stiff["5"])), (20.0, (stiff["20"], None)))),
            needs("stiff"),
            params={"eps": 1e-6},
            unit=6.28,
            speed=10.0,
            tol_x=1e-7,
            floor=1e-9,
        ),
        _decades(),
        _neuron(),
    )


def _neuron() -> Scene:
    """Return the test case of a neuron, whose interval between spikes is the integral of dV/V'."""

    def time_per_volt(V: float) -> float:
        return 281.0 / (30.0 * 2.0 * math.exp((V + 50.4) / 2.0) + 1000.0 - 30.0 * (V + 70.6))

    marks = (-70.6, -60.0, -52.0, -48.0, -44.0, -40.0, -30.0, -15.0, 0.0)
    period = sum(quad(time_per_volt, a, b, epsrel=1e-13, epsabs=0.0)[0] for a, b in pairwise(marks))
    spikes = tuple((k * period, "c:charging") for k in (1, 2))
    return Scene(
        "exponential-neuron",
        "neuron",
        (0.0, 2.5 * period),
        Truth(spikes, ()),
        needs("transitions", "adaptive", "nonlinear", "poles"),  # no fixed step leads into a pole
        unit=period,
        tol_t=1e-6 / period,
    )


def _decades() -> Scene:
    """Return the test case of two decays whose half-lives ln(2)/1e8 and ln(2) differ by eight decades."""
    early, late = math.log(2) * 1e-8, math.log(2)
    states = (
        (early, (math.exp(-early), 0.5)),
        (late / 2, (math.sqrt(0.5), 0.5)),
        (2.0, (math.exp(-2.0), 0.5)),
    )
    return Scene(
        "eight-decades",
        "decades",
        (0.0, 2.0),
        Truth(((early, "a:held"), (late, "b:low")), states),
        needs("transitions", "adaptive"),  # no fixed step suits both
        tol_t=1e-9,
        tol_x=1e-9,
    )
