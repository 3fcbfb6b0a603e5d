"""This module reproduces figures 8 and 9: whether the results depend on r and F0/N only."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from hybridsim.reference.closed_forms.den_hartog import linear_amplitude
from hybridsim.simulate import simulate
from hybridsim.studies.he2026.measured import settings as paper
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.steady import ExactState, by_steps, declared, exact, measured
from hybridsim.studies.he2026.measured.verdicts import Claim, Verdict

R = 0.6
RATIOS = (0.6, 0.8, 1.0, 1.2, 1.5)
# N; no two are in the ratio of a power of two, because then all roundings, and the chatter, would be equal
FORCES = (3.0, 7.0, 15.0, 30.0, 50.0, 90.0, 170.0, 400.0)
# The paper's own example has F0 = 30 N, and it does not state its range. These are plausible limits.
_USUAL = (15.0, 170.0)
METHODS: tuple[paper.Variant, ...] = (*paper.SIGNS, paper.LITERAL, paper.ZEROED)
EXACT, STRIBECK = "exact", "Stribeck law"
# rest holds up to F0/N = 0.6 there; the decay is to 3e-6
STRIBECK_RATIOS, _STRIBECK_PERIODS = ((0.8, 1.2), 60)
_CONSTANT = 0.01  # relative variation that looks constant in a picture
_ROUNDING = 1e-10  # rounding over a few hundred periods
# Steady motions over the whole plane for the test to rounding: a lattice that repeats no value.
_SAMPLES = 40
_SCALES = (40.0, 7.3, 1234.5)  # N


@dataclass(frozen=True)
class Reduction:
    """A/A0 and E/E0 by method over ratios F0/N (rows) and forces F0 (columns), and deviations from scaling.

    rounding : largest relative difference of A, E and stick fraction between scales, over points of the plane.
    """

    A: dict[str, np.ndarray]
    E: dict[str, np.ndarray]
    rounding: dict[str, float]

    def spread(self, method: str, quantity: str = "A", usual: bool = False) -> np.ndarray:
        """Return the range (max - min)/mean of the values over the forces, for each ratio F0/N."""
        table = (self.A if quantity == "A" else self.E)[method]
        if usual:
            table = table[:, [_USUAL[0] <= force <= _USUAL[1] for force in FORCES]]
        return np.asarray((table.max(axis=1) - table.min(axis=1)) / table.mean(axis=1))


def free_amplitude(point: paper.Point) -> float:
    """Return A0, the steady amplitude without friction, in metres."""
    return point.force / paper.STIFFNESS * linear_amplitude(point.r, paper.DAMPING_RATIO)


def free_energy(point: paper.Point) -> float:
    """Return E0, the integral of x^2 over a period without friction."""
    return 0.5 * point.period * free_amplitude(point) ** 2


def reduction(size: paper.Size, pool: Pool) -> Reduction:
    """Run all methods at several forces F0 with the same ratio F0/N."""
    points = [paper.Point(R, ratio, force / ratio) for ratio in RATIOS for force in FORCES]
    shape = (len(RATIOS), len(FORCES))
    tasks = list(itertools.product(METHODS, points))
    found = pool.map(lambda task: by_steps(task[1], task[0], size.periods, size.last), tasks, 0.0, 0.7)
    A0, E0 = (np.array([f(point) for point in points]) for f in (free_amplitude, free_energy))
    A, E = {}, {}
    for k, method in enumerate(METHODS):
        rows = found[k * len(points) : (k + 1) * len(points)]
        A[method.name] = (np.array([row.amplitude for row in rows]) / A0).reshape(shape)
        E[method.name] = (np.array([row.energy for row in rows]) / E0).reshape(shape)
    states = pool.map(exact, points, 0.7, 0.72)
    A[EXACT] = (np.array([s.amplitude for s in states]) / A0).reshape(shape)
    E[EXACT] = (np.array([s.energy for s in states]) / E0).reshape(shape)
    others = [paper.Point(R, ratio, force / ratio) for ratio in STRIBECK_RATIOS for force in FORCES]
    states = pool.map(_stribeck, others, 0.72, 0.95)
    A[STRIBECK] = np.array([s.amplitude / free_amplitude(p) for s, p in zip(states, others, strict=True)])
    E[STRIBECK] = np.array([s.energy / free_energy(p) for s, p in zip(states, others, strict=True)])
    A[STRIBECK], E[STRIBECK] = (table[STRIBECK].reshape(-1, len(FORCES)) for table in (A, E))
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    plane = [
        (0.05 + 1.95 * ((k * golden) % 1.0), 0.51 + 0.99 * (k + 0.5) / _SAMPLES) for k in range(_SAMPLES)
    ]
    scaled = [paper.Point(r, ratio, normal) for r, ratio in plane for normal in _SCALES]
    states = pool.map(exact, scaled, 0.95, 1.0)
    unit = np.array([p.normal for p in scaled]).reshape(_SAMPLES, -1)
    values = {
        "A": np.array([s.amplitude for s in states]).reshape(_SAMPLES, -1) / unit,
        "E": np.array([s.energy for s in states]).reshape(_SAMPLES, -1) / unit**2,
        "stick fraction": np.array([s.stick for s in states]).reshape(_SAMPLES, -1),
    }
    rounding = {
        name: float((np.ptp(table, axis=1) / np.maximum(np.abs(table).max(axis=1), 1e-300)).max())
        for name, table in values.items()
        if name != "stick fraction"
    }
    rounding["stick fraction"] = float(np.ptp(values["stick fraction"], axis=1).max())
    return Reduction(A, E, rounding)


def _stribeck(point: paper.Point) -> ExactState:
    """Return the exact motion with a Stribeck law, whose velocity is an additional scale."""
    solution = simulate(
        declared("dfcs-stribeck"),
        (0.0, _STRIBECK_PERIODS * point.period),
        params=point.params,
        integrator="taylor",
        keep="last-period",
    )
    return measured(solution, point)


def claim(found: Reduction) -> Claim:
    """Judge the claim of figures 8 and 9."""
    ours = {
        name: {
            "spread of A/A0": float(found.spread(name).max()),
            "spread of E/E0": float(found.spread(name, "E").max()),
            f"spread of A/A0, F0 from {_USUAL[0]:g} to {_USUAL[1]:g} N": float(
                found.spread(name, usual=True).max()
            ),
        }
        for name in (m.name for m in METHODS)
    }
    key = f"spread of A/A0, F0 from {_USUAL[0]:g} to {_USUAL[1]:g} N"
    with_, without = (paper.LITERAL.name, paper.ZEROED.name), tuple(v.name for v in paper.SIGNS)
    closest = f"{min(without, key=lambda m: ours[m][key])}; {min(with_, key=lambda m: ours[m][key])}"
    good = [name for name in ours if ours[name][key] <= _CONSTANT]
    both = any(m in good for m in with_) and any(m in good for m in without)
    to_rounding = max(found.rounding.values()) <= _ROUNDING
    verdict = Verdict.REPRODUCED if both and to_rounding else Verdict.SHAPE if to_rounding else Verdict.NOT
    literal, stribeck = ours[paper.LITERAL.name], float(found.spread(STRIBECK).max())
    why = (
        f"With `exact`, A/A0, E/E0 and the stick fraction were computed at {_SAMPLES} points, for three "
        "normal loads at each point. The results for the three loads differ by at most "
        f"{max(found.rounding.values()):.0e}. A/A0, E/E0 and the stick fraction therefore depend only on r "
        "and F0/N. Without stick, A/A0 and E/E0 also depend only on r and F0/N, apart from the chatter. The "
        "reduction "
        'fails if eps_v or a parameter of the law is a velocity in m/s. With eps_v = 8e-4 m/s and "v '
        f'kept", A/A0 varies by {100 * literal["spread of A/A0"]:.2g} % between F0 = {FORCES[0]:g} N and '
        f"{FORCES[-1]:g} N. With a Stribeck law, which contains a velocity, A/A0 varies by "
        f"{100 * stribeck:.2g} %."
    )
    return Claim(
        "figures 8, 9",
        "8, 9",
        "A/A0 and E/E0 depend only on r and F0/N, both with stick and without stick. These quotients do not "
        "depend on F0 and N separately",
        {"spread": "constant"},
        ours,
        closest,
        {
            "spread of A/A0": float(found.spread(EXACT).max()),
            "largest relative difference between loads": found.rounding,
            "Stribeck law: spread of A/A0": stribeck,
        },
        verdict,
        why,
    )
