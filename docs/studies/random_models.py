"""Compare random models of each kind with references at a requested tolerance, and measure the orders of methods.

    python docs/studies/random_models.py [draws]      (50 by default; they make docs/studies/random-models.md)

There are 200 structures, each with so many draws of parameters and initial values. Linear systems of one to eight
states are generic, oscillatory, defective, nearly defective or stiff, with six kinds of forcing. Their reference is
a matrix exponential in integers. The reference of smooth expressions is a Taylor series in integers. Stiff nonlinear
systems have a known motion.
"""

from __future__ import annotations

import math
import sys
import time
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

import hybridsim as hs

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.integer_series import BITS
from reference.random_models import POINTS, Case, smooth_cases, structures

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "random-models.md"
UNIT = 2.0**-53
WITHIN = 100.0  # tolerances that an error may come to
EXACT = 1e4  # roundings that an error of the closed form may come to
TOLERANCES = {"taylor": 1e-12, "dop853": 1e-9, "tsit5": 1e-6, "rodas5p": 1e-6}


# -- measurement -------------------------------------------------------------------------------------------------


@dataclass
class Errors:
    """Errors in units of the tolerance, of one family and integrator, and runs that failed."""

    ends: list[float] = field(default_factory=list)
    between: list[float] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def hold(case: Case, integrator: str, errors: Errors) -> None:
    """Run a case and compare it with the truth, at its end and between its steps."""
    tolerance = TOLERANCES.get(integrator)
    size = float(np.abs(np.vstack([case.truth, case.start])).max()) or 1.0
    options = {} if tolerance is None else {"rtol": tolerance, "atol": tolerance * 1e-3 * size}
    unit = tolerance * size if tolerance else UNIT * (size + case.moved)
    sol = hs.simulate(
        case.model, (0.0, case.span), params=case.params, x0=case.start, integrator=integrator, **options
    )
    if not sol.success:
        errors.faults.append(f"{sol.status}: {sol.message}")
        return
    off = [
        float(np.abs(sol(case.span * (k + 1) / POINTS) - true).max()) / unit
        for k, true in enumerate(case.truth)
    ]
    errors.ends.append(off[-1])
    errors.between.append(max(off[:-1]))
    if not max(off) <= (WITHIN if tolerance else EXACT):
        errors.faults.append(f"{max(off):.3g}: {case.model.name} {case.params} {case.start}")


def study(draws: int, seed: int = 1, every: int = 1) -> dict[tuple[str, str], Errors]:
    """All structures, or each so manieth."""
    found: dict[tuple[str, str], Errors] = defaultdict(Errors)
    began = time.perf_counter()
    for k, cases in enumerate(islice(structures(draws, seed), 0, None, every)):
        for case in cases:
            for integrator in case.integrators:
                hold(case, integrator, found[case.family, integrator])
        if (k + 1) % 20 == 0:
            print(f"{k + 1} structures, {time.perf_counter() - began:.0f} s", flush=True)
    return found


# -- orders ------------------------------------------------------------------------------------------------------

CLAIMED = {"dop853": 8, "tsit5": 5, "rodas5p": 5, "rk4-sign": 4}
STEPS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)


def orders(count: int, seed: int) -> dict[str, list[float]]:
    """Observed orders with fixed steps: the slope over the finest halving whose errors are above rounding."""
    found: dict[str, list[float]] = defaultdict(list)
    for k in range(count):
        case = next(smooth_cases(k, 1, seed))
        for name in CLAIMED:
            errors = {n: fixed_step_error(case, name, n) for n in STEPS}
            pairs = [(n, 2 * n) for n in STEPS if 2 * n in errors]
            clear = [(n, m) for n, m in pairs if errors[m] > 1e-13 and errors[n] < 1e-2]
            if clear:
                n, m = clear[-1]
                found[name].append(math.log2(errors[n] / errors[m]))
    return found


def fixed_step_error(case: Case, name: str, steps: int) -> float:
    """The largest error at the points with so many equal steps between two of them."""
    h = case.span / POINTS / steps * POINTS
    if name.startswith("rk4"):
        options = {"step": h}
    else:
        options = {"rtol": 0.9, "atol": 1e9, "max_step": h, "first_step": h}
    sol = hs.simulate(
        case.model, (0.0, case.span), params=case.params, x0=case.start, integrator=name, **options
    )
    return float(np.abs(sol(case.span) - case.truth[-1]).max())


def proportions(count: int, seed: int) -> dict[str, list[float]]:
    """Slope of log error over log rtol, from 1e-4 to 1e-10."""
    found: dict[str, list[float]] = defaultdict(list)
    asked = np.array([1e-4, 1e-6, 1e-8, 1e-10])
    for k in range(count):
        case = next(smooth_cases(k, 1, seed))
        size = float(np.abs(case.truth).max())
        for name in TOLERANCES:
            off = []
            for rtol in asked:
                sol = hs.simulate(
                    case.model,
                    (0.0, case.span),
                    params=case.params,
                    x0=case.start,
                    integrator=name,
                    rtol=rtol,
                    atol=rtol * 1e-3 * size,
                )
                off.append(max(float(np.abs(sol(case.span) - case.truth[-1]).max()) / size, 1e-16))
            found[name].append(float(np.polyfit(np.log(asked), np.log(off), 1)[0]))
    return found


# -- the page ----------------------------------------------------------------------------------------------------

HEAD = """# Random models against references

Are the errors of runs as small as the tolerance requests? Of {runs} runs of random models, {faults} exceed the
allowed error.

`python docs/studies/random_models.py` makes 200 random structures. Each structure runs with {draws} random sets of
parameters and initial values. The script compares every run with a reference at four times. Three of these times are
between steps, as a test of the dense output. The fourth time is the end of the run.

- There are 100 dense linear systems x' = A x + f phi(t) of one to eight states. There are six kinds of matrices A.
  A *generic* matrix has random elements. An *oscillatory* matrix causes about ten oscillations in a run. A
  *defective* matrix has fewer eigenvectors than states. Its elements are exact. A *nearly defective* matrix differs
  from a defective matrix by 1e-4 to 1e-15. A *stiff* matrix has a ratio of rates from 10 to 1e4. For a *very stiff*
  matrix this ratio is from 1e4 to 1e8. Only `exact` and `rodas5p` run systems with a very stiff matrix. The forcing
  phi is zero, constant, a polynomial, an exponential, a sine, or t exp(-e t) cos(w t). The reference is a matrix
  exponential in integers of {bits} bits.
- There are 80 systems of one to four states with random smooth expressions (sums, products, quotients, roots, exp,
  sin, cos, tanh, atan). The reference is a Taylor series in integers, with about 18 correct digits.
- There are 20 coupled stiff nonlinear systems of two to four states. The exact solution of each state is a sine. In
  14 systems the ratio of rates is from 10 to 1e4. In 6 systems this ratio is from 1e4 to 1e8. Only `rodas5p` runs
  these 6 systems.

The error of a run is the largest error of a state, relative to the largest state of the run. The table gives the
error in units of rtol. The values of rtol are {asked}.

`exact` has no tolerance, so its error has another unit. The unit for `exact` is an error that no floating-point
computation can avoid. This unit is the sum of two parts. The first part is 2^-53 of the largest state. For the
second part, all numbers of the model are changed at random by at most a relative 2^-53. The second part is the
largest change of the motion in three such trials. The change of basis in `exact` may multiply such an error by a
hundred.

A run is *within* the tolerance if its error is at most {within:.0f} units. For `exact` the limit is {exact:.0e}
units, which is 1e-12. A method controls only the error of each step. The effect of the errors of all steps on the
final state depends on the system.

| family | integrator | runs | median, end | 99 % | largest | median, between | 99 % | largest | not within |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
ORDERS = """
## Orders

Twenty of the systems with smooth expressions run with fixed steps. The order is log2 of the ratio between the
errors with the steps h and h/2. The order is computed at the smallest h for which the errors are above 1e-13.
Rounding then has no influence.

| integrator | order claimed | median observed | from | to |
| --- | --- | --- | --- | --- |
"""
PROPORTIONS = """
The second table tests the error estimators on the same systems. For rtol between 1e-4 and 1e-10, this table gives
the slope of the logarithm of the error over the logarithm of rtol. A slope of 1 means an error proportional to the
tolerance. The order of `taylor` depends on the tolerance.

| integrator | median | from | to |
| --- | --- | --- | --- |
"""
TAIL = """
Run `python docs/studies/random_models.py [draws]` to repeat the study. The study takes {minutes:.0f} minutes on one
core.
"""


def page(
    draws: int,
    found: dict[tuple[str, str], Errors],
    observed: dict[str, list[float]],
    slopes: dict[str, list[float]],
    minutes: float,
) -> str:
    """The page of the results."""
    asked = ", ".join(f"{rtol:.0e} for `{name}`" for name, rtol in TOLERANCES.items())
    out = HEAD.format(
        draws=draws,
        bits=BITS,
        asked=asked,
        within=WITHIN,
        exact=EXACT,
        runs=sum(len(errors.ends) for errors in found.values()),
        faults=sum(len(errors.faults) for errors in found.values()),
    )
    for (family, name), errors in found.items():
        cells = [
            f"{f(values):.2g}"
            for values in (errors.ends, errors.between)
            for f in (np.median, ninety_nine, np.max)
        ]
        runs = len(errors.ends)
        out += f"| {family} | `{name}` | {runs} | " + " | ".join(cells) + f" | {len(errors.faults)} |\n"
    out += ORDERS
    for name, order in CLAIMED.items():
        values = observed[name]
        out += f"| `{name}` | {order} | {np.median(values):.2f} | {min(values):.2f} | {max(values):.2f} |\n"
    out += PROPORTIONS
    for name, values in slopes.items():
        out += f"| `{name}` | {np.median(values):.2f} | {min(values):.2f} | {max(values):.2f} |\n"
    return out + TAIL.format(minutes=minutes)


def ninety_nine(values: list[float]) -> float:
    """The value that 99 of 100 are below."""
    return float(np.quantile(values, 0.99))


def main() -> None:
    """Run the study, print the tables, write the page."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    began = time.perf_counter()
    observed, slopes = orders(20, 1), proportions(20, 1)
    found = study(draws)
    out = page(draws, found, observed, slopes, (time.perf_counter() - began) / 60)
    print(out)
    for key, errors in found.items():
        for fault in errors.faults[:3]:
            print(key, fault[:1500])
    if draws >= 50:
        PAGE.write_text(out)


if __name__ == "__main__":
    main()
