"""Random restarts on and near guards: verdicts and searches of the engine against exact arithmetic.

Zeros by decree are declared with each restart and are zero in the truth too. A restart is clear where the first true
coefficient without decree is beyond twice the engine's bound; the others start inside it and have to follow the rule.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfromroots, polyval

import hybridsim as hs
from hybridsim.engine.roots.first_exit import FOUND, NEVER, first_exit
from hybridsim.engine.system.instant import Instant, phase
from hybridsim.engine.system.system import System
from reference.integer_series import BITS, Flow, fixed, real, text
from reference.judged_guards import verdict_on
from reference.random_trees import random_tree
from reference.releases import KINDS, MODEL, draw
from reference.sturm import Sturm

UNIT = 2.0**-53
ORDERS = 4  # coefficients of a series


# -- verdicts ----------------------------------------------------------------------------------------------------


@dataclass
class Verdicts:
    """Counts of verdicts on guards; the first few that are wrong, in words."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    widest: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Restart:
    """A guard at a restart: the engine's series and bounds, the true one as integers, zeros by decree."""

    kind: str
    series: np.ndarray
    bounds: np.ndarray
    true: list[int]
    decreed: int


def held(tally: Verdicts, restart: Restart) -> None:
    """Judge one guard and hold the verdict against the truth, or where that is inside the bounds, against the rule."""
    kind, d = restart.kind, restart.decreed
    side = verdict_on(restart.series[None], restart.bounds[None], [d])[1].all_sides[0]
    true = [real(c) for c in restart.true]
    first = next((k for k in range(d, ORDERS) if true[k] != 0), None)
    for k in range(d, ORDERS):
        off = abs(true[k] - Fraction(float(restart.series[k])))
        bound = Fraction(float(restart.bounds[k]))
        if off > bound and off * 2**200 > 1:
            tally.counts[kind, "bound broken"] += 1
            tally.faults.append(f"bound of order {k}: {restart}")
        if bound > 0:
            tally.widest[kind] = max(tally.widest[kind], float(off / bound))
    tally.counts[kind, "restarts"] += 1
    if first is not None and abs(true[first]) > 2 * Fraction(float(restart.bounds[first])):
        expected = 1 if true[first] > 0 else -1
        tally.counts[kind, "clear"] += 1
        if side[0] != expected:
            wrong = "spurious" if side[0] < 0 else "missed" if side[0] > 0 else "unjudged"
            tally.counts[kind, wrong] += 1
            tally.faults.append(f"{wrong}: {restart}")
        return
    ruled = next((k for k in range(d, ORDERS) if abs(restart.series[k]) > restart.bounds[k]), None)
    expected = 0 if ruled is None else int(np.sign(restart.series[ruled]))
    tally.counts[kind, "undecided" if ruled is None else "by a higher derivative"] += 1
    if side[0] != expected:
        tally.counts[kind, "against the rule"] += 1
        tally.faults.append(f"against the rule: {restart}")


def offset(rng: np.random.Generator) -> float:
    """Nothing at times, else 10**-19 to 1 on either side."""
    return 0.0 if rng.random() < 0.2 else float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-19, 0))


def smooth_restarts(count: int, seed: int) -> Iterator[Restart]:
    """Random expressions: a guard set to zero, or next to it, at a random state; at times its rate too."""
    each, structure, made = 500, 0, 0
    while made < count:
        rng = np.random.default_rng([seed, structure])
        structure += 1
        rates = {
            "x": random_tree(rng, ("x", "y", "t", "a", "b"), 3),
            "y": random_tree(rng, ("x", "y", "t", "a", "b"), 3),
        }
        inner = random_tree(rng, ("x", "y", "t", "a", "b"), 3)
        tree = ("-", ("-", inner, "q"), ("*", "r", "t"))
        guard = hs.Mode("on", guards=[hs.Guard("g", text(tree), "off")])
        model = hs.Model(
            "smooth",
            states=[hs.State(name, 0.5, text(rate)) for name, rate in rates.items()],
            parameters=dict.fromkeys("abqr", 1.0),
            components=[hs.Component("c", modes=[guard, hs.Mode("off")], initial="on")],
        )
        system, flow = System(model.validate()), Flow(rates, [inner])
        if flow.folds(
            *({name: fixed(v) for name, v in zip("xytab", rng.uniform(0, 2, 5))} for _ in range(2))
        ):
            continue  # what comes down to a number is folded to a double, which a model takes for exact
        made += each
        p, z = system.vector(Instant(0.0), np.zeros(0)), np.zeros(1, dtype=np.int64)
        for _ in range(each):
            a, b, x, y = map(float, rng.uniform(-2, 2, 4))
            t = float(rng.uniform(0, 10))
            values = {"x": fixed(x), "y": fixed(y), "t": fixed(t), "a": fixed(a), "b": fixed(b)}
            true = list(flow.expand(values, ORDERS - 1)[flow.functions[0]])
            is_tangent = rng.random() < 0.3
            slope = float(real(true[1])) if is_tangent else float(rng.uniform(-1, 1))
            r = slope * (1.0 + offset(rng)) if is_tangent else slope
            rest = real(true[0]) - Fraction(r) * Fraction(t)
            q = float(rest) + offset(rng) * max(1.0, abs(float(rest)))
            decreed = int(rng.random() < 0.5)
            true[0] -= fixed(q) + int(Fraction(r) * Fraction(t) * (1 << BITS))
            true[1] -= fixed(r)
            p[: system.layout.parameters] = [
                {"a": a, "b": b, "q": q, "r": r}[m.name] for m in model.parameters
            ]
            error = np.abs([x, y]) * 4.0 * UNIT * (rng.random() < 0.5)
            late = float(rng.choice([0.0, math.ulp(t)]))
            found = system.series(t, np.array([x, y]), p, z, error, late)
            kind = "expression, " + ("a zero by definition" if decreed else "no zero by definition")
            yield Restart(kind, found.guards[0], found.guard_bounds[0], true, decreed)


FORCE = ("-", ("-", ("*", "F0", ("sin", ("*", "w", "t"))), ("*", "c", "v")), ("*", "k", "x"))
SLIP = {
    side: Flow({"x": "v", "v": ("/", (sign, FORCE, ("*", "mu_k", "N")), "m")}, ["v"])
    for side, sign in (("slip+", "-"), ("slip-", "+"))
}
STICK = Flow({"x": ("*", "x", 0.0), "v": ("*", "x", 0.0)}, [("*", "mu_s", "N"), FORCE])


def friction_restarts(count: int, seed: int) -> Iterator[Restart]:
    """Releases, stops and starts of the oscillator with the force on the border of what friction holds, or near it."""
    system = System(MODEL.validate())
    p = system.vector(Instant(0.0), np.zeros(0))
    names = [m.name for m in MODEL.parameters]
    number = 0
    while number < count:
        rng = np.random.default_rng([seed, 7, number])
        case = draw(rng, str(rng.choice(KINDS)))
        values, t0 = dict(case.values), case.t0
        s = float(rng.uniform(0, 1) * case.period * rng.choice([0.0, 1.0]))
        turn = math.remainder(phase(Instant(t0), values["w"], 0.0) + values["w"] * s - math.pi / 2, math.pi)
        if rng.random() < 0.3:  # near an extreme of the load, where its rate is next to nothing
            s = max(0.0, s - turn / values["w"]) + abs(offset(rng)) / values["w"]
        if rng.random() < 0.1:
            values["F0"] = 0.0  # a dead load: nothing moves, and nothing but rounding tells
        kind = str(rng.choice(["release", "stop", "start"]))
        p[: len(names)] = [values[n] for n in names]
        p[system.layout.origin_at] = t0
        p[system.layout.phases_at] = phase(Instant(t0), values["w"], 0.0)
        t = Fraction(t0) + Fraction(s)
        at = {n: fixed(v) for n, v in values.items()} | {"t": int(t * (1 << BITS)), "x": 0, "v": 0}
        way = int(rng.choice([-1, 1]))
        load = real(STICK.expand(at, 0)[STICK.functions[1]][0])
        limit = Fraction(values["mu_s"]) * Fraction(values["N"])
        x = float((load - way * limit) / Fraction(values["k"])) * (1.0 + offset(rng))
        v = (
            0.0
            if kind != "start" or rng.random() < 0.5
            else offset(rng) * float(limit) / values["k"] * values["w"]
        )
        at |= {"x": fixed(x), "v": fixed(v)}
        equal = values["mu_s"] == values["mu_k"]
        for z, name in enumerate(("slip+", "slip-", "stick")):
            errors = np.array([abs(x), abs(v)]) * UNIT
            found = system.series(s, np.array([x, v]), p, np.array([z]), errors, math.ulp(s))
            if name == "stick":
                flow = STICK.expand(at | {"v": 0}, ORDERS - 1)
                reach = flow[STICK.functions[0]]
                force = flow[STICK.functions[1]]
                for j, sign in enumerate((-1, 1)):
                    true = [a + sign * b for a, b in zip(reach, force, strict=True)]
                    fired = kind == "release" and sign == -way
                    title = f"{kind}, stick" + (", the limit by definition" if fired else "")
                    yield Restart(title, found.guards[j], found.guard_bounds[j], true, int(fired))
                continue
            flow, sign = SLIP[name], 1 if name == "slip+" else -1
            true = [sign * c for c in flow.expand(at, ORDERS - 1)[flow.functions[0]]]
            decreed = 0 if kind == "start" else 2 if kind == "release" and equal else 1
            if decreed:
                true[0] = 0
            title = (
                f"{kind}, slip, "
                + ("no zero by definition", "v = 0 by definition", "v = a = 0 by definition")[decreed]
            )
            yield Restart(title, found.guards[0], found.guard_bounds[0], true, decreed)
        number += 1


# -- searches ----------------------------------------------------------------------------------------------------

DEGREE = 8


@dataclass
class Searches:
    """Counts of searches for the first zero after a restart."""

    counts: Counter[tuple[int, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def searched(tally: Searches, rng: np.random.Generator) -> None:
    """A polynomial that starts on a zero by decree, its leading coefficients anything: where it next goes negative."""
    d = int(rng.integers(0, 4))
    zeros = np.sort(rng.uniform(0.0, 1.6, rng.integers(0, 6)))
    if len(zeros) and rng.random() < 0.3:
        zeros[0] = 10.0 ** rng.uniform(-12, 0)  # close to the restart
    if len(zeros) > 1 and rng.random() < 0.3:
        zeros[1] = zeros[0] * (1.0 + 10.0 ** rng.uniform(-9, 0))
    a = np.zeros(DEGREE + 1)
    a[: 1 + len(zeros)] = polyfromroots(zeros) if len(zeros) else 1.0
    a *= 1.0 if a[0] > 0 else -1.0
    a /= np.abs(a).max()
    a = np.concatenate([np.zeros(d), a[: DEGREE + 1 - d]])
    size = float(np.abs(a).sum())
    error = 8.0 * UNIT * size * float(10.0 ** rng.choice([0, 0, 3, 6]))
    a[:d] = error * rng.uniform(-1, 1, d)  # zero by decree, whatever rounding made of it
    outcome, theta = first_exit(a, error, 0.0, d, np.empty(len(a)), np.empty((64, len(a) + 2)), 0)
    tally.counts[d, "restarts"] += 1
    if not a[d] > 2.0 * error:  # the side after the restart is itself within the bound
        tally.counts[d, "start within the bound"] += 1
        return
    q = a[d:]
    exact, zero = Sturm(q), Fraction(0)
    wrong = ""
    if outcome == NEVER:
        tally.counts[d, "stays"] += 1
        wrong = "missed" if exact.count(zero, Fraction(1)) else ""
    elif outcome == FOUND:
        tally.counts[d, "leaves"] += 1
        slope = abs(float(polyval(theta, polyder(q))))
        width = 64.0 * UNIT * (theta + float(polyval(theta, np.abs(q))) / max(slope, 1e-300))
        low, high = Fraction(max(theta - width, 0.0)), Fraction(theta + width)
        if exact.count(zero, low) and deepest(q, theta) > 2.0 * error:
            wrong = "missed"
        elif not exact.count(zero, high):
            wrong = "spurious"
    else:
        tally.counts[d, "said to be open"] += 1
        wrong = "open without reason" if abs(float(polyval(theta, q))) > 4.0 * error else ""
    if wrong:
        tally.counts[d, wrong] += 1
        tally.faults.append(f"{wrong}: {a.tolist()} {error!r} {d} -> {outcome} {theta!r}")


def deepest(q: np.ndarray, theta: float) -> float:
    """How far a polynomial goes below zero before theta, on a grid."""
    return float(-polyval(np.linspace(0.0, theta, 2001), q).min())
