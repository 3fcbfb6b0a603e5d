"""Figures 3, 12 and 13: the motion and the friction force over two periods, and the harmonics of the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.analysis.study.pool import Pool
from hybridsim.analysis.study.settings import LITERAL, SIGNS, ZEROED, Point, Size, Variant
from hybridsim.analysis.study.steady import CONTACT, settling_periods, solve_by_steps
from hybridsim.analysis.study.verdicts import Claim, Verdict
from hybridsim.simulate import simulate

FIGURE_3 = Point(0.6, 30.0 / 40.0)
FIGURE_12 = Point(0.55, 0.54)
FIGURE_13 = Point(1.0, 0.80)
RUNS: tuple[Variant, ...] = (*SIGNS, LITERAL, ZEROED)
EXACT = "exact"

_SHOWN = 2  # periods drawn
_HARMONIC_PERIODS = 16  # the spectrum tells fractions of w down to 1/16
_SAMPLES = 4096  # a period; the 25th harmonic of a smooth-by-parts motion is good to 1e-6 of the first
_HIGHEST = 15
_SIGNIFICANT = 0.01  # a harmonic of x of that share of the first is called significant
_NOTHING = 1e-3  # and of that share is called none: the paper's own criterion of convergence


@dataclass(frozen=True)
class Response:
    """Displacement and friction force over the shown periods, and what the last sixteen say of the spectrum.

    harmonics : |c_k|/|c_1| of x for k = 0, 1, 2, ...
    between : the largest line between whole multiples of w, over |c_1|.
    repeats : the largest change of x from one period to the next, over its amplitude.
    """

    t: np.ndarray
    x: np.ndarray
    f: np.ndarray
    harmonics: np.ndarray
    between: float
    repeats: float
    jumps: (
        float  # jumps of the friction force between its limits, per period, beyond the two of a free reversal
    )


def responses(point: Point, size: Size, pool: Pool) -> dict[str, Response]:
    """The motion at a point by every method."""
    names = [EXACT, *(v.name for v in RUNS)]
    runs = (None, *RUNS)
    return dict(zip(names, pool.map(lambda v: _response(point, v, size), runs), strict=True))


def _response(point: Point, variant: Variant | None, size: Size) -> Response:
    kept = _HARMONIC_PERIODS
    if variant is None:
        periods = settling_periods(point) + kept
        solution = simulate(
            "dfcs",
            (0.0, periods * point.period),
            params=point.params,
            integrator="exact",
            save=kept * point.period,
        )
    else:
        periods = size.periods
        solution = solve_by_steps(point, variant, periods, kept)
    start = (periods - kept) * point.period
    times = start + point.period * np.arange(kept * _SAMPLES) / _SAMPLES
    x = solution(np.clip(times, solution.t_start, solution.t_end))[0]
    amplitude = 0.5 * (x.max() - x.min())
    lines = np.abs(np.fft.rfft(x)) / abs(np.fft.rfft(x)[kept])
    whole = lines[: (_HIGHEST + 1) * kept : kept]
    rest = np.delete(lines[: _HIGHEST * kept], np.arange(0, _HIGHEST * kept, kept))
    folded = x.reshape(kept, _SAMPLES)
    shown = times[-_SHOWN * _SAMPLES :: 4]
    reversals = sum(
        {e.source, e.target} == {"slip+", "slip-"} for e in solution.events if e.component == CONTACT
    )
    return Response(
        t=(shown - shown[0]) / point.period,
        x=x[-_SHOWN * _SAMPLES :: 4],
        f=solution.output("f", shown),
        harmonics=whole,
        between=float(rest.max()),
        repeats=float(np.abs(np.diff(folded, axis=0)).max() / amplitude),
        jumps=reversals / kept,
    )


def claim_figure_3(runs: dict[str, Response]) -> Claim:
    """Periodic with the forcing's period, odd harmonics only, high ones significant."""
    ours = {name: _spectrum(run) for name, run in runs.items() if name != EXACT}
    exact = _spectrum(runs[EXACT])
    keeps = [name for name, row in ours.items() if row["holds"]]
    verdict = Verdict.REPRODUCED if exact["holds"] and keeps else Verdict.NOT
    third, fifth = exact["third"], exact["fifth"]
    why = (
        f"The exact motion repeats with the forcing's period, its even harmonics are below {exact['even']:.0e} and its "
        f"third and fifth are {100 * third:.1f} % and {100 * fifth:.1f} % of the first; "
        f"{len(keeps)} of the {len(ours)} readings of the method show the same to 0.1 %."
    )
    return Claim(
        "figure 3",
        "3",
        "periodic with the forcing's period; only odd harmonics of w; high harmonics are significant",
        {"period": "T", "harmonics": "odd", "high harmonics": "significant"},
        ours,
        min(ours, key=lambda name: ours[name]["even"] + ours[name]["between"]),
        exact,
        verdict,
        why,
    )


def _spectrum(run: Response) -> dict[str, float | bool]:
    even = float(run.harmonics[2::2].max())
    third, fifth = float(run.harmonics[3]), float(run.harmonics[5])
    clean = max(even, run.between) <= _NOTHING
    return {
        "repeats": run.repeats,
        "even": even,
        "between": run.between,
        "third": third,
        "fifth": fifth,
        "holds": bool(clean and third >= _SIGNIFICANT),
    }
