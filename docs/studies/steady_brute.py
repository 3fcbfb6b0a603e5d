"""Find steady motions by plain runs alone, for docs/studies/steady_states.py.

A model is run for many periods. Its states at one phase of each period show whether and after how many periods the
motion repeats. No function of `hybridsim.analysis` is used. `by_scipy` does not use hybridsim at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from steady_points import Friction, Point

import hybridsim as hs

PERIODS = 64, 512, 2048  # that a run has, one after the other, until it repeats
LIMITS = {"steps": 400_000, "events": 100_000}  # of a run
RTOL = 1e-11
PHASE = 0.3819  # of the period, at which the states are compared
LONGEST = 24  # periods after which a motion may repeat
LATE = 16  # periods that show the ranges of the states
REPEATS = 1e-7  # of the range of each state: a smaller change is none
RESTS = 1e-9  # of the largest value in the run
SAMPLES = 800  # in a period, for extreme values
STEP = 1e-5  # of the range of a state, for differences
SIDES = 1e-2  # relative difference of the derivatives on the two sides, above which there is none
PERTURBED, GROWN = (
    1e-7,
    1e3,
)  # a change of the start of an irregular motion, and by how much it grows in chaos
FOLLOWED = 200  # periods over which it is followed


@dataclass
class Motion:
    """A motion as plain runs show it.

    kind: "periodic", "rest", "slow" (on its way to a repeating motion, or to rest if `multiple` is 0), "irregular",
    or the status of a run that ended early.
    error: the estimated distance of the states from their limit, in units of their ranges.
    matrix: derivative of the map over the period, or None if the two sides differ.
    """

    kind: str
    periods: int = 0
    multiple: int = 0
    period: float = math.nan
    error: float = math.nan
    amplitude: dict[str, float] = field(default_factory=dict)
    stick: dict[str, float] = field(default_factory=dict)
    matrix: list[list[float]] | None = None
    one_sided: float = math.nan
    growth: float = math.nan


def followed(point: Point) -> Motion:
    """Run the model until its motion repeats, or for the largest number of periods."""
    motion = Motion("irregular")
    for periods in PERIODS:
        sol = run(point, None, 0.0, periods * point.time, keep="all", limits=LIMITS)
        if sol.status not in ("finished", "limit"):
            return Motion(f"ended: {sol.status}", message_of(sol))
        motion = judged(point, sol)
        motion.periods = periods
        if motion.kind in ("periodic", "rest") or sol.status == "limit":
            break
    if motion.kind == "irregular":
        motion.growth = growth(point, sol)
    elif motion.multiple:
        begin = last_strobes(point, sol)[0][-1 - motion.multiple]
        motion.matrix, motion.one_sided = derivative(point, sol, begin, motion.period)
    return motion


def message_of(sol: hs.Solution) -> int:
    """Print why a run ended."""
    print("   ", sol.message, flush=True)
    return 0


def run(
    point: Point, x0: dict[str, float] | None, begin: float, duration: float, **options: object
) -> hs.Solution:
    """A plain run, from the start of the model or from given states."""
    chosen = {"integrator": "dop853", "rtol": RTOL}
    return hs.simulate(point.plain, (begin, begin + duration), x0=x0, **(chosen | options))


# -- the states at one phase -------------------------------------------------------------------------------------


def last_strobes(point: Point, sol: hs.Solution) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) and states (K, n) at one phase of the forcing, or at upward passages of a level."""
    if point.period is not None:
        first = math.ceil(sol.t_start / point.period - PHASE)
        times = point.period * (PHASE + np.arange(first, math.floor(sol.t_end / point.period - PHASE) + 1))
        times = times[times <= sol.t_end]
    else:
        times = passages(point, sol)
    return times, values(sol, times)


def values(sol: hs.Solution, times: np.ndarray) -> np.ndarray:
    """States and discrete states (K, n + d) at times."""
    rows = [sol(times, side="-")]
    rows += [np.atleast_2d(sol.output(part.name, times, side="-")) for part in sol.model.discrete]
    return np.concatenate(rows).T if len(times) else np.zeros((0, 1))


def passages(point: Point, sol: hs.Solution) -> np.ndarray:
    """Times at which a state passes a level upward in the last quarter of a run."""
    begin = sol.t_end - 0.25 * (sol.t_end - sol.t_start)
    times = np.linspace(begin, sol.t_end, int(100 * (sol.t_end - begin) / point.time))
    x = sol(times)
    low, high = x.min(axis=1), x.max(axis=1)
    whole = np.abs(sol(sol.t)).max(axis=1)
    levels = low + 0.5719 * (high - low)
    counts = [np.sum((row[:-1] < level) & (row[1:] >= level)) for row, level in zip(x, levels)]
    moving = (high - low) > RESTS * whole
    j = int(np.argmax(np.where(moving, counts, -1)))
    if not moving.any():
        return np.zeros(0)
    up = np.flatnonzero((x[j, :-1] < levels[j]) & (x[j, 1:] >= levels[j]))
    before, after = times[up], times[up + 1]
    for _ in range(60):
        middle = 0.5 * (before + after)
        is_above = sol(middle)[j] >= levels[j]
        before, after = np.where(is_above, before, middle), np.where(is_above, middle, after)
    return after


def judged(point: Point, sol: hs.Solution) -> Motion:
    """Whether the motion repeats at the end of a run, and its measures over the last period."""
    names = [*sol.names, *(part.name for part in sol.model.discrete)]
    late = np.linspace(max(sol.t_start, sol.t_end - LATE * point.time), sol.t_end, LATE * 64)
    whole = np.abs(values(sol, np.linspace(sol.t_start, sol.t_end, 4096))).max(axis=0)
    x = values(sol, late)
    size = 0.5 * np.ptp(x, axis=0)
    if (size <= RESTS * whole).all():
        return Motion("rest", error=float((size / np.where(whole > 0.0, whole, 1.0)).max()))
    earlier = sol.t_start + 0.5 * (late[0] - sol.t_start)
    before = np.ptp(values(sol, np.linspace(earlier, earlier + sol.t_end - late[0], len(late))), axis=0)
    is_dying = bool((2.0 * size <= 0.7 * before).all())
    scale = np.maximum(size, 1e-6 * whole)
    scale[scale == 0.0] = 1.0
    times, strobes = last_strobes(point, sol)
    if len(times) < 8:
        return Motion("slow" if is_dying else "irregular")
    best = Motion("slow" if is_dying else "irregular")
    for multiple in range(1, min(LONGEST, (len(times) - 1) // 4) + 1):
        changes = np.abs((strobes[multiple:] - strobes[:-multiple]) / scale).max(axis=1)
        last = float(changes[-2 * multiple :].max())
        error = remaining(changes, multiple, last)
        if error <= REPEATS or (error < 1e-2 and not best.multiple and not is_dying):
            best = Motion("periodic" if error <= REPEATS else "slow", multiple=multiple, error=error)
        if error <= REPEATS:
            break
    if best.multiple:
        best.period = float(times[-1] - times[-1 - best.multiple])
        if point.period is not None:
            best.period = best.multiple * point.period
        begin = float(times[-1 - best.multiple])
        best.amplitude = {
            name: 0.5 * (high - low)
            for name, (low, high) in zip(names, extremes(sol, begin, begin + best.period, best.multiple))
        }
        best.stick = stick(sol, begin, begin + best.period)
        if all(value <= RESTS * most for value, most in zip(best.amplitude.values(), whole)):
            best.kind = "rest"
    return best


def remaining(changes: np.ndarray, multiple: int, last: float) -> float:
    """The estimated distance from the limit, if changes over `multiple` periods shrink geometrically or like 1/k^2."""
    back = (len(changes) - 2 * multiple) // 2
    before = float(changes[-2 * multiple - back : len(changes) - back].max()) if back > 0 else 0.0
    if last <= 1e-10:
        return last
    if not last < before:
        return last if last <= 1e-2 * REPEATS else math.inf
    rate = (last / before) ** (multiple / back)
    if rate == 1.0:
        return math.inf
    return last * max(1.0 / (1.0 - rate), len(changes) / multiple if 8.0 * last > before else 0.0)


# -- measures ----------------------------------------------------------------------------------------------------


def extremes(sol: hs.Solution, begin: float, end: float, multiple: int) -> Iterator[tuple[float, float]]:
    """The least and the greatest value of each state, from samples and a search between them."""
    own = sol.t[(sol.t > begin) & (sol.t < end)]
    times = np.unique(np.concatenate([np.linspace(begin, end, SAMPLES * multiple + 1), own]))
    sides = [values(sol, times).T, np.concatenate([sol(times), values(sol, times).T[len(sol.names) :]])]
    for j in range(len(sides[0])):
        is_state = j < len(sol.names)
        yield least(sol, times, sides, j, 1.0, is_state), -least(sol, times, sides, j, -1.0, is_state)


def least(
    sol: hs.Solution, times: np.ndarray, sides: list[np.ndarray], j: int, sign: float, is_state: bool
) -> float:
    """The least value of a quantity times a sign."""
    x = np.minimum(sign * sides[0][j], sign * sides[1][j])
    found = float(x.min())
    near = np.flatnonzero(x <= found + 1e-4 * np.ptp(x)) if is_state else np.zeros(0, dtype=int)
    near = near[(near > 0) & (near < len(x) - 1)]
    near = near[x[near] <= np.minimum(x[near - 1], x[near + 1])]
    low, high = times[near - 1], times[near + 1]
    for _ in range(4 if len(near) else 0):
        grid = np.linspace(low, high, 33)
        inside = sign * sol(grid.ravel())[j].reshape(grid.shape)
        found = min(found, float(inside.min()))
        k = np.clip(inside.argmin(axis=0), 1, 31)
        low, high = (np.take_along_axis(grid, (k + step)[None], axis=0)[0] for step in (-1, 1))
    return found


def stick(sol: hs.Solution, begin: float, end: float) -> dict[str, float]:
    """The fraction of the time that each contact with a mode of stick spends in it."""
    return {
        contact.name: sum(
            max(0.0, min(part.t1, end) - max(part.t0, begin))
            for part in sol.modes[contact.name]
            if part.mode == "stick"
        )
        / (end - begin)
        for contact in sol.model.contacts
        if contact.name in sol.modes
        and any(part.mode == "slip+" or part.mode == "stick" for part in sol.modes[contact.name])
    }


# -- small changes of the start ----------------------------------------------------------------------------------


def modes_at(sol: hs.Solution, t: float) -> dict[str, str]:
    """The modes of all components that the states do not determine, just before a time."""
    own = {component.name for component in sol.model.components} | {
        contact.name for contact in sol.model.contacts if contact.law.modes
    }
    found = {}
    for name, parts in sol.modes.items():
        if name in own:
            found[name] = next(part.mode for part in reversed(parts) if part.t0 < t)
    return found


def from_states(point: Point, sol: hs.Solution, t: float, x: np.ndarray, duration: float) -> np.ndarray:
    """The states after a duration of a plain run that starts at a time with changed states."""
    names = [*sol.names, *(part.name for part in sol.model.discrete)]
    size = np.maximum(np.abs(x[: len(sol.names)]), 1e-3)
    later = run(
        point, dict(zip(names, x.tolist())), t, duration, z0=modes_at(sol, t) or None, rtol=1e-12,
        atol=(1e-15 * size).tolist(),
    )  # fmt: skip
    if later.status != "finished":
        return np.full(len(x), math.nan)
    return values(later, np.array([later.t_end]))[0]


def derivative(
    point: Point, sol: hs.Solution, t: float, period: float
) -> tuple[list[list[float]] | None, float]:
    """The derivative of the map over a period in units of the ranges, and how much its two sides differ."""
    x = values(sol, np.array([t]))[0]
    late = values(sol, np.linspace(t, min(t + period, sol.t_end), 400))
    unit = np.maximum(0.5 * np.ptp(late, axis=0), 1e-3 * np.abs(late).max(axis=0))
    unit[unit == 0.0] = 1e-3
    best: tuple[list[list[float]] | None, float] = (None, math.inf)
    for step in (STEP, 0.1 * STEP):
        base = from_states(point, sol, t, x, period)
        sides = []
        for sign in (1.0, -1.0):
            columns = []
            for j in range(len(x)):
                moved = x.copy()
                moved[j] += sign * step * unit[j]
                columns.append(sign * (from_states(point, sol, t, moved, period) - base) / (step * unit))
            sides.append(np.array(columns).T)
        matrix = 0.5 * (sides[0] + sides[1])
        differs = float(np.abs(sides[0] - sides[1]).max() / (1.0 + np.abs(matrix).max()))
        if differs < best[1]:
            best = (matrix.tolist() if differs <= SIDES else None, differs)
    return best


def growth(point: Point, sol: hs.Solution) -> float:
    """By how much a small change of the states grows along an irregular motion, as a factor."""
    t = float(sol.t_end)
    x, n = values(sol, np.array([t]))[0], len(sol.names)
    unit = np.maximum(np.ptp(values(sol, np.linspace(t - 8.0 * point.time, t, 400)), axis=0), 1e-12)
    base, moved = x, x + PERTURBED * unit * np.where(np.arange(len(x)) < n, 1.0, 0.0)
    duration = FOLLOWED * point.time
    apart = np.abs(
        (from_states(point, sol, t, moved, duration) - from_states(point, sol, t, base, duration)) / unit
    )
    return float(apart.max() / PERTURBED)


# -- without hybridsim -------------------------------------------------------------------------------------------


def by_scipy(system: Friction, x: float, periods: int) -> tuple[np.ndarray, float, float]:
    """States (periods, 2) at one phase, and amplitude of x and fraction of stick over the last 24 periods or fewer.

    A mass starts at rest. Each phase of slip is a run of `solve_ivp` that ends when v = 0. A phase of stick ends when
    the force that holds the mass reaches the limit.
    """
    T = 2.0 * math.pi / system.w
    end, t, v, direction = periods * T, 0.0, 0.0, 0
    pieces: list[
        tuple[float, float, bool, Callable[[float], Sequence[float]]]
    ] = []  # begin, end, stick, states

    def held(t: float) -> float:
        return system.F * math.sin(system.w * t) - system.k * x

    while t < end:
        if direction == 0:
            begin = t
            if abs(held(t)) <= system.limit:
                times = t + np.linspace(0.0, 1.0, 2001) * T
                over = [s for s in times if abs(held(s)) > system.limit]
                if not over:
                    pieces.append((t, end, True, lambda s, x=x: (x, 0.0)))
                    break
                before = times[int(np.searchsorted(times, over[0])) - 1]
                t = float(brentq(lambda s: abs(held(s)) - system.limit, before, over[0], xtol=1e-15))
            direction = 1 if held(t) > 0.0 else -1
            pieces.append((begin, t, True, lambda s, x=x: (x, 0.0)))
            continue

        def rates(s: float, y: np.ndarray, sign: int = direction) -> list[float]:
            force = system.F * math.sin(system.w * s) - sign * system.slip(abs(y[1]))
            return [y[1], (force - system.c * y[1] - system.k * y[0]) / system.m]

        stops = lambda s, y: y[1]  # noqa: E731  # SciPy reads attributes of the function
        stops.terminal, stops.direction = True, -direction  # type: ignore[attr-defined]
        found = solve_ivp(
            rates, (t, end), [x, v], "DOP853", rtol=1e-11, atol=[1e-14, 1e-12], events=stops, dense_output=True,
            max_step=T / 20.0,
        )  # fmt: skip
        pieces.append((t, float(found.t[-1]), False, found.sol))
        t, x, v = float(found.t[-1]), float(found.y[0, -1]), 0.0
        if found.status != 1:
            break
        direction = 0 if abs(held(t)) <= system.limit else (1 if held(t) > 0.0 else -1)
    begins = np.array([piece[0] for piece in pieces])

    def state(s: float) -> list[float]:
        return [float(part) for part in pieces[int(np.searchsorted(begins, s, side="right")) - 1][3](s)]

    strobes = np.array([state((k + PHASE) * T) for k in range(periods)])
    begin = end - min(24, periods) * T
    late = [state(s)[0] for s in np.linspace(begin, end, 24 * SAMPLES, endpoint=False)]
    stuck = sum(max(min(b, end) - max(a, begin), 0.0) for a, b, is_stick, _ in pieces if is_stick)
    return strobes, 0.5 * (max(late) - min(late)), stuck / (end - begin)
