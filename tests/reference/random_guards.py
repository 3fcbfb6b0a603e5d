"""Random guards of known zeros: combinations of what linear modes can make, and products for Taylor series."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import mpmath
import numpy as np

import hybridsim as hs
from reference.close_zeros import CLOSE, GRID, Closed, Extreme, Term, Truth, truth_of

SPANS = {"polynomial": 1.0, "waves": 6.0, "driven": 6.0, "mixed": 3.0}

# -- linear models whose guard is such a sum ---------------------------------------------------------------------


@dataclass(frozen=True)
class Draw:
    """One guard: the model's parameters and start, and what it does."""

    params: dict[str, float]
    start: list[float]
    truth: Truth
    closer: Callable[[], Truth] | None = None  # the same from a finer grid, which is slow


def two_modes(name: str, guard: str, states: list[hs.State], parameters: dict[str, float]) -> hs.Model:
    """A model that changes its mode at each zero of a guard."""
    up = hs.Mode("up", guards=[hs.Guard("g", guard, "down")])
    down = hs.Mode("down", guards=[hs.Guard("g", f"-({guard})", "up")])
    switch = hs.Component("c", modes=[up, down], initial="up")
    return hs.Model(name, states=states, parameters=parameters, components=[switch])


LINEAR = {
    "polynomial": two_modes(
        "polynomial", "x0", [hs.State(f"x{i}", 0, f"x{i + 1}" if i < 6 else "0") for i in range(7)], {}
    ),
    "waves": two_modes(
        "waves",
        "x1 + x2 + d",
        [
            hs.State("x1", 0, "v1"),
            hs.State("v1", 0, "-W1*x1"),
            hs.State("x2", 0, "v2"),
            hs.State("v2", 0, "-W2*x2"),
        ],
        {"W1": 1.0, "W2": 2.0, "d": 0.0},
    ),
    "driven": two_modes(
        "driven",
        "x + b*v + d",
        [hs.State("x", 0, "v"), hs.State("v", 0, "F*sin(om*t) - W*x - c*v")],
        {"W": 1.0, "c": 0.1, "F": 1.0, "om": 2.0, "b": 0.5, "d": 0.0},
    ),
    "mixed": two_modes(
        "mixed",
        "x1 + x2 + d + r*sin(w*t) + q*cos(w*t) + u*t*exp(-e*t)",
        [hs.State("x1", 1, "-a1*x1"), hs.State("x2", 1, "-a2*x2")],
        {"a1": 1.0, "a2": 2.0, "d": 0.0, "r": 0.0, "q": 0.0, "w": 1.0, "u": 0.0, "e": 1.0},
    ),
}
CONSTANT = {"polynomial": 0, "waves": 4, "driven": 3, "mixed": 2}  # which free number is the constant
FREE = {"polynomial": 7, "waves": 5, "driven": 4, "mixed": 6}


def short(rng: np.random.Generator, low: float, high: float) -> float:
    """A random number of 20 bits, so that its square is a double."""
    return round(float(rng.uniform(low, high)) * 2**18) / 2**18


def fixed_of(kind: str, rng: np.random.Generator) -> dict[str, float]:
    """The numbers that a guard does not depend on linearly."""
    if kind == "waves":
        return {"w1": short(rng, 0.5, 2.0), "w2": short(rng, 2.0, 5.0)}
    if kind == "driven":
        w, om = short(rng, 0.7, 3.0), short(rng, 0.5, 4.0)
        return {"W": w * w, "c": short(rng, 0.0, 0.8), "om": om, "b": short(rng, -1.0, 1.0)}
    if kind == "mixed":
        names = {"a1": (0.2, 1.0), "a2": (1.2, 3.0), "w": (1.0, 4.0), "e": (0.5, 2.0)}
        return {n: short(rng, *limits) for n, limits in names.items()}
    return {}


def closed(kind: str, fixed: dict[str, float], free: list[float]) -> Closed:
    """The guard in closed form."""
    mpf, mpc = mpmath.mpf, mpmath.mpc
    with mpmath.workdps(40):
        if kind == "polynomial":
            return Closed([Term(mpc(x) / math.factorial(k), k, mpc(0)) for k, x in enumerate(free)])
        if kind == "waves":
            x1, v1, x2, v2, d = map(mpf, free)
            w1, w2 = mpf(fixed["w1"]), mpf(fixed["w2"])
            return Closed(
                [
                    Term(mpc(x1, -v1 / w1), 0, mpc(0, w1)),
                    Term(mpc(x2, -v2 / w2), 0, mpc(0, w2)),
                    Term(mpc(d), 0, mpc(0)),
                ]
            )
        if kind == "driven":
            x, v, F, d = map(mpf, free)
            W, c, om, b = (mpf(fixed[n]) for n in ("W", "c", "om", "b"))
            forced = F * mpc(0, -1) / mpc(W - om * om, c * om)  # F sin(om t) = Re(-i F exp(i om t))
            rate = mpc(-c / 2, mpmath.sqrt(W - c * c / 4))
            x, v = x - forced.real, v - (mpc(0, om) * forced).real
            own = mpc(x, -(v + c / 2 * x) / rate.imag)
            return Closed(
                [
                    Term(own * (1 + b * rate), 0, rate),
                    Term(forced * (1 + b * mpc(0, om)), 0, mpc(0, om)),
                    Term(mpc(d), 0, mpc(0)),
                ]
            )
        x1, x2, d, r, q, u = map(mpf, free)
        return Closed(
            [
                Term(mpc(x1), 0, mpc(-mpf(fixed["a1"]))),
                Term(mpc(x2), 0, mpc(-mpf(fixed["a2"]))),
                Term(mpc(d), 0, mpc(0)),
                Term(mpc(q, -r), 0, mpc(0, fixed["w"])),
                Term(mpc(u), 1, mpc(-mpf(fixed["e"]))),
            ]
        )


def given(kind: str, fixed: dict[str, float], free: list[float]) -> tuple[dict[str, float], list[float]]:
    """Parameters and start of the model."""
    if kind == "polynomial":
        return {}, free
    if kind == "waves":
        return {"W1": fixed["w1"] ** 2, "W2": fixed["w2"] ** 2, "d": free[4]}, free[:4]
    if kind == "driven":
        return {**fixed, "F": free[2], "d": free[3]}, free[:2]
    return {**fixed, **dict(zip("drqu", free[2:], strict=True))}, free[:2]


def depth_of(rng: np.random.Generator) -> float:
    """10**-17 to 10**-1 on either side of zero, at times zero itself."""
    return 0.0 if rng.random() < 0.02 else float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-17, -1))


def places(rng: np.random.Generator, count: int, span: float) -> np.ndarray:
    """Random places in a span, no two close together."""
    while True:
        found = np.sort(rng.uniform(0.03, 0.97, count)) * span
        if count < 2 or np.diff(found).min() > 0.03 * span:
            return found


def linear_draw(kind: str, rng: np.random.Generator) -> Draw:
    """A guard with some single zeros and, as a rule, a close extreme."""
    span, count = SPANS[kind], FREE[kind]
    fixed = fixed_of(kind, rng)
    has_extreme = rng.random() < 0.8
    singles = int(rng.integers(0, min(4, count - 2 - 2 * has_extreme) + 1))
    at = places(rng, singles + has_extreme, span)
    rng.shuffle(at)
    units = [closed(kind, fixed, [float(i == j) for j in range(count)]) for i in range(count)]
    values = np.array([unit.parts(at).sum(axis=0) for unit in units]).T
    rows = [values]
    if has_extreme:
        rows.append(np.array([unit.slopes(at[-1:]) for unit in units]).T)
    matrix = np.concatenate(rows) if len(at) else np.zeros((0, count))
    vectors = np.linalg.svd(matrix)[2][len(matrix) :]
    free = rng.normal(size=len(vectors)) @ vectors
    if has_extreme:
        t = np.linspace(0.0, span, 60)
        size = np.abs(closed(kind, fixed, free.tolist()).parts(t)).sum(axis=0).max()
        free[CONSTANT[kind]] += depth_of(rng) * size
    exact = closed(kind, fixed, free.tolist())
    closer = partial(truth_of, exact, span, 40 * GRID)
    return Draw(*given(kind, fixed, free.tolist()), truth_of(exact, span), closer)


# -- guards of known zeros, for series ---------------------------------------------------------------------------

FACTORS = {
    "polynomial": (("({u} - {r})", "(({u} - {p})**2 - {d})"), 1.0),
    "waves": (("sin(({u} - {r})/2)", "(1 - cos({u} - {p}) - {d})"), 6.0),
}
POSITIVE = "(1.5 + sin(3*t + f))*(2 + sin(y))"


def product_model(kind: str, pairs: int, u: str) -> hs.Model:
    """A product of single zeros and of pairs, five in all, in time or in a state that goes like it."""
    single, pair = FACTORS[kind][0]
    factors = [single.format(u=u, r=f"r{i}") for i in range(5 - 2 * pairs)]
    factors += [pair.format(u=u, p=f"p{i}", d=f"d{i}") for i in range(pairs)]
    names = [f"r{i}" for i in range(5 - 2 * pairs)] + [f"{n}{i}" for i in range(pairs) for n in "pd"]
    states = [hs.State("y", 0.5, "cos(2*t) - y*(1 + y*y)"), hs.State("u", 0, "1")]
    guard = "*".join(["a", *factors, POSITIVE])
    return two_modes(f"{kind}-{pairs}-{u}", guard, states, dict.fromkeys(("a", "f", *names), 1.0))


def product_draw(kind: str, pairs: int, rng: np.random.Generator) -> Draw:
    """Zeros and depths of the factors; some of the single zeros lie beyond the span."""
    span = FACTORS[kind][1]
    singles = 5 - 2 * pairs
    at = places(rng, singles + pairs, span)
    rng.shuffle(at)
    outside = rng.random(singles) < 0.3
    at[:singles][outside] = span * (1.02 if kind == "polynomial" else 1.03)
    params = {"f": float(rng.uniform(0, 6)), "a": float(rng.choice([-1.0, 1.0]))}
    params |= {f"r{i}": float(at[i]) for i in range(singles)}
    depths = []
    for i in range(pairs):
        d = 1e-3 * depth_of(rng)  # so that the zeros of one pair stay clear of all others
        params |= {f"p{i}": float(at[singles + i]), f"d{i}": d}
        depths.append(d)
    t = np.linspace(0.0, span, 401)
    y = 0.0  # the factor of y is between 1 and 3: known well enough for a depth

    def guard(t: np.ndarray, but: int = -1) -> np.ndarray:
        """The guard without the factor of one pair."""
        value = params["a"] * (1.5 + np.sin(3 * t + params["f"])) * (2 + np.sin(y))
        for i in range(singles):
            x = t - at[i]
            value = value * (x if kind == "polynomial" else np.sin(x / 2))
        for i in range(pairs):
            x = t - at[singles + i]
            if i != but:
                value = value * ((x * x if kind == "polynomial" else 1 - np.cos(x)) - depths[i])
        return value

    values = guard(t)
    size = float(np.abs(values).max())
    extremes, zeros = [], []
    for i, d in enumerate(depths):
        p = float(at[singles + i])
        rest = abs(float(guard(np.array([p]), i)[0]))
        half = 0.0
        if d > 0:
            half = math.sqrt(d) if kind == "polynomial" else 2 * math.asin(math.sqrt(d / 2))
        if half > 0.5 * CLOSE * span:
            slope = abs(rest * (2 * half if kind == "polynomial" else math.sin(half)))
            zeros += [(p - half, slope), (p + half, slope)]
        else:
            extremes.append(Extreme(p, d * rest, (p - half, p + half) if d > 0 else None))
    for i in range(singles):
        r = float(at[i])
        e = 1e-7
        slope = abs(float(guard(np.array([r + e]))[0] - guard(np.array([r - e]))[0])) / (2 * e)
        zeros.append((r, slope))
    inside = sorted(z for z in zeros if 0.0 < z[0] < span)
    return Draw(
        params, [0.5, 0.0], Truth(inside, sorted(extremes, key=lambda e: e.t), size, bool(values[0] > 0))
    )
