"""Measure the limits of methods with a fixed step or a zone around zero velocity, in the plane (step, zone).

    python docs/studies/stability.py [coarse]      (six minutes on two cores, with progress on stderr)

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
    return f"""# Limits of fixed steps and of zones around zero velocity

How long may a fixed step be, and how wide may a zone around zero velocity be? Here `rk4-dichotomy` needs 250 steps
per period and a zone of at most 0.5 % of the largest speed. These values hold if the method sets the velocity to
zero in stick. A table below has the values for all methods.

For methods with a fixed step you choose the step h and the width of a zone around v = 0. In this zone the velocity
counts as zero. The width of the zone is eps_v of `rk4-dichotomy`, or v0 of a regularized law. The script `python
docs/studies/stability.py` measures the limits of step and zone. The two systems are the reference model `dfcs` and
the block on a `belt`. The model `dfcs` has several values of two ratios. The ratio r = omega/omega_n is that of the
frequencies, and F0/N is that of the forcing to the normal load. The case r = 0.6 with F0/N = 0.75 is P1 of the
[comparison](../explanation/comparison.md). The case r = 0.64 with F0/N = 0.55 is P2.

Each run starts on the exact steady motion. `exact` computes this motion for the reference model, and `steady_state`
for the belt. The run lasts 40 periods, of which the last 10 are evaluated. With Karnopp's band the run lasts 12
periods, of which the last 4 are evaluated. With `rk4-sign` the run lasts 100 periods, of which the last 50 are
evaluated. A run is **right** if the number of stops is correct and the amplitude is within 1 % in each evaluated
period. The width of a zone is given as a share of the largest relative speed.

## Recommended values

These values hold for the two systems of this study. One system is a body on a spring with Coulomb friction and
harmonic forcing. The other system is a block on a belt with friction that decreases with the speed. Other systems
may need a narrower zone. Examples are a body that drifts, static friction above kinetic friction, and several
contacts. For such a system, compare a run with a second run whose zone has half the width. This page does not cover
impacts.

| method | zone, as a share of the largest speed | steps per period, at least | beyond |
| --- | --- | --- | --- |
| `rk4-dichotomy`, velocity zeroed | eps_v 0.0001 % to 0.5 %; to 8 % if it sticks | 250 | early stops; early reversals |
| `rk4-dichotomy`, velocity kept | eps_v 0.0001 % to 0.1 % | 250 | the body creeps through its sticks |
| `rk4-sign` | none | 200 to more than 10^4 | chatter; no step is safe beforehand |
| RK4 with mu N tanh(v/v0) | v0 at most 0.05 % | h < 2.785 m v0/(mu N): 5000 to 50 000 here | creep; chatter |
| RK4 with Karnopp's dead band | v0 at most 1 % | 50 | early stops, late starts |

The option `eps_v` is a speed in the unit of the model. If the largest speed is 0.1 m/s, a share of 0.5 % is eps_v =
5e-4 m/s:

```bash
hybridsim run dfcs --integrator rk4-dichotomy --option eps_v=5e-4 \\
    --option stick_velocity=zero --option steps_per_period=500
```

`stick_velocity=kept` selects the method in the row with the kept velocity. The models `model.regularized("tanh",
v0=5e-5)` and `model.regularized("karnopp", v0=5e-4)` have regularized laws. These models run with `rk4-sign` or any
other integrator. The law `tanh` supports only models whose static friction does not exceed kinetic friction. With
other models `tanh` raises an error.

You do not know the largest speed in advance. Just above the threshold of motion this speed is small, and a zone
then causes the largest errors. Run the model once, read the largest speed, and compare the zone with it. Near the
threshold (F0/N = 0.54) tanh needs a v0 of 0.1 % or less. RK4 is then stable only with 26 000 or more steps per
period. With `exact`, `taylor` and `dop853` you choose neither a step nor a zone.

## Maps of step and zone

![Error of the reference model over step and zone, four methods](../images/stability-dfcs.png)

*`dfcs`, F0 = 30 N, r = 0.6. Correct runs are below the black line and to the right of it.*

![Error of the belt over step and zone, four methods](../images/stability-belt.png)

*`belt`, with the period T = 12.0010 of its limit cycle. In the picture above the star marks the published width of
8e-4 m/s.*

The table gives the largest width up to which all runs are right. The last column gives the published width of 8e-4
m/s as a share of the largest speed.

| case | zeroed: eps_v | kept: eps_v | tanh: v0 | karnopp: v0 | 8e-4 m/s |
| --- | --- | --- | --- | --- | --- |
{zones}

These runs have 2000 steps per period, and 20000 with tanh. "None" means that the error exceeds 1 % at the smallest
width at which RK4 is stable. With tanh, runs in still narrower zones may be right although the velocity chatters,
as the picture below shows.

The next table gives the number of steps per period above which all runs are right. In this table the zone has a
third of the width in the table above.

| case | {heads} |
| {rule} |
{fewest}

## The published setting

The published setting is a step of T/1200 and a zone of 8e-4 m/s (v0 for tanh and Karnopp's band). The table gives
the error of the amplitude. If a run has additional stops, the table also gives their number per period. The result
of `rk4-dichotomy` depends on the place of a stop within a step. Each value is therefore the worst of {OFFSETS}
runs, whose starts are shifted by equal parts of a step. All other results of this page are from one run each.

| case | {heads} |
| {rule} |
{published}

If the velocity is set to zero, the published setting is right in every case. The published zone is at most 4 % of
the largest speed. In the case with a zone of 4 %, even a zone of 11 % would be right. If the velocity is kept, as in
Eq. 4 of the paper, the setting is right for a body that never sticks. With the kept velocity it is also right for r
= 0.6 with F0/N = 0.75 and above. This setting is wrong in every other case. The error grows towards the threshold of
motion, where the map of the paper has its largest values. For tanh with v0 = 8e-4 m/s, half of the results are
wrong. The method `rk4-dichotomy` needs only a fifth of the 1200 steps. If the zone is too wide, more steps do not
help. The method `rk4-sign` may need ten times as many steps as the published setting.

![How the boundary moves with r and F0/N](../images/stability-moves.png)

*On each line the error of the amplitude is 1 %. For some zones nearly as wide as the largest speed, tanh has two
lines, one above the other. Between these lines the error changes its sign, so a run between them is right by accident.*

If the velocity is set to zero, the limit of the zone is an almost constant share of the largest speed. This share is
9 to 15 % if the body sticks, and 1 to 2 % if the body only reverses. If the velocity is kept, the limit is 0.2 to
0.8 %. This limit is smallest for long sticks. For tanh the limit is 0.15 % to 2.3 %, and follows no such rule. In
m/s, a limit is smaller if the largest speed is smaller. An example is the case r = 0.6. If F0/N decreases from 0.75
to 0.54, the limit for the velocity set to zero decreases from 0.034 to 0.0022 m/s. The limit for the kept velocity
decreases from 1.8e-3 to 4e-5 m/s.

![Error of rk4-sign over the step](../images/stability-sign.png)

## Reasons for the limits

Let X be the amplitude, V the largest speed, a the deceleration before a stop, and t_stick the duration of the stop. G
maps the place of a stop to the place of the next stop. G_x is the derivative of G with respect to the place. G_v is
the derivative of G with respect to an outward speed at the release.

**Velocity set to zero, zone too wide.** Stops are too early. If the method stops a body at the speed eps_v, the
position of the stop has an error of eps_v^2/(2 a). This error occurs at every stop. The error of the amplitude
reaches 1 % at eps_v^2/(2 a) = 0.01 X (1 - G_x). On the belt the extreme of x is reached before the stop, when the
relative speed is that of the belt. On the belt the limit is therefore at (eps_v - v_belt)^2/(2 a) = 0.02 X. This
limit is 41 % of V, and the measured limit is 36 %. If eps_v is above V, the body sticks as soon as the applied force
permits stick. This false stick causes an error of the amplitude of 75 %.

**Velocity kept, zone too wide.** The body creeps in stick. When the body should stick, it moves at a speed of up to
eps_v, by the distance eps_v t_stick. The body then begins its slip with the speed eps_v in the wrong direction. The
limit of the zone is at eps_v (t_stick + (G_x t_stick + G_v)/(1 - G_x)) = 0.01 X. On the belt the friction decreases
with the speed. A slip that begins with a wrong speed moves away from the true slip. The limit on the belt is
therefore 0.34 %.

| case | early stop: theory | measured | creep: theory | measured | late release: theory, at most | measured |
| --- | --- | --- | --- | --- | --- | --- |
{theories}

The theory of creep assumes that the kept velocity is eps_v. The kept velocity is in fact between zero and eps_v.

**No stop at all** (F0/N = 1 at r = 0.6, F0/N = 0.75 at r = 0.8). In the zone, Eq. 4 lets the friction force oppose
the applied force e. The friction force therefore reverses before the velocity. The reversal of the velocity is late
by m eps_v (1/(e - mu N) - 1/(e + mu N)). This error is of first order in eps_v, and a zone of 1 % of V is already
too wide. If the zone is 4 % of V or wider, the body sticks at the reversal (F0/N = 1).

**Zone too narrow.** The dichotomy halves the step 16 times at most. After 16 halvings the speed is up to a h/2^16
(dotted line). If the zone is narrower than this speed, the method continues with a speed outside the zone. In the
reference model such a speed has no effect if the step is short enough. On the belt, with fewer than about 90 steps
per period, sticks are missed.

**Step too long.** Releases are late, and stops are missed. A release is placed at the end of its step. If the
release is a whole step late, the slip ends at another place. The column "late release" of the table above gives the
resulting limit. The measured limit is lower, because a release is rarely a whole step late. With fewer than 10
steps per period, stops are missed for two reasons. The velocities at both ends of a step have the same sign, or the
state after the bisection is beyond the next release. On the belt a trial step beyond v = 0 still uses the friction
law for the side before v = 0. This law, 1/(1 + delta v), has a pole at v = -1/delta. The step reaches the pole if h
> 1/(delta a), which is the case with fewer than 55 steps per period. With fewer than about 30 steps the motion
grows without bound.

**`rk4-sign`.** The velocity chatters. In place of stick, the velocity changes its sign in each step, with speeds up
to 2 mu N h/m. The error of the amplitude is of first order in h. This error is larger for smaller amplitudes.

**tanh.** If v0 is too large, the body creeps. If v0 is too small, RK4 is unstable. A body that should stick creeps
at the speed v0 artanh(e/(mu N)). At v = 0 the law has its largest rate, mu N/(m v0). Classic RK4 is stable if its
step h times this rate is at most 2.785 (dotted line). If v0 is smaller (below the dotted line), the velocity
chatters. The amplitude becomes wrong only at a still smaller v0. The friction force is bounded by mu N. For very
small v0 the result with tanh is therefore the same as with `rk4-sign`. Both methods then need the same number of
steps.

An adaptive method chooses its own step. The table is for `dop853` at rtol = 1e-6 and the reference model.

| v0/V | error of the amplitude | steps per period |
| --- | --- | --- |
{adaptives}

**Karnopp's band.** The body enters the band at the speed v0. Stops are therefore too early, as with the velocity
set to zero. If the body sticks, the limit of Karnopp's band is also the same as with the velocity set to zero. The
events are located, so the step has almost no effect. On the belt the body first has to cross the band, while the
friction force is at its limit. The slip of the body is therefore late, and the limit is 1.1 %.
"""


if __name__ == "__main__":
    main()
