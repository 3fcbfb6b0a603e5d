"""Random oscillators that stick and are released, run by an integrator and held against the closed form.

The oscillator m x'' + c x' + k x + f = F0 sin(w t) is drawn over decades of its parameters, with mu_s = mu_k, mu_s well
above mu_k, mu_s above mu_k by a few roundings, and without damping; up to 10**6 periods out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

import hybridsim as hs
from hybridsim.model import Contact, FrictionLaw, Model, State
from reference.dfcs_closed_form import Motion, Oscillator

KINDS = ("equal", "above", "hair", "undamped")
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


@dataclass(frozen=True)
class Comparison:
    """What a run got right: changes and releases of the truth, events missed, spurious, late, slips cut short."""

    changes: int
    releases: int
    missed: int
    spurious: int
    late: int
    short: int
    said: tuple[str, ...]  # the status where it is not "finished", and warnings

    @property
    def is_right(self) -> bool:
        return not (self.missed or self.spurious or self.late or self.short or self.said)


def compare(case: Case, periods: float, integrator: str) -> Comparison:
    """Hold one run against the closed form, change by change."""
    motion, sol = case.truth(periods), case.run(case.t0 + periods * case.period, integrator)
    true = [(c.t, MODES[c.mode]) for c in motion.changes]
    found = [(e.t, e.target) for e in sol.events if e.kind == "transition"]
    same = 0
    while same < min(len(true), len(found)) and true[same][1] == found[same][1]:
        same += 1
    late = sum(
        abs(t - s) > LATE * case.period for (t, _), (s, _) in zip(found[:same], true[:same], strict=True)
    )
    modes = [MODES[motion.pieces[0].mode], *(mode for _, mode in true)]
    short = 0  # after a release what follows has to last as long as it should
    for a, ((t, t_next), (s, s_next)) in enumerate(
        zip(pairwise(t for t, _ in found), pairwise(t for t, _ in true), strict=False)
    ):
        short += modes[a] == "stick" and t_next - t < 0.5 * (s_next - s)
    said = () if sol.status == "finished" else (sol.status,)
    releases = sum(a == "stick" for a, _ in pairwise(modes))
    return Comparison(
        len(true), releases, len(true) - same, len(found) - same, late, short, said + sol.warnings
    )
