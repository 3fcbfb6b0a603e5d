"""This module reproduces figures 6 and 7: the cost of a smaller velocity interval, and the cost of stick."""

from __future__ import annotations

import gc
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from hybridsim.simulate import simulate
from hybridsim.studies.he2026.measured import settings as paper
from hybridsim.studies.he2026.measured.convergence import CASES
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.steady import declared
from hybridsim.studies.he2026.measured.verdicts import Claim, Verdict

EPS = (8e-4, 1e-4, 1e-5, 1e-6, 1e-7)
WITH = (paper.LITERAL, paper.ZEROED)


@dataclass(frozen=True)
class Cost:
    """Mean run time in seconds, and the number of evaluations of the right-hand side."""

    seconds: float
    evaluations: int


@dataclass(frozen=True)
class RunTimes:
    """Costs of a run by method and case; `by_eps` contains the costs at each velocity interval."""

    by_eps: dict[str, dict[str, tuple[Cost, ...]]]
    by_method: dict[str, dict[str, Cost]]
    periods: int
    repeats: int

    def t_d(self, method: str, case: str) -> list[float]:
        """Return the relative increase of run time (t' - t)/t at each velocity interval, Eq. 7."""
        costs = self.by_eps[method][case]
        return [cost.seconds / costs[0].seconds - 1.0 for cost in costs]

    def t_D(self, with_: str, without: str, case: str) -> float:
        """Return the relative increase of run time (t2 - t1)/t1 due to stick, Eq. 8."""
        return self.by_method[with_][case].seconds / self.by_method[without][case].seconds - 1.0


def run_times(size: paper.Size, pool: Pool) -> RunTimes:
    """Time the runs in rotation on one thread, so that disturbances affect all runs alike."""
    total = 2 * len(CASES)
    by_eps: dict[str, dict[str, tuple[Cost, ...]]] = {v.name: {} for v in WITH}
    methods: tuple[paper.Variant | None, ...] = (*paper.SIGNS, *WITH, None)
    by_method: dict[str, dict[str, Cost]] = {_name(v): {} for v in methods}
    for k, (case, point) in enumerate(CASES.items()):
        pool.tell(2 * k / total)
        costs = _mean(point, [(v, eps) for v in WITH for eps in EPS], size)
        for i, v in enumerate(WITH):
            by_eps[v.name][case] = tuple(costs[i * len(EPS) : (i + 1) * len(EPS)])
        pool.tell((2 * k + 1) / total)
        costs = _mean(point, [(method, paper.EPS_V) for method in methods], size)
        for method, cost in zip(methods, costs, strict=True):
            by_method[_name(method)][case] = cost
    return RunTimes(by_eps, by_method, size.timed_periods, size.repeats)


def _name(variant: paper.Variant | None) -> str:
    return "exact" if variant is None else variant.name


def _mean(
    point: paper.Point, jobs: Sequence[tuple[paper.Variant | None, float]], size: paper.Size
) -> list[Cost]:
    runs: list[list[Cost]] = [[] for _ in jobs]
    collecting = gc.isenabled()
    gc.disable()  # a collection in some of the runs would distort the comparison
    try:
        for _ in range(size.repeats + 1):
            for k, (variant, eps) in enumerate(jobs):
                runs[k].append(_run(point, variant, eps, size.timed_periods))
    finally:
        if collecting:
            gc.enable()
    # the first run of each fills the caches
    return [Cost(fmean(c.seconds for c in row[1:]), row[-1].evaluations) for row in runs]


def _run(point: paper.Point, variant: paper.Variant | None, eps: float, periods: int) -> Cost:
    options: dict[str, Any] = {} if variant is None else dict(variant.options)
    if variant is not None:
        options["steps_per_period"] = float(paper.STEPS_PER_PERIOD)
    if variant in WITH:
        options["eps_v"] = eps
    solution = simulate(
        declared("dfcs"),
        (0.0, periods * point.period),
        params=point.params,
        integrator="exact" if variant is None else variant.integrator,
        keep="last-period",
        **options,
    )
    return Cost(float(solution.stats["wall_time"]), int(solution.stats["rhs_evaluations"]))


def claim_figure_6(times: RunTimes) -> Claim:
    """Judge the claim that the run time grows fast as the velocity interval eps_v becomes smaller."""
    ours: dict[str, dict[str, Any]] = {}
    for v in WITH:
        last = [times.t_d(v.name, case)[-1] for case in CASES]
        evaluations = [
            row[-1].evaluations / row[0].evaluations - 1.0 for row in times.by_eps[v.name].values()
        ]
        ours[v.name] = {
            "t_d at 1e-7, mean": fmean(last),
            "t_d at 1e-7, least and greatest": (min(last), max(last)),
            "more right-hand sides at 1e-7, greatest": max(evaluations),
        }
    closest = max(ours, key=lambda m: ours[m]["t_d at 1e-7, mean"])
    mean, most = ours[closest]["t_d at 1e-7, mean"], ours[closest]["more right-hand sides at 1e-7, greatest"]
    verdict = Verdict.REPRODUCED if mean >= 1.0 else Verdict.SHAPE if mean >= 0.3 else Verdict.NOT
    why = (
        f"If eps_v decreases from 8e-4 to 1e-7, the run time changes by {100 * mean:+.0f} % (mean of "
        f"{len(CASES)} cases). With a smaller eps_v the dichotomy needs a few more halvings of the step at "
        "each of the two reversals per period. The number of evaluations of the right-hand side increases "
        f"by at most {100 * most:.1f} %."
    )
    times_exact = fmean(c.seconds for c in times.by_method["exact"].values())
    return Claim(
        "figure 6",
        "6",
        "the run time increases fast if eps_v decreases, by more than 120 % at eps_v = 1e-7. The claimed "
        "increase hardly depends on r, N and F0",
        {"t_d at 1e-7": 1.20},
        ours,
        closest,
        {"t_d": 0.0, f"milliseconds for {times.periods} periods": 1e3 * times_exact},
        verdict,
        why,
    )


def claim_figure_7(times: RunTimes) -> Claim:
    """Judge the claim that stick increases the run time by more than 225 %."""
    ours: dict[str, dict[str, Any]] = {}
    for with_ in WITH:
        for sign in paper.SIGNS:
            values = {case: times.t_D(with_.name, sign.name, case) for case in CASES}
            ours[f"{with_.name}; {sign.name}"] = {
                "t_D, mean": fmean(values.values()),
                "t_D": values,
                f"milliseconds for {times.periods} periods": 1e3
                * fmean(c.seconds for c in times.by_method[with_.name].values()),
                "right-hand sides, with over without": fmean(
                    times.by_method[with_.name][case].evaluations
                    / times.by_method[sign.name][case].evaluations
                    for case in CASES
                ),
            }
    closest = max(ours, key=lambda m: ours[m]["t_D, mean"])
    best = ours[closest]
    against = [times.t_D("exact", sign.name, case) for sign in paper.SIGNS for case in CASES]
    verdict = (
        Verdict.REPRODUCED
        if best["t_D, mean"] >= 2.0
        else Verdict.SHAPE if best["t_D, mean"] >= 0.5 else Verdict.NOT
    )  # fmt: skip
    low = min(row["t_D, mean"] for row in ours.values())
    why = (
        f"Stick changes the run time by {100 * low:+.0f} % to {100 * best['t_D, mean']:+.0f} % (means of "
        f"{len(CASES)} cases). With stick, the number of evaluations of the right-hand side is "
        f"{best['right-hand sides, with over without']:.3f} times as large as without stick. The claimed "
        "increase is therefore a property of one implementation. `exact` includes stick, and takes only "
        f"{100 * (1 + fmean(against)):.1f} % of the time of the method without stick."
    )
    return Claim(
        "figure 7",
        "7",
        "a method that considers stick-slip needs more than 225 % additional run time",
        {"t_D": 2.25},
        ours,
        closest,
        {"t_D": fmean(against), "least and greatest": (min(against), max(against))},
        verdict,
        why,
    )
