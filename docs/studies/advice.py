"""Compare the simplest adequate model that `advise` names with brute force, at random points of one map.

    python docs/studies/advice.py [points]            (500 by default; they make docs/studies/advice.md)

Points (F0/N, r) are drawn evenly from [0.5, 1.5] x [0.05, 2]. The question is the steady amplitude of x within 1 %.
In brute force the full motion is the closed form of the oscillator, event by event. It is followed from rest until
the free vibration has decayed below rounding. The amplitude without friction and with equivalent viscous damping is
a formula. Den Hartog's form holds if the motion has no stops. The regularized models are plain runs of the same
length. Their method is `dop853`, or `rodas5p` if stability would limit `dop853` to a million steps. Their extremes
come from samples. The advice stops a model that has become ten times as expensive as the full model. Such a model is
run to its end here.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hybridsim as hs
from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator
from hybridsim.reference.closed_forms.harmonic_balance import equivalent_viscous_amplitude

ROOT = Path(__file__).parents[2]
PAGE, PICTURE = ROOT / "docs" / "studies" / "advice.md", ROOT / "docs" / "images" / "advice-map.png"
TOL = 0.01
NEAR = 1e-4  # of the tolerance: so near to it a verdict is left open
SEED = 2026
M, C, K, MU, N = 0.2, 5.65, 1e5, 0.5, 40.0
NATURAL = math.sqrt(K / M)
ZETA = 0.5 * C / math.sqrt(K * M)
DECAYS = 30.0  # exp(-30) of the first transient is below rounding
FEWEST = 40  # periods
SAMPLES = 8001  # of the last period; the extreme is that of the parabola through the top three
NAMES = ("at-rest", "no-friction", "viscous", "no-stop", "tanh", "arctan", "karnopp")


@dataclass(frozen=True)
class Truth:
    """Amplitude, largest speed and stops of the last period of the full motion; how far the last two are apart."""

    amplitude: float
    fastest: float
    stops: int
    drift: float


def top(values: np.ndarray) -> float:
    """Largest value of a smooth curve through samples."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    left, middle, right = values[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    return float(middle - (right - left) ** 2 / (8.0 * bend)) if bend < 0.0 else float(middle)


def periods_of(r: float) -> int:
    """Periods until the free vibration has decayed."""
    return max(FEWEST, math.ceil(DECAYS * r / (2.0 * math.pi * ZETA)))


def truth(ratio: float, r: float) -> Truth:
    """The full motion in closed form."""
    w, count = r * NATURAL, periods_of(r)
    period = 2.0 * math.pi / w
    system = ForcedCoulombOscillator(M, C, K, MU * N, MU * N, ratio * N, w)
    motion = system.motion(0.0, 0.0, (0.0, count * period))
    ends = [motion(np.array([count * period])), motion(np.array([(count - 1) * period]))]
    last = [change for change in motion.changes if change.t > (count - 1) * period]
    if not last:
        return Truth(0.0, 0.0, 0, 0.0)
    x = [change.x for change in last]
    t = np.linspace((count - 1) * period, count * period, SAMPLES)
    amplitude = 0.5 * (max(x) - min(x))
    speeds = np.abs(motion(t)[1])
    stops = sum(change.target == "stick" for change in last)
    drift = abs(float(ends[0][0, 0] - ends[1][0, 0])) / amplitude
    return Truth(amplitude, top(speeds), stops, drift)


def regularised(kind: str, v0: float, ratio: float, r: float) -> float:
    """Amplitude of a plain run of a regularised model."""
    w, count = r * NATURAL, periods_of(r)
    period = 2.0 * math.pi / w
    model = hs.load("dfcs").with_(F0=ratio * N, omega=w).regularized(kind, v0=v0)
    run = hs.simulate(model, (0.0, count * period), integrator="auto", rtol=1e-8, keep=period)
    x = run(np.linspace(run.t_start, run.t_end, SAMPLES))[0]
    return 0.5 * (top(x) + top(-x))


def brute_force(ratio: float, r: float, full: Truth) -> tuple[str, dict[str, float]]:
    """The first adequate rung by brute force, and the errors up to it."""
    errors: dict[str, float] = {}
    for name in NAMES:
        errors[name] = error_of(name, ratio, r, full)
        if errors[name] <= TOL:
            return name, errors
    return "full model", errors


def error_of(name: str, ratio: float, r: float, full: Truth) -> float:
    """Relative error of one rung, inf where it gives no value."""
    X = full.amplitude
    if name == "no-stop":
        return 0.0 if X and not full.stops else math.inf
    if name == "at-rest":
        value = 0.0
    elif name == "no-friction":
        value = ratio * N / K / math.hypot(1.0 - r * r, 2.0 * ZETA * r)
    elif name == "viscous":
        value = equivalent_viscous_amplitude(r, ZETA, MU / ratio) * ratio * N / K
        if not value:
            return math.inf
    else:
        value = regularised(name, 0.01 * full.fastest, ratio, r) if X else math.inf
    return abs(value - X) / X if X else (0.0 if value == 0.0 else math.inf)


def study(count: int) -> str:
    """The page."""
    draw = np.random.default_rng(SEED)
    ratios, rs = draw.uniform(0.5, 1.5, count), draw.uniform(0.05, 2.0, count)
    began = time.perf_counter()
    found = hs.advise(
        "dfcs", "amplitude.x", TOL, mode="list", over={"F0": ratios * N, "omega": rs * NATURAL}, workers=1
    )
    spent = time.perf_counter() - began
    assert found.region is not None
    near, wrong, dear, drifts = [], [], [], []
    rungs = [step.name for step in found.ladder]
    tally: Counter[str] = Counter()
    worst = 0.0
    began = time.perf_counter()
    for k, (ratio, r) in enumerate(zip(ratios.tolist(), rs.tolist(), strict=True)):
        full = truth(ratio, r)
        name, errors = brute_force(ratio, r, full)
        drifts.append(full.drift)
        ours = str(found.map[k]) if not found.region.failed[k] else str(found.region.status[k])
        tally[ours] += 1
        if full.amplitude and not found.region.failed[k]:
            worst = max(worst, abs(float(found.region["value"][k]) / full.amplitude - 1.0))
        if ours != name:
            is_near = any(abs(e - TOL) <= NEAR * TOL for e in errors.values())
            line = f"| {ratio:.6f} | {r:.6f} | {ours} | {name} | "
            line += ", ".join(f"{n} {e:.4g}" for n, e in errors.items() if math.isfinite(e)) + " |"
            is_dear = (
                name in rungs and not found.region.failed[k] and found.region["stopped"][k][rungs.index(name)]
            )
            (dear if is_dear else near if is_near else wrong).append(line)
        if k % 25 == 0:
            print(f"{k} of {count}, {len(wrong)} differ", file=sys.stderr, flush=True)
    brute = time.perf_counter() - began
    stopped = int((found.region["stopped"] > 0.0).any(axis=-1).sum())
    return page(count, tally, near, wrong, dear, stopped, worst, max(drifts), spent, brute)


def page(
    count: int,
    tally: Counter[str],
    near: list[str],
    wrong: list[str],
    dear: list[str],
    stopped: int,
    worst: float,
    drift: float,
    spent: float,
    brute: float,
) -> str:
    """What was found, in words and tables."""
    rows = [f"| {name} | {tally[name]} |" for name in (*NAMES, "full model") if tally[name]]
    rows += [f"| {name} | {n} |" for name, n in tally.items() if name not in (*NAMES, "full model")]
    head = [
        "",
        "| F0/N | r | advice | brute force | errors by brute force |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines = [
        "# Does the advice name the right model?",
        "",
        "Does `advise` name the simplest adequate model? The answer of `advise` differs from a search "
        f"through all models at **{len(wrong) + len(near) + len(dear)}** of {count} random points.",
        "",
        f"`python docs/studies/advice.py` draws {count} points in a map of the reference model `dfcs`. The "
        "ratio F0/N of forcing to normal load is between 0.5 and 1.5. The ratio r of the forcing frequency "
        "to the natural frequency is at most 2 and at least 0.05. For each point `advise` names the "
        f"simplest model whose steady amplitude of x has an error of at most {100 * TOL:g} %. The script "
        "then searches for this model by brute force, with a run of every model:",
        "",
        "- The motion of the full model is computed in closed form, from rest until the free vibration has "
        "decayed.",
        "- Formulas give the amplitude of the models without friction and with equivalent viscous damping.",
        "- The regularized models are simulated over the same time.",
        "",
        "If friction is smoothed over 1 % of the speed, the model is stiff near the threshold of motion. At "
        f"{stopped} points `advise` stopped the run of such a model, because it took too long. The "
        f"amplitudes of the full model by `advise` and by brute force differ by at most {worst:.1e}. In the "
        f"closed form, the amplitudes of the last two periods differ by at most {drift:.1e}. On one thread "
        f"`advise` took {spent:.0f} s, and brute force {brute:.0f} s.",
        "",
        "| simplest within 1 % | points |",
        "| --- | --- |",
        *rows,
    ]
    if wrong:
        lines += ["", "## Points that differ", *head, *wrong]
    if dear:
        lines += ["", "## Points with an adequate model that was too expensive", ""]
        lines += [
            "At these points `advise` had stopped the run of an adequate model, because it took far longer"
        ]
        lines += ["than a run of the full model.", *head, *dear]
    if near:
        lines += ["", "## Points with an error at the tolerance", ""]
        lines += [
            "At these points an error differs from the tolerance by at most 0.01 % of it.",
            *head,
            *near,
        ]
    lines += [
        "",
        "## The map",
        "",
        "![The simplest adequate model over force and frequency: nothing moves at the lower edge, Karnopp's band above "
        "it and at low frequencies, then tanh, then the closed form, and equivalent viscous damping at resonance]"
        "(../images/advice-map.png)",
        "",
        "*The map shows the answers of `advise` on a grid with N = 40 N. Below F0 = 20 N nothing moves. For "
        "motions with stops, the simplest adequate model is usually Karnopp's model. The v0 of this model "
        "is 1 % of the largest speed. At some frequencies the simplest adequate model is friction "
        "regularized by tanh or arctan, with the same v0. Runs of these three models take at least as long "
        "as runs of the full model. For motions without stops, Den Hartog's formula is exact. Near "
        "resonance equivalent viscous damping is adequate.*",
        "",
    ]
    return "\n".join(lines)


def draw_map() -> None:
    """The map on a grid."""
    from hybridsim.plot import advice, save

    found = hs.advise(
        "dfcs",
        "amplitude.x",
        TOL,
        over={"F0": np.linspace(0.5 * N, 1.5 * N, 17), "omega": NATURAL * np.linspace(0.05, 2.0, 25)},
        workers=1,
    )
    save(advice(found), PICTURE)


if __name__ == "__main__":
    text = study(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
    print(text)
    if len(sys.argv) == 1:
        PAGE.write_text(text, encoding="utf-8")
        draw_map()
