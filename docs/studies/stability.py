"""Where methods with a fixed step or a zone around zero velocity are right: boundaries in the plane (step, zone).

    python docs/studies/stability.py [coarse]      (six minutes on two cores; progress on stderr)

Writes docs/studies/stability.md and docs/images/stability-*.png.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
from stability_pictures import Map, chatter, maps, moves
from stability_runs import (
    KARNOPP,
    KEPT,
    MAPPED,
    OFFSETS,
    PAPER_EPS,
    PAPER_STEPS,
    SIGN,
    TANH,
    ZEROED,
    Case,
    Method,
    belt,
    dfcs,
    edges,
    logs,
    mapped,
    tell,
)

import hybridsim as hs

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies" / "stability.md"
IMAGES = ROOT / "docs" / "images"
RATIOS, SHARES = (0.3, 0.6, 0.8, 1.4), (0.54, 0.6, 0.75, 1.0)
MOVED = (ZEROED, KEPT, TANH)


def plane(case: Case, method: Method, count: int) -> Map:
    """Errors over the plane, on a grid of so many by so many; fewer with Karnopp's band, whose events are slow."""
    count = max(8, count // 2) if method is KARNOPP else count
    low = {TANH: 1e-5, KARNOPP: 1e-4}.get(method, 1e-8)
    steps, zones = logs(5.0, 6000.0, count), logs(low, 3.0, count)
    return (steps, zones, *mapped(case, method, steps, zones))


def adaptive(case: Case, widths: np.ndarray) -> list[tuple[float, float, float]]:
    """`dop853` on the tanh law at rtol 1e-6: width, error of the amplitude, steps a period."""
    rows = []
    for width in widths.tolist():
        model = case.regularized("tanh", width * case.fastest)
        t0 = float(case.orbit.t[0])
        span = (t0, t0 + 40 * case.period)
        sol = hs.simulate(
            model, span, x0=case.orbit(t0), integrator="dop853", rtol=1e-6, keep=10 * case.period
        )
        x = sol(np.linspace(span[1] - case.period, span[1], 4001))[0]
        rows.append((width, float(np.ptp(x)) / 2 / case.amplitude - 1, sol.stats["steps"] / 40))
    return rows


def main() -> None:
    """Run all, draw, write the page."""
    began, coarse = time.perf_counter(), sys.argv[1:] == ["coarse"]
    count, fewer = (12, 7) if coarse else (20, 11)
    reference, block = dfcs(), belt()
    share = PAPER_EPS / reference.fastest
    for case, star, name in (
        (reference, (share, "T/1200 and 8e-4 m/s"), "dfcs"),
        (block, (share, f"T/1200 and {100 * share:.2f} % of the speed"), "belt"),
    ):
        found = {method.name: plane(case, method, count) for method in MAPPED}
        maps(case, found, star, IMAGES / f"stability-{name}.png")
    by_ratio, by_share = [dfcs(ratio=r) for r in RATIOS], [dfcs(share=f) for f in SHARES]
    groups = {
        says: [(case, {m.name: plane(case, m, fewer) for m in MOVED}) for case in cases]
        for says, cases in (("r", by_ratio), ("F0/N", by_share))
    }
    moves(groups, MOVED, IMAGES / "stability-moves.png")
    ridge = dfcs(0.64, 0.55)  # P2, where the published map is highest
    every = [*by_share, *(case for case in by_ratio if case.name != reference.name), ridge, block]
    steps = logs(20.0, 12000.0, 9 if coarse else 25)
    chatter(
        {c.name: (steps, np.array([c.verdict(SIGN, n)[0] for n in steps])) for c in every},
        IMAGES / "stability-sign.png",
    )
    table = {}
    for case in every:
        table[case.name] = {method.name: edges(case, method) for method in (*MAPPED, SIGN)}
        tell(case.name, table[case.name])
    PAGE.write_text(page(every, table, adaptive(reference, logs(1e-4, 1e-1, 4))), encoding="utf-8")
    tell(PAGE, f"{time.perf_counter() - began:.0f} s")


def percent(share: float) -> str:
    """A share of the largest speed."""
    return "none" if math.isnan(share) else f"{100 * share:.2g} %"


def whole(steps: float) -> str:
    """A number of steps."""
    return "none" if math.isnan(steps) else f"{steps:.0f}"


def verdict(case: Case, method: Method) -> str:
    """What the published setting gives."""
    error, excess = case.worst(method, PAPER_STEPS, PAPER_EPS / case.fastest)
    stops = "" if abs(excess) < 1e-9 else f", {excess:+.1f} stops"
    return f"{100 * error:+.2f} %{stops}"


def page(
    every: list[Case],
    table: dict[str, dict[str, tuple[float, float]]],
    rows: list[tuple[float, float, float]],
) -> str:
    """The page, with its figures."""
    heads = " | ".join(f"{m.name}" for m in (*MAPPED, SIGN))
    rule = " | ".join(["---"] * 6)
    zones = "\n".join(
        f"| {c.name} | " + " | ".join(percent(table[c.name][m.name][0]) for m in MAPPED) + " | "
        f"{'' if c.belt_speed else percent(PAPER_EPS / c.fastest)} |"
        for c in every
    )
    fewest = "\n".join(
        f"| {c.name} | " + " | ".join(whole(table[c.name][m.name][1]) for m in (*MAPPED, SIGN)) + " |"
        for c in every
    )
    published = "\n".join(
        f"| {c.name} | " + " | ".join(verdict(c, m) for m in (*MAPPED, SIGN)) + " |"
        for c in every
        if not c.belt_speed
    )
    theories = "\n".join(
        f"| {c.name} | {percent(c.early_stop())} | {percent(table[c.name]['zeroed'][0])} | {percent(c.creep())} | "
        f"{percent(table[c.name]['kept'][0])} | {whole(c.late_release())} | {whole(table[c.name]['zeroed'][1])} |"
        for c in every
        if c.stops and not c.belt_speed
    )
    adaptives = "\n".join(f"| {100 * w:g} % | {100 * e:+.2f} % | {n:.0f} |" for w, e, n in rows)
    return f"""# Where fixed steps and zones around zero velocity are right

A fixed step h and a zone around v = 0 (eps_v of `rk4-dichotomy`, v0 of a regularised law) are chosen by the user.
Which choices are right? Here the boundary is measured, for the reference model (`dfcs`, at several r and F0/N) and
for the block on a `belt`. Made by `python docs/studies/stability.py`.
r = 0.6 with F0/N = 0.75 is P1 of the [comparison](../explanation/comparison.md), r = 0.64 with F0/N = 0.55 its P2.

Each point is a run that starts on the exact steady motion (`exact` for the reference model, `steady_state` for the
belt), lasts 40 periods (12 with Karnopp's band, 100 with `rk4-sign`) and is read over its last 10 (4, 50).
**Right** means: no period's amplitude of x is off by more than 1 %, and the stops are as many as they should be.
Zones are given as shares of
the largest speed relative to what is rubbed on.

## What to choose

This holds for the two systems measured here, a body on a spring with Coulomb friction that is driven harmonically, and
a block on a belt, whose friction falls with the speed. It is no rule for others: a body that drifts, static friction
with a drop to a kinetic one, or several contacts may need a narrower zone than the table allows; run with half of it
and compare. Impacts are not the subject of this page.

| method | zone, as a share of the largest speed | steps per period, at least | beyond |
| --- | --- | --- | --- |
| `rk4-dichotomy`, velocity zeroed | eps_v 0.0001 % to 0.5 %; to 8 % if it sticks | 250 | early stops; early reversals |
| `rk4-dichotomy`, velocity kept | eps_v 0.0001 % to 0.1 % | 250 | the body creeps through its sticks |
| `rk4-sign` | none | 200 to more than 10^4 | chatter; no step is safe beforehand |
| RK4 with mu N tanh(v/v0) | v0 at most 0.05 % | h < 2.785 m v0/(mu N): 5000 to 50 000 here | creep; chatter |
| RK4 with Karnopp's dead band | v0 at most 1 % | 50 | early stops, late starts |

At a largest speed of 0.1 m/s a share of 0.5 % is eps_v = 5e-4 m/s: options take speeds in the model's own unit.

    hybridsim run dfcs --integrator rk4-dichotomy --option eps_v=5e-4 \\
        --option stick_velocity=zero --option steps_per_period=500

`stick_velocity=kept` is the other row. `model.regularized("tanh", v0=5e-5)` and `model.regularized("karnopp", v0=5e-4)`
are the regularised laws, for `rk4-sign` or any other integrator. tanh is refused where static friction is above the
kinetic one: a force that goes through zero has no peak at rest.

The largest speed is not known beforehand, and is small where a zone does most harm: just above the threshold of
motion. Run once, read the largest speed, and compare. Near the threshold (F0/N = 0.54) tanh takes 0.1 % or
less, which RK4 needs 26 000 steps a period for, or more, to be stable.
`exact`, `taylor` and `dop853` have neither choice.

## The plane

![Error of the reference model over step and zone, four methods](../images/stability-dfcs.png)

*`dfcs`, F0 = 30 N, r = 0.6. Right is to the right of and below the black line.*

![Error of the belt over step and zone, four methods](../images/stability-belt.png)

*`belt`; T = 12.0010 is the period of its limit cycle. The star has the share that 8e-4 m/s has in the picture
above.*

The widest zone up to which all are right, and what share 8e-4 m/s is:

| case | zeroed: eps_v | kept: eps_v | tanh: v0 | karnopp: v0 | 8e-4 m/s |
| --- | --- | --- | --- | --- | --- |
{zones}

Steps: 2000 a period, 20000 with tanh. "None": with the smallest width at which RK4 is stable there, the amplitude
is still more than 1 % off; narrower ones are right although they chatter, as the picture below shows.
The fewest steps per period above which all are right, with a third of that zone:

| case | {heads} |
| {rule} |
{fewest}

## The published setting

T/1200 and 8e-4 m/s (as v0 with tanh and Karnopp's band), error of the amplitude, and stops a period in excess where
there are any. What `rk4-dichotomy` makes of a stop depends on where in a step it falls: each figure is the worst of
{OFFSETS} runs whose steps begin so many equal parts of a step apart; the rest of the page has one such beginning.

| case | {heads} |
| {rule} |
{published}

With the velocity zeroed the published setting is inside everywhere: at most 4 % of the speed where 11 % would do.
With the velocity kept, as Eq. 4 reads, it is inside at r = 0.6 for F0/N = 0.75 and above and where the body never
sticks, and outside in every other case: the nearer the threshold, where the published map of deviations has its
ridge, the further. As v0 of tanh it is outside in half of the cases. 1200 steps are five times what the dichotomy
needs, and do not help against a zone that is too wide; `rk4-sign` may need ten times more.

![How the boundary moves with r and F0/N](../images/stability-moves.png)

*Lines of 1 % error of the amplitude. Two lines one above the other, at v0 near the largest speed, are where the
error of tanh changes its sign: right by accident.*

As a share of the speed the limit of the zeroed velocity hardly moves: 9 to 15 % wherever the body sticks, 1 to 2 %
where it only turns round. That of the kept one is 0.2 to 0.8 %, narrowest where the sticks are long; that of tanh
goes from 0.15 % to 2.3 % with no such rule. In m/s all shrink with the speed: at r = 0.6, from F0/N = 0.75 to 0.54,
the zeroed one from 0.034 to 0.0022 m/s, the kept one from 1.8e-3 to 4e-5 m/s.

![Error of rk4-sign over the step](../images/stability-sign.png)

## Why each region ends where it ends

X is the amplitude, V the largest speed, a the deceleration into a stop, t_stick how long it lasts. G maps a stop to
the place of the next one: G_x is its derivative with respect to the place, G_v to an outward speed at the release.

**Velocity zeroed, zone too wide: stops come early.** Stopped at eps_v, the body misses eps_v^2/(2 a) of its way,
and so does every stop: eps_v^2/(2 a) = 0.01 X (1 - G_x). The belt's extreme of x comes before the stop, where its
relative speed is the belt's: there (eps_v - v_belt)^2/(2 a) = 0.02 X, which is 41 % of V, against 36 % measured.
With eps_v above V the body is held as soon as the applied force allows: false stick, and the amplitude is off by 75
%.

**Velocity kept, zone too wide: creep.** The body moves on at up to eps_v while it should stick, d = eps_v t_stick
too far, and begins its slip with eps_v the wrong way: eps_v (t_stick + (G_x t_stick + G_v)/(1 - G_x)) = 0.01 X. On
the belt, where the friction falls with the speed, a slip that begins with another speed grows apart from the true
one: 0.34 %.

| case | early stop: theory | measured | creep: theory | measured | late release: theory, at most | measured |
| --- | --- | --- | --- | --- | --- | --- |
{theories}

The theory of creep takes the whole of eps_v for the velocity that is kept; it lies between none and that.

**No stop at all** (F0/N = 1 at r = 0.6, F0/N = 0.75 at r = 0.8): inside the zone Eq. 4 turns the friction to where
the force pushes, before the body has turned. The reversal comes late by m eps_v (1/(e - mu N) - 1/(e + mu N)), e
being the applied force: first order in eps_v, and 1 % of V is too much already. From 4 % of V on the body is held
where it should turn (F0/N = 1).

**Zone too narrow.** 16 halvings leave a speed of a h/2^16 (dotted line). Below it the method goes on from a speed
that is outside the zone. On the reference model that costs nothing, with a step that is right at all; on the belt,
with fewer than some 90 steps a period, sticks are missed.

**Step too long: late release, missed stops.** A release is taken at the end of its step. A whole step late, the
slip ends elsewhere by what the column above allows for; the measured limit lies below, as it is rarely a whole
step. Below 10 steps a period stops are missed: velocities at both ends of a step have one sign, or the dichotomy's
state is past the next release. On the belt the trial step asks for the friction of the old side beyond v = 0, where
1/(1 + delta v) has its pole at v = -1/delta: reached when h > 1/(delta a), which is 55 steps a period, and below
some 30 the motion grows without bound.

**`rk4-sign`: chatter.** What should be stick is a zigzag of speeds up to 2 mu N h/m; the error is of first order in
h, and larger the closer the amplitude is to nothing.

**tanh: creep above, instability below.** The body that should stick creeps at v0 artanh(e/(mu N)). The steepest
part of the law has the rate mu N/(m v0), and classic RK4 damps h times it up to 2.785: the dotted line. Beyond it
the velocity zigzags, and the amplitude goes wrong later: the force is bounded by mu N, so that what is left is
`rk4-sign` with the same step, whose limit the black line comes to at small v0. An adaptive method finds its own
step; `dop853` at rtol = 1e-6, reference model:

| v0/V | error of the amplitude | steps per period |
| --- | --- | --- |
{adaptives}

**Karnopp's band** is entered at v0 and stops early, as with the zeroed velocity, and its limit is the same where
the body sticks. Its events are located, so that the step matters least. On the belt it must first cross the band at
the limit force, and starts late: 1.1 %.

"""


if __name__ == "__main__":
    main()
