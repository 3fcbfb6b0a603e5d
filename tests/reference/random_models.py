"""Random models of each kind with the motion they make: linear, smooth, and stiff ones whose motion is known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import mpmath
import numpy as np

import hybridsim as hs
from reference.integer_series import BITS, ONE, Flow, fixed, follow, real, text
from reference.matrix_exponential import motion
from reference.random_trees import random_tree

EXPLICIT = ("taylor", "dop853", "tsit5")
POINTS = 4  # at which a run is held against the truth
SHAKES = 3  # of a model's numbers: what one of them does may cancel


@dataclass(frozen=True)
class Case:
    """A model with its numbers, the span, the truth at POINTS times, and how far a rounding of its numbers moves it."""

    family: str
    model: hs.Model
    params: dict[str, float]
    start: list[float]
    span: float
    truth: np.ndarray
    integrators: tuple[str, ...]
    moved: float = 0.0


# -- linear systems ----------------------------------------------------------------------------------------------

FORCINGS = {
    "none": "0",
    "constant": "1",
    "polynomial": "(1 + p*t + q*t**2)",
    "exponential": "exp(-e*t)",
    "sinusoidal": "sin(w*t + p)",
    "mixed": "t*exp(-e*t)*cos(w*t)",
}
LINEAR_KINDS = ("generic", "oscillatory", "defective", "nearly defective", "stiff", "very stiff")
SPANS = dict.fromkeys(LINEAR_KINDS, 4.0) | {"oscillatory": 20.0, "stiff": 1.0, "very stiff": 1.0}


@cache
def linear_model(n: int, forcing: str) -> hs.Model:
    """x' = A x + f phi(t), dense."""
    states = []
    for i in range(n):
        row = " + ".join(f"a{i}{j}*x{j}" for j in range(n))
        states.append(hs.State(f"x{i}", 0, row if forcing == "none" else f"{row} + f{i}*{FORCINGS[forcing]}"))
    names = [f"a{i}{j}" for i in range(n) for j in range(n)]
    names += [] if forcing == "none" else [f"f{i}" for i in range(n)]
    names += [name for name in "pqew" if f"{name}*" in FORCINGS[forcing] or f"+ {name})" in FORCINGS[forcing]]
    return hs.Model(f"linear-{n}-{forcing}", states=states, parameters=dict.fromkeys(names, 1.0))


def matrix(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """A random matrix of a kind; its doubles are what the run and the reference take."""
    if kind == "generic":
        return rng.normal(size=(n, n)) / math.sqrt(n)
    if kind == "oscillatory":
        A = np.zeros((n, n))
        for i in range(0, n - 1, 2):
            speed = rng.uniform(0.5, 3.0)
            A[i, i + 1], A[i + 1, i] = speed, -speed
        if n % 2:
            A[-1, -1] = -rng.uniform(0.1, 1.0)
        S = np.eye(n) + 0.5 * rng.normal(size=(n, n)) / math.sqrt(n)
        return S @ A @ np.linalg.inv(S)
    if kind in ("stiff", "very stiff"):
        ratio = 10.0 ** (rng.uniform(1, 4) if kind == "stiff" else rng.uniform(4, 8))
        values = ratio ** np.concatenate([[0.0, 1.0], rng.uniform(0, 1, max(n - 2, 0))])[:n]
        Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
        return -Q @ np.diag(values if n > 1 else np.ones(1)) @ Q.T
    # chains of eigenvalues in quarters, behind integer transformations of determinant one: exact in doubles
    A = np.zeros((n, n))
    sizes, left = [], n
    while left:
        sizes.append(min(left, int(rng.integers(2, 5))))
        left -= sizes[-1]
    at = 0
    for size in sizes:
        value = -0.25 * float(rng.integers(0, 9))
        A[at : at + size, at : at + size] = value * np.eye(size) + np.diag(np.ones(size - 1), 1)
        at += size
    for _ in range(n if n > 1 else 0):
        i, j = rng.choice(n, 2, replace=False)
        A[i] += A[j]
        A[:, j] -= A[:, i]
    if kind == "nearly defective":
        A = A + rng.normal(size=(n, n)) * 10.0 ** -rng.uniform(4, 15)
    return A


def augmented(
    A: np.ndarray, f: np.ndarray, forcing: str, p: dict[str, float]
) -> tuple[np.ndarray, list[int]]:
    """The matrix of the states and of the functions of time, and where these start, in integers."""
    n = len(A)
    with mpmath.workprec(BITS + 64):
        sine, cosine = (
            int(mpmath.nint(mpmath.ldexp(g(mpmath.mpf(p.get("p", 0.0))), BITS)))
            for g in (mpmath.sin, mpmath.cos)
        )
    e, w = p.get("e", 0.0), p.get("w", 0.0)
    # rows of the functions' own matrix, where they start, and what of them drives
    own: dict[str, tuple[list[list[float]], list[int], list[float]]] = {
        "none": ([], [], []),
        "constant": ([[0.0]], [ONE], [1.0]),
        "polynomial": (
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            [ONE, 0, 0],
            [1.0, p.get("p", 0.0), p.get("q", 0.0)],
        ),
        "exponential": ([[-e]], [ONE], [1.0]),
        "sinusoidal": ([[0.0, w], [-w, 0.0]], [sine, cosine], [1.0, 0.0]),
        "mixed": (
            [[-e, w, 0.0, 0.0], [-w, -e, 0.0, 0.0], [1.0, 0.0, -e, w], [0.0, 1.0, -w, -e]],
            [0, ONE, 0, 0],
            [0.0, 0.0, 0.0, 1.0],
        ),
    }
    rows, start, drives = own[forcing]
    size = n + len(rows)
    out = np.array([[0] * size for _ in range(size)], dtype=object)
    for i in range(n):
        for j in range(n):
            out[i, j] = fixed(float(A[i, j]))
        for j, share in enumerate(drives):
            out[i, n + j] = fixed(float(f[i])) * fixed(share) >> BITS
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            out[n + i, n + j] = fixed(value)
    return out, start


def linear_cases(kind: str, n: int, forcing: str, draws: int, seed: int) -> Iterator[Case]:
    """Draws of one structure."""
    model, span = linear_model(n, forcing), SPANS[kind]
    integrators = ("exact", "rodas5p") if kind == "very stiff" else ("exact", *EXPLICIT, "rodas5p")
    for draw in range(draws):
        rng = np.random.default_rng([seed, LINEAR_KINDS.index(kind), n, list(FORCINGS).index(forcing), draw])
        A, f, x = matrix(kind, n, rng), rng.normal(size=n), rng.normal(size=n)
        names = {
            "p": rng.uniform(-1, 1),
            "q": rng.uniform(-1, 1),
            "e": rng.uniform(0.2, 2),
            "w": rng.uniform(0.5, 3),
        }
        p = {k: float(v) for k, v in names.items() if k in {m.name for m in model.parameters}}
        whole, start = augmented(A, f, forcing, p)
        y, h = [*(fixed(float(v)) for v in x), *start], fixed(span / POINTS)
        true = exactly(motion(whole, y, h, POINTS), n)
        moved = max(displacement(whole, y, h, true, rng) for _ in range(SHAKES))
        truth = true.astype(float)
        params = {f"a{i}{j}": float(A[i, j]) for i in range(n) for j in range(n)} | p
        params |= {} if forcing == "none" else {f"f{i}": float(f[i]) for i in range(n)}
        yield Case(f"linear, {kind}", model, params, x.tolist(), span, truth, integrators, moved)


def displacement(
    whole: np.ndarray, y: list[int], h: int, true: np.ndarray, rng: np.random.Generator
) -> float:
    """How far random relative changes of all numbers, of at most 1, move the motion, to first order."""
    n = true.shape[1]
    shakes = np.array([[int(v) for v in row] for row in rng.integers(-99, 100, whole.shape)], dtype=object)
    other = exactly(motion(whole + (whole * shakes >> 60), y, h, POINTS), n)
    return float(abs(other - true).max()) * 2.0**60 / 99.0


def exactly(states: list[np.ndarray], n: int) -> np.ndarray:
    """Fractions (times, n)."""
    return np.array([[real(v) for v in state[:n]] for state in states], dtype=object)


# -- smooth expressions ------------------------------------------------------------------------------------------


def smooth_cases(structure: int, draws: int, seed: int) -> Iterator[Case]:
    """x_i' = random expression - c x_i, of one to four states."""
    rng = np.random.default_rng([seed, 100, structure])
    n = 1 + structure % 4
    names = [f"x{i}" for i in range(n)]
    rates = {
        x: ("-", random_tree(rng, (*names, "t", "a", "b"), 3 if n < 3 else 2), ("*", "c", x)) for x in names
    }
    flow = Flow(rates)
    model = hs.Model(
        f"smooth-{structure}",
        states=[hs.State(x, 0, text(rate)) for x, rate in rates.items()],
        parameters={"a": 1.0, "b": 1.0, "c": 1.0},
    )
    span = 2.0
    for _ in range(draws):
        p = {"a": float(rng.uniform(-2, 2)), "b": float(rng.uniform(-2, 2)), "c": float(rng.uniform(0.2, 2))}
        x0 = rng.uniform(-1.5, 1.5, n).tolist()
        values = {
            **{k: fixed(v) for k, v in p.items()},
            **{x: fixed(v) for x, v in zip(names, x0, strict=True)},
            "t": 0,
        }
        times = [span * (k + 1) / POINTS for k in range(POINTS)]
        truth = np.array([[float(real(v)) for v in state] for state in follow(flow, values, times, 18, 18)])
        yield Case("smooth expressions", model, p, x0, span, truth, (*EXPLICIT, "rodas5p"))


# -- stiff nonlinear systems whose motion is known ---------------------------------------------------------------

ATTRACTIONS = (
    "{u}",
    "tanh({u})",
    "({u} + {u}**3)",
    "atan({u})",
    "({u}/(1 + {u}**2))",
    "({u}*exp({u}))",
    "sin({u})",
)


def stiff_cases(structure: int, draws: int, seed: int, explicit: bool) -> Iterator[Case]:
    """Each state is drawn to a wave, and stays on it: x_i = sin(w_i t); how hard is spread over the ratio."""
    rng = np.random.default_rng([seed, 200, structure])
    n = 2 + structure % 3
    apart = [f"(x{i} - sin(w{i}*t))" for i in range(n)]
    states = []
    for i in range(n):
        g = str(rng.choice(ATTRACTIONS)).format(u=apart[i])
        coupled = str(rng.choice(ATTRACTIONS)).format(u=apart[(i + 1) % n])
        states.append(hs.State(f"x{i}", 0, f"w{i}*cos(w{i}*t) - L{i}*({g} + 0.25*{coupled})"))
    names = [f"{k}{i}" for k in "wL" for i in range(n)]
    model = hs.Model(f"stiff-{structure}", states=states, parameters=dict.fromkeys(names, 1.0))
    span = 2.0
    for _ in range(draws):
        top = rng.uniform(1, 4) if explicit else rng.uniform(4, 8)
        hard = 10.0 ** np.concatenate([[0.0, top], rng.uniform(0, top, n - 2)])
        p = {f"w{i}": float(rng.uniform(0.5, 4)) for i in range(n)} | {
            f"L{i}": float(hard[i]) for i in range(n)
        }
        times = [span * (k + 1) / POINTS for k in range(POINTS)]
        truth = np.array([[math.sin(p[f"w{i}"] * t) for i in range(n)] for t in times])
        family = "stiff nonlinear, to 1e4" if explicit else "stiff nonlinear, 1e4 to 1e8"
        yield Case(
            family, model, p, [0.0] * n, span, truth, (*EXPLICIT, "rodas5p") if explicit else ("rodas5p",)
        )


# -- all of them ------------------------------------------------------------------------------------------------


def structures(draws: int, seed: int) -> Iterator[Iterator[Case]]:
    """The 200 structures."""
    grid = [(kind, n) for kind in LINEAR_KINDS for n in range(1, 9)]
    forcings = list(FORCINGS)
    for k in range(100):
        kind, n = grid[k % len(grid)]
        yield linear_cases(kind, n, forcings[(k + k // len(grid)) % len(forcings)], draws, seed)
    for k in range(80):
        yield smooth_cases(k, draws, seed)
    for k in range(20):
        yield stiff_cases(k, draws, seed, explicit=k < 14)
