"""Random impacts with smooth nonlinear gaps: states just before, and just after by NumPy alone.

Bodies move freely, so that their way to an impact is a straight line, and the impulses of the impact are the solution
of a small linear complementarity problem, found by enumeration. Conservation laws are checked on top of it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

import hybridsim as hs


@dataclass(frozen=True)
class Structure:
    """Bodies in `n` positions with gaps; the numbers are parameters, so that each structure is compiled once.

    Parameters
    ----------
    n : positions.
    gaps : texts over q0, q1, ... and the parameters; d0, d1, ... are taken off.
    planar : positions are pairs of coordinates of particles, whose angular momentum the gaps keep.
    """

    name: str
    n: int
    gaps: tuple[str, ...]
    planar: bool = False


def polynomial(k: int, positions: tuple[int, ...]) -> str:
    """A gap of second and third degree in some positions, exact for numbers of few digits."""
    pairs = zip(positions, positions[1:] + positions[:1], strict=True)
    terms = [f"a{k}_{i}*q{i} + b{k}_{i}*q{i}**2 + c{k}_{i}*q{i}**2*q{j}" for i, j in pairs]
    return " + ".join(terms) + f" - d{k}"


def transcendental(n: int, k: int) -> str:
    """A gap of sines, roots and exponentials."""
    kinds = ("sin(q{i} + q{j})", "sqrt(4 + q{i}**2 + q{j}**2)", "exp(0.25*q{i}*q{j})")
    mixed = [f"b{k}_{i}*" + kinds[i % 3].format(i=i, j=(i + 1) % n) for i in range(n)]
    return " + ".join([*(f"a{k}_{i}*q{i}" for i in range(n)), *mixed]) + f" - d{k}"


def distance(i: int, j: int, k: int) -> str:
    """The distance of two particles in a plane."""
    return f"sqrt((q{2 * i} - q{2 * j})**2 + (q{2 * i + 1} - q{2 * j + 1})**2) - d{k}"


def structures() -> list[Structure]:
    """One gap and several, in 2 to 6 positions."""
    found = [Structure("wall", 2, ("d0 - sqrt(q0**2 + q1**2)",), planar=True)]
    found += [Structure(f"curved-{n}", n, (transcendental(n, 0),)) for n in range(2, 7)]
    found += [Structure("two-discs", 4, (distance(0, 1, 0),), planar=True)]
    found += [Structure("three-discs", 6, (distance(0, 1, 0), distance(1, 2, 1)), planar=True)]
    pair = (0, 1, 2), (2, 1, 0)
    found += [Structure("two-at-once", 3, tuple(polynomial(k, q) for k, q in enumerate(pair)))]
    pair = (0, 1, 2), (2, 3, 4)
    found += [Structure("two-along-a-chain", 5, tuple(polynomial(k, q) for k, q in enumerate(pair)))]
    triple = (0, 1), (1, 2), (2, 3)
    found += [Structure("three-along-a-chain", 4, tuple(polynomial(k, q) for k, q in enumerate(triple)))]
    return found


def model(structure: Structure) -> hs.Model:
    """The model, with all parameters one."""
    n, gaps = structure.n, structure.gaps
    slopes = [_slopes(gap, n) for gap in gaps]
    names = {
        name
        for gap in gaps
        for name in gap.replace("*", " ").replace("(", " ").replace(")", " ").split()
        if name[0] in "abcd" and name[1:2].isdigit()
    }
    parameters: dict[str, Any] = dict.fromkeys(sorted(names), 1.0)
    parameters |= {f"m{i}": 1.0 for i in range(n)} | {"e": 1.0}
    states = [hs.State(f"q{i}", 0, der=f"v{i}", nominal=1) for i in range(n)]
    for i in range(n):
        forces = [f"p{k}*({slopes[k][i]})" for k in range(len(gaps)) if slopes[k][i] != "0"]
        states.append(hs.State(f"v{i}", 0, der=f"({' + '.join(forces) or '0'})/m{i}", nominal=1))
    impacts = [hs.Impact(f"p{k}", gap=gap, restitution="e") for k, gap in enumerate(gaps)]
    return hs.Model(structure.name, states=states, parameters=parameters, impacts=impacts)


def _slopes(gap: str, n: int) -> list[str]:
    import sympy

    return [str(sympy.diff(sympy.sympify(gap), f"q{i}")) for i in range(n)]


@dataclass(frozen=True)
class Case:
    """One impact: numbers, the state before it, and what comes out."""

    parameters: dict[str, float]
    start: np.ndarray
    instant: float
    masses: np.ndarray
    slopes: np.ndarray  # (gaps, n)
    before: np.ndarray  # velocities
    after: np.ndarray
    at: np.ndarray  # positions


class Functions:
    """Gaps and their gradients as NumPy functions."""

    def __init__(self, structure: Structure, names: tuple[str, ...]) -> None:
        import sympy

        symbols = sympy.symbols([*(f"q{i}" for i in range(structure.n)), *names])
        gaps = [sympy.sympify(gap) for gap in structure.gaps]
        slopes = [[sympy.diff(gap, q) for q in symbols[: structure.n]] for gap in gaps]
        self.gaps = sympy.lambdify(symbols, gaps, "numpy")
        self.slopes = sympy.lambdify(symbols, slopes, "numpy")


def draw(
    rng: np.random.Generator, structure: Structure, functions: Functions, names: tuple[str, ...], e: float
) -> Case | None:
    """A random impact of all gaps at once; None where the bodies meet one before, or none of them closes."""
    n, count = structure.n, len(structure.gaps)
    values = {name: float(rng.integers(-16, 17)) / 8 for name in names}
    masses = rng.integers(4, 33, n) / 8.0
    if structure.planar:
        masses = np.repeat(masses[: n // 2], 2)
    values |= {f"m{i}": float(m) for i, m in enumerate(masses)} | {"e": e}
    at = rng.integers(-16, 17, n) / 8.0
    offsets = {f"d{k}": 0.0 for k in range(count)}
    args = [(values | offsets)[name] for name in names]
    sign = -1.0 if structure.name == "wall" else 1.0
    for k, value in enumerate(functions.gaps(*at, *args)):
        values[f"d{k}"] = sign * float(value)
    args = [values[name] for name in names]
    slopes = np.array(functions.slopes(*at, *args), dtype=float)
    if np.linalg.cond(slopes / np.sqrt(masses)) > 30 or np.linalg.norm(slopes, axis=1).min() < 0.1:
        return None
    before = rng.normal(size=n)
    before += np.linalg.lstsq(slopes, -rng.uniform(0.1, 1.0, count) - slopes @ before, rcond=None)[0]
    rates = slopes @ before
    instant = 0.0 if count > 1 else float(rng.uniform(0.2, 1.0))
    start = at - instant * before
    on_the_way = [
        functions.gaps(*(start + t * before), *args)[0] for t in np.linspace(0, 0.999 * instant, 200)
    ]
    if instant and min(on_the_way) <= 0.0:
        return None
    after = before + impulses(slopes, masses, rates, e) @ slopes / masses
    return Case(values, np.concatenate([start, before]), instant, masses, slopes, before, after, at)


def impulses(slopes: np.ndarray, masses: np.ndarray, rates: np.ndarray, e: float) -> np.ndarray:
    """P >= 0 with u + G P >= -e u, one of the two with equality for each contact, by enumeration."""
    effects, count = slopes @ (slopes / masses).T, len(rates)
    for size in range(count, -1, -1):
        for chosen in combinations(range(count), size):
            pushed = list(chosen)
            found = np.zeros(count)
            if pushed:
                block = effects[np.ix_(pushed, pushed)]
                found[pushed] = np.linalg.solve(block, -(1.0 + e) * rates[pushed])
            after = rates + effects @ found
            if (found >= 0.0).all() and (after + e * rates >= -1e-12).all():
                return found
    raise AssertionError("a positive definite problem has a solution")


def faults(structure: Structure, case: Case, solution: Any, e: float) -> list[str]:
    """What is wrong with the state after the impact: within 1e-10 of sizes of one."""
    n, found = structure.n, []
    hits = [event for event in solution.events if event.t <= case.instant + 1e-6]
    if not hits:
        return [f"{structure.name}: no impact in a run that ends as {solution.status}: {solution.message}"]
    x = np.asarray(hits[-1].x_plus)
    q, v = x[:n], x[n:]
    before, m = case.before, case.masses

    def check(what: str, off: float) -> None:
        if not off <= 1e-10:
            found.append(f"{structure.name}: {what} off by {off:.3g} with {case.parameters}")

    check("the positions move", float(np.abs(q - np.asarray(hits[0].x_minus)[:n]).max()))
    check("the positions", float(np.abs(q - case.at).max()))
    check("the velocities", float(np.abs(v - case.after).max() / max(1.0, np.abs(case.after).max())))
    if e == 1.0:
        energy = 0.5 * m @ before**2
        check("the energy", abs(0.5 * float(m @ v**2) - energy) / max(1.0, energy))
    change = m * (v - before)  # along the reactions
    pushes = np.linalg.lstsq(case.slopes.T, change, rcond=None)[0]
    check("the momentum across the reactions", float(np.abs(change - pushes @ case.slopes).max()))
    if structure.planar:
        turn = [float(np.sum(m[::2] * (q[::2] * w[1::2] - q[1::2] * w[::2]))) for w in (before, v)]
        check("the angular momentum", abs(turn[1] - turn[0]))
        if n > 2:
            check("the momentum", float(np.abs(change.reshape(-1, 2).sum(axis=0)).max()))
    return found


def trial(seed: int, each: int, names_of: Collection[str] = ()) -> tuple[int, list[str]]:
    """Run `each` impacts of every structure, or of those named; how many there were, and what was wrong."""
    rng, done, found = np.random.default_rng(seed), 0, []
    for structure in [one for one in structures() if one.name in names_of or not names_of]:
        one = model(structure)
        names = tuple(sorted(set(one.parameter_values()) - {"e"} - {f"m{i}" for i in range(structure.n)}))
        functions, left = Functions(structure, names), each
        while left:
            e = (1.0, 1.0, 0.5, 0.0)[int(rng.integers(4))]
            case = draw(rng, structure, functions, names, e)
            if case is None:
                continue
            x0 = {
                f"{'q' if i < structure.n else 'v'}{i % structure.n}": float(x)
                for i, x in enumerate(case.start)
            }
            solution = hs.simulate(
                one,
                (0.0, case.instant + 1e-3),
                params=case.parameters,
                x0=x0,
                integrator="taylor",
                rtol=1e-13,
            )
            found += faults(structure, case, solution, e)
            left, done = left - 1, done + 1
    return done, found
