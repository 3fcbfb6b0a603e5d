"""One draw of a random structure, run by hybridsim and held against time stepping."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

import hybridsim as hs
from reference.random_structures import END, Draw, Structure
from reference.stepped_structures import march

INTEGRATORS = {"dop853": {"rtol": 1e-9}, "taylor": {"rtol": 1e-10}, "exact": {}}
STATUSES = {
    "finished", "terminated", "nonunique", "inconsistent", "cascade", "accumulation", "step-failure", "limit",
}  # fmt: skip  # of a run forward that nobody interrupts
SAMPLES = 100
# All prime: no instant but the start and the end is met by all, neither an event nor a sample, as what all do alike is
# not in their differences. What happens in the first step of all is told apart by the last ones.
STEPS = (2003, 4327, 8923, 17317, 35311, 70901, 142007, 284003, 568019)
FACTOR = 3.0  # of what the error of a method of first order is by its own differences
AIM, RESOLVED = 0.005, 0.02  # of the motion: what is refined for, and what is good enough in the end
FLOOR = 1e-7  # the tolerances of the runs, as they grow
NUDGE, GROWTH = 1e-5, 300.0  # what makes a motion sensitive
SAME = 1e-6  # a thousand times the tolerance: what two runs may differ by where the motion does not enlarge errors
_FINE = 5  # of the numbers of steps, the one at which it is seen whether a motion is sensitive


class Verdict(NamedTuple):
    """What became of a draw."""

    draw: int
    integrator: str
    status: str
    kind: str  # agrees, sensitive, unresolved, disagrees, fault
    detail: str
    message: str
    events: int
    warnings: tuple[str, ...]


def all_draws(s: Structure, draws: int, seed: int) -> tuple[str, list[Verdict]]:
    """Why the structure is refused, or the verdicts on its draws."""
    try:
        model = hs.Model.from_toml(s.toml)
        names = ["dop853", "taylor"]
        if takes(model, s.draw(np.random.default_rng([seed, s.number, 0])), "exact"):
            names.append("exact")
        pairs = [(names[k % len(names)], names[(k + 1) % len(names)]) for k in range(draws)]
        return "", [one_draw(s, model, k, seed, *pair) for k, pair in enumerate(pairs)]
    except hs.ModelError as refusal:
        return str(refusal), []


def takes(model: hs.Model, draw: Draw, integrator: str) -> bool:
    """Whether the integrator takes the model."""
    try:
        hs.simulate(model, (0, 1e-3), params=draw.params, x0=draw.start, integrator=integrator)
    except hs.UsageError:
        return False
    return True


def one_draw(s: Structure, model: hs.Model, number: int, seed: int, integrator: str, other: str) -> Verdict:
    """Run a draw and judge it, and hold it against another integrator, which may be wrong where this one is not."""
    draw = s.draw(np.random.default_rng([seed, s.number, number]))
    try:
        sol = run(model, draw, integrator)
        kind, detail = judged(s, draw, sol)
        if kind == "agrees":
            apart = distance(s, draw, sol, run(model, draw, other))
            kind, detail = ("disagrees", f"{other}: {apart}") if apart else (kind, detail)
    except hs.ModelError:
        raise
    except Exception as error:  # of any kind: a run that raises is a verdict, and the other draws go on
        return Verdict(number, integrator, "exception", "fault", repr(error)[:500], "", 0, ())
    return Verdict(
        number, integrator, sol.status, kind, detail, sol.message, len(sol.events), tuple(sol.warnings)
    )


def run(model: hs.Model, draw: Draw, integrator: str) -> hs.Solution:
    """The run of a draw by one of our integrators."""
    options: dict[str, Any] = INTEGRATORS[integrator]
    return hs.simulate(
        model,
        (0.0, END),
        params=draw.params,
        x0=draw.start,
        integrator=integrator,
        limits={"steps": 1_000_000, "events": 50_000},
        **options,
    )


def distance(s: Structure, draw: Draw, one: hs.Solution, other: hs.Solution) -> str:
    """How two of our runs differ by more than a change of the start by `SAME` makes; empty where they do not."""
    m, end = s.masses, min(float(one.t[-1]), float(other.t[-1]))
    times = np.linspace(0.0, end, SAMPLES + 1)
    off = grown(np.array([one(t)[: 2 * m : 2] - other(t)[: 2 * m : 2] for t in times]))
    if (off > SAME).any():
        wrong = off > SAME * np.maximum(growth_of(draw, end, m), 1.0)
        if wrong.any():
            return f"apart by {off[-1]:.2g}, from t = {times[wrong][0]:.4g} on"
    if one.status != other.status and "limit" not in (one.status, other.status):
        return f"{other.status} at t = {other.t[-1]:.6g}, where {one.status} at t = {one.t[-1]:.6g}"
    return ""


def growth_of(draw: Draw, end: float, width: int) -> np.ndarray:
    """By how much the other method enlarges a small change of the start up to each time, the most of four."""
    q, v = draw.positions
    rng = np.random.default_rng(0)
    plain, _ = march(draw.plan, q, v, end, SAMPLES, STEPS[_FINE])
    growth = np.zeros(SAMPLES + 1)
    for _ in range(4):
        dq, dv = rng.choice([-1.0, 1.0], len(q)), rng.choice([-1.0, 1.0], len(v))
        out, _ = march(draw.plan, q + NUDGE * dq, v + NUDGE * dv, end, SAMPLES, STEPS[_FINE])
        growth = np.maximum(growth, grown((out - plain)[:, :width]) / NUDGE)
    return growth


def judged(s: Structure, draw: Draw, sol: hs.Solution) -> tuple[str, str]:
    """Verdict and reason."""
    if sol.status not in STATUSES:
        return "fault", f"status {sol.status} is not documented"
    if sol.status not in ("finished", "terminated") and not says_what_and_where(s, sol):
        return "fault", "the message does not say where and what"
    end, m = float(sol.t[-1]), s.masses
    if end == 0.0:
        return "agrees", "stopped at the start"
    times = np.linspace(0.0, end, SAMPLES + 1)
    ours = np.array([sol(t)[: 2 * m : 2] for t in times])
    if any(kind == 4 for kind, *_ in s.machines):
        ours = np.column_stack([ours, [sol(t)[2 * m] for t in times]])
    width = ours.shape[1]
    scale = max(float(np.abs(ours).max()), 0.1)
    runs: list[np.ndarray] = []
    detail = ""
    for steps in STEPS:
        out, unsettled = march(draw.plan, *draw.positions, end, SAMPLES, steps)
        runs.append(out[:, :width])
        if len(runs) < 3:
            continue
        bound, off = bounds(runs), grown(runs[-1] - ours)
        detail = f"off {off[-1]:.2g}, bound {bound[-1]:.2g} with {steps} steps, {unsettled} unsettled"
        enough = RESOLVED if steps == STEPS[-1] else AIM
        if (off <= bound).all() and bound[-1] <= FACTOR * enough * scale:
            return premature(s, draw, sol, runs[-1], bound) or ("agrees", detail)
    return unresolved(draw, end, runs, ours, scale, detail)


def says_what_and_where(s: Structure, sol: hs.Solution) -> bool:
    """Whether a run that stopped names a time and, but where it has cost what it may, a part of the model."""
    names = [e.name for e in s.elements] + [name for _, name, *_ in s.machines]
    names += [f"{letter}{i}" for letter in "xv" for i in range(s.masses)]
    is_placed = re.search(r"\bt = -?\d", sol.message) is not None
    return is_placed and (sol.status == "limit" or any(re.search(rf"\b{n}\b", sol.message) for n in names))


def bounds(runs: list[np.ndarray]) -> np.ndarray:
    """How far off the last run may be up to each time: all differences, taken to fall with the step."""
    last = STEPS[len(runs) - 1]
    differences = [grown(b - a) * STEPS[k + 1] / last for k, (a, b) in enumerate(pairwise(runs))]
    return FACTOR * np.max(differences, axis=0) + FLOOR


def grown(difference: np.ndarray) -> np.ndarray:
    """The largest of a difference up to each time."""
    return np.maximum.accumulate(np.abs(difference).max(axis=1))


def premature(
    s: Structure, draw: Draw, sol: hs.Solution, run: np.ndarray, bound: np.ndarray
) -> tuple[str, str] | None:
    """Whether the other method passed a monitor that ends the run before the run ended."""
    if s.end_at is None:
        return None
    mass, level = s.end_at[0], draw.params[s.end_at[1]]
    if run[0, mass] >= level or (run[:, mass] <= level + bound).all():
        return None
    return "disagrees", f"x{mass} passes {level:.6g} and the run goes on"


def unresolved(
    draw: Draw, end: float, runs: list[np.ndarray], ours: np.ndarray, scale: float, detail: str
) -> tuple[str, str]:
    """What a run is that does not agree to the end: sensitive, not to be decided, or wrong."""
    growth = growth_of(draw, end, ours.shape[1])
    off, bound = grown(runs[-1] - ours), bounds(runs)
    is_sensitive = growth > GROWTH
    is_open = bound > FACTOR * RESOLVED * scale
    wrong = (off > bound) & ~is_sensitive & ~is_open
    times = np.linspace(0.0, end, SAMPLES + 1)
    if wrong.any():
        return (
            "disagrees",
            f"{detail}, from t = {times[wrong][0]:.4g} of {end:.4g} on, growth {growth[-1]:.3g}",
        )
    since = times[is_sensitive][0] if is_sensitive.any() else end
    if is_sensitive.any() and not (is_open & ~is_sensitive).any():
        return "sensitive", f"{detail}, since t = {since:.4g} of {end:.4g}, growth {growth[-1]:.3g}"
    return "unresolved", f"{detail}, since t = {times[is_open][0]:.4g} of {end:.4g}, growth {growth[-1]:.3g}"
