"""Ten thousand releases of a sticking mass against the closed form: none re-sticks at once, none is missed.

The oscillator m x'' + c x' + k x + f = F0 sin(w t) is drawn at random, over decades of its parameters, with
mu_s = mu_k, mu_s well above mu_k, mu_s above mu_k by a few roundings, and without damping; up to 10**6 periods out.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from reference.dfcs_closed_form import Motion, Oscillator

import hybridsim as hs
from hybridsim.engine import settle
from hybridsim.engine.decide import FINE, LEAVES, UNDECIDED
from hybridsim.model import Contact, FrictionLaw, Model, State

MODES = {1: "slip+", -1: "slip-", 0: "stick"}
LAW = FrictionLaw("stiction", slip="mu_k*N", stick="mu_s*N", parameters={"mu_s": None, "mu_k": None})
MODEL = Model(
    "oscillator",
    states=(State("x", 0, "v"), State("v", 0, "(F0*sin(w*t) - c*v - k*x - f)/m")),
    parameters={"m": 1, "c": 0, "k": 1, "mu_s": 0.5, "mu_k": 0.5, "N": 1, "F0": 1, "w": 1},
    contacts=(Contact("f", velocity="v", normal="N", law=LAW, arguments={"mu_s": "mu_s", "mu_k": "mu_k"}),),
)
RTOL = 1e-8
# An error of the state of RTOL moves an event by as much where the velocity or the force crosses with a slope of
# order one; the flattest of some 10**5 crossings are a few hundred times flatter.
LATE = 1e-5  # of a period


@dataclass(frozen=True)
class Case:
    """A drawn oscillator that sticks at (t0, x0)."""

    values: dict[str, float]
    t0: float
    x0: float

    @property
    def period(self) -> float:
        return 2 * math.pi / self.values["w"]

    def truth(self, periods: float) -> Motion:
        p = self.values
        forces = p["mu_s"] * p["N"], p["mu_k"] * p["N"], p["F0"]
        oscillator = Oscillator(p["m"], p["c"], p["k"], *forces, p["w"])
        return oscillator.run(self.t0, self.t0 + periods * self.period, self.x0, 0)

    def run(self, end: float, integrator: str) -> hs.Solution:
        p = self.values
        size = p["F0"] / p["k"]
        atol = {"x": 1e-3 * RTOL * size, "v": 1e-3 * RTOL * size * p["w"]}
        start = {"x": self.x0, "v": 0.0}
        return hs.simulate(
            MODEL.with_(**p), (self.t0, end), x0=start, integrator=integrator, rtol=RTOL, atol=atol
        )


def draw(rng: np.random.Generator, kind: str) -> Case:
    """kind: equal, above (mu_s well above mu_k), hair (above by 1e-14 to 1e-2), undamped."""
    m, k, F0, N = (
        10 ** rng.uniform(-1, 1),
        10 ** rng.uniform(0, 5),
        10 ** rng.uniform(-1, 2),
        10 ** rng.uniform(-1, 2),
    )
    c = 0.0 if kind == "undamped" else 2 * rng.uniform(0, 0.3) * math.sqrt(k * m)
    mu_k = mu_s = F0 * rng.uniform(0.1, 0.98) / N
    mu_s *= {"above": rng.uniform(1, 1.4), "hair": 1 + 10 ** rng.uniform(-14, -2)}.get(kind, 1.0)
    w = math.sqrt(k / m) * 10 ** rng.uniform(-1, 0.3)
    far = round(10 ** rng.uniform(0, 6)) if rng.random() < 0.3 else 0
    t0 = (far + rng.uniform(0, 1)) * 2 * math.pi / w
    values = {"m": m, "c": c, "k": k, "mu_s": mu_s, "mu_k": mu_k, "N": N, "F0": F0, "w": w}
    return Case({n: float(v) for n, v in values.items()}, float(t0), float(rng.uniform(-1, 1) * mu_s * N / k))


def check(case: Case, periods: float, integrator: str) -> int:
    """Hold one run against the closed form; returns how many releases it had."""
    motion, sol = case.truth(periods), case.run(case.t0 + periods * case.period, integrator)
    assert (sol.status, sol.warnings) == ("finished", ()), case
    true = [(c.t, MODES[c.mode]) for c in motion.changes]
    found = [(e.t, e.target) for e in sol.events]
    assert [mode for _, mode in found] == [mode for _, mode in true], case
    for (t, _), (t_true, _) in zip(found, true, strict=True):
        assert abs(t - t_true) <= LATE * case.period, case
    modes = [MODES[motion.pieces[0].mode], *(mode for _, mode in true)]
    for (a, (t, _)), (b, (t_next, _)), (s, s_next) in zip(
        enumerate(found), [*enumerate(found)][1:], pairwise(t for t, _ in true), strict=False
    ):
        if modes[a] == "stick":  # a release: what follows it lasts as long as it should
            assert t_next - t >= 0.5 * (s_next - s), (case, modes[b])
    return sum(a == "stick" for a, _ in pairwise(modes))


KINDS = ("equal", "above", "hair", "undamped")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("integrator", ["dop853", "exact"])
def test_releases(integrator: str, kind: str, seed: int) -> None:
    """Eight times 1250 each: the sequence of modes is that of the closed form, change by change."""
    rng, releases = np.random.default_rng([seed, KINDS.index(kind)]), 0
    while releases < 1250:
        releases += check(draw(rng, kind), 10, integrator)


# -- what the zeros by decree are for ---------------------------------------------------------------------------


def first_releases(count: int) -> list[tuple[Case, float, float, str]]:
    """Cases with mu_s = mu_k, when each is first released, until when that slip lasts a third, and its mode."""
    rng, found = np.random.default_rng(7), []
    while len(found) < count:
        case = draw(rng, "equal")
        changes = case.truth(1.2).changes
        if len(changes) > 1 and changes[0].mode != 0:
            t, t_next = changes[0].t, changes[1].t
            found.append((case, t, t + (t_next - t) / 3, MODES[changes[0].mode]))
    return found


def verdicts(count: int) -> Counter[str]:
    """How the engine fares at releases: right, undecided (says so), failed (stops), wrong."""
    result: Counter[str] = Counter()
    for case, t, end, mode in first_releases(count):
        sol = case.run(
            end, "scipy-dop853"
        )  # which has its events settled in Python, where the rules can be changed
        released = [(e.t, e.target) for e in sol.events if e.kind == "transition"]
        if not sol.success:
            result["failed"] += 1
        elif any("undecided" in warning for warning in sol.warnings):
            result["undecided"] += 1
        elif [m for _, m in released] == [mode] and abs(released[0][0] - t) <= LATE * case.period:
            result["right"] += 1
        else:
            result["wrong"] += 1
    return result


def only_the_velocity(*arguments: Any) -> None:
    """Decree v = 0 at a release, and not that the acceleration is zero too."""
    decree_orders(*arguments)
    decreed = arguments[-1]
    decreed[decreed == 2] = 1


def by_the_letter(
    series: Any, bounds: Any, decreed: Any, active: Any, backward: bool, sides: Any, orders: Any
) -> int:
    """A guard whose first coefficient without decree is within its bound is undecided, and its mode is kept."""
    verdict = FINE
    for g in np.flatnonzero(active):
        k = int(decreed[g])
        sides[g] = 0 if abs(series[g, k]) <= bounds[g, k] else int(np.sign(series[g, k]))
        orders[g] = k
        verdict = LEAVES if sides[g] < 0 else min(verdict, UNDECIDED if sides[g] == 0 else FINE)
    return verdict


def as_computed(series: Any, bounds: Any, *rest: Any) -> int:
    """Every coefficient is taken for what rounding made of it."""
    return judge(series, np.zeros_like(bounds), *rest)


decree_orders, judge = settle.decree_orders, settle.judge


@pytest.mark.parametrize(
    ("decree", "rule", "least", "most"),
    [
        pytest.param(decree_orders, judge, 200, 200, id="as it is"),
        pytest.param(decree_orders, by_the_letter, 200, 200, id="with Z, by the letter"),
        pytest.param(decree_orders, as_computed, 200, 200, id="with Z, no error bounds at all"),
        pytest.param(only_the_velocity, by_the_letter, 0, 100, id="without Z, by the letter"),
        pytest.param(only_the_velocity, as_computed, 100, 180, id="without Z, by the computed sign"),
    ],
)
def test_releases_need_the_zeros_by_decree(
    decree: Callable[..., None],
    rule: Callable[..., int],
    least: int,
    most: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 200 releases all are right with Z, whatever the rule for what is not in Z.

    Without it 7 in 10 stay undecided where a coefficient within its bound is (417 of 600), and every sixth run
    stops for want of a motion where the sign of the computed acceleration is believed (106 of 600).
    """
    monkeypatch.setattr(settle, "decree_orders", decree)
    monkeypatch.setattr(settle, "judge", rule)
    assert least <= verdicts(200)["right"] <= most


def test_the_error_bounds_alone_would_find_the_releases_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two lines of defence: the computed acceleration is within its bound, so the jerk decides even without Z."""
    monkeypatch.setattr(settle, "decree_orders", only_the_velocity)
    assert verdicts(200)["right"] == 200
