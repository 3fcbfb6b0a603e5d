"""Measure the order at which time stepping approaches the results of methods that locate events.

    python docs/studies/moreau.py

Writes docs/studies/moreau.md and docs/images/moreau.png. There are ten scenes, half with dry friction and half with
impacts. Chains of up to a thousand blocks that rub on a belt and collide follow.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from integrators.fixed_step.impact_models import balls, pendulum, shaken

import hybridsim as hs
from hybridsim.plot.shared import style

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies" / "moreau.md"
PICTURE = ROOT / "docs" / "images" / "moreau.png"
LEVELS = 7  # steps are halved this often less one
NEIGHBOURS = (
    6  # of each step, over which errors are averaged, since the place of an impact in its step is random
)
BLOCKS = (10, 100, 1000)
GAP, STEP, SPAN = 0.1, 2e-3, 30.0  # of the chains
POINTS = 400_001  # times at which errors are taken, closer than the finest step


@dataclass(frozen=True)
class Scene:
    """A model over a span, its number of coarsest steps, and the names of its positions and velocities."""

    name: str
    model: Callable[[], hs.Model] | str
    end: float
    steps: int
    parameters: dict[str, float]
    positions: tuple[str, ...]
    velocities: tuple[str, ...]


FRICTION = (
    Scene("free-decay", "free-decay", 20.0, 500, {}, ("x",), ("v",)),
    Scene("dfcs", "dfcs", 0.0592, 250, {"F0": 30.0}, ("x",), ("v",)),
    Scene("belt", "belt", 50.0, 1000, {}, ("x",), ("v",)),
    Scene("static-kinetic", "static-kinetic", 12.0, 1000, {}, ("e",), ("v",)),
    Scene("base-isolation", "base-isolation", 10.0, 1000, {}, ("x", "d"), ("v", "w")),
)
IMPACTS = (
    Scene("vibrating-table", "vibrating-table", 1.0, 1000, {}, ("h",), ("w",)),
    Scene("thrown-block", "thrown-block", 2.0, 1000, {}, ("x", "h"), ("u", "w")),
    Scene("two balls", balls, 0.9, 1000, {}, ("x", "y"), ("u", "v")),
    Scene("pendulum", pendulum, 3.0, 1000, {}, ("th",), ("om",)),
    Scene("shaken mass", shaken, 10.0, 1000, {}, ("x", "y"), ("v", "w")),
)


@dataclass(frozen=True)
class Found:
    """Steps (L,), relative errors (L,): largest of positions, mean of velocities; changes of mode; seconds."""

    scene: Scene
    steps: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    events: int
    seconds: float

    def order(self, errors: np.ndarray) -> float:
        """The exponent with which errors decrease with the step."""
        return float(np.polyfit(np.log(self.steps), np.log(errors), 1)[0])


def measure(scene: Scene) -> Found:
    """Errors of one scene over the steps."""
    model = (hs.load(scene.model) if isinstance(scene.model, str) else scene.model()).with_(
        **scene.parameters
    )
    reference = hs.simulate(model, (0, scene.end), rtol=1e-11)
    assert reference.success, reference
    times = np.linspace(0, scene.end, POINTS)
    names = [reference.names.index(n) for n in (*scene.positions, *scene.velocities)]
    truth = reference(times)[names]
    scale = np.abs(truth).max(axis=1)[:, None]
    count = len(scene.positions)
    steps, positions, velocities = np.zeros((3, LEVELS))
    seconds = 0.0
    for level in range(LEVELS):
        for k in range(NEIGHBOURS):
            step = scene.end / (scene.steps * 2.0 ** (level + k / NEIGHBOURS))
            sol = hs.simulate(model, (0, scene.end), integrator="moreau", step=step)
            assert sol.success and not sol.warnings, sol
            off = np.abs(sol(times)[names] - truth) / scale
            steps[level] += math.log(step) / NEIGHBOURS
            positions[level] += off[:count].max() / NEIGHBOURS
            velocities[level] += off[count:].mean(axis=1).max() / NEIGHBOURS
            seconds = sol.stats["wall_time"]
    return Found(scene, np.exp(steps), positions, velocities, len(reference.events), seconds)


def chain(blocks: int) -> tuple[str, str]:
    """Rows of the tables of chains, with the results and the energy of a run of blocks that rub and collide."""
    system = hs.chain_on_belt(blocks, gap=GAP, spread=0.49 * GAP)
    sol = hs.simulate(system, (0, SPAN), integrator="moreau", step=STEP)
    assert sol.success, sol
    gained = energy(system, sol.x_end) - energy(system, sol(0.0))
    work = sol.work
    assert work["friction"] < 0.0 and work["impacts"] < 0.0, work
    least = np.diff(sol.y[:blocks], axis=0).min() + GAP
    assert least > -0.75 * STEP * np.max(-np.diff(sol.y[blocks:], axis=0))
    stats = sol.stats
    unsettled = sol.warnings[0] if sol.warnings else "none"
    return (
        f"| {blocks} | {sol.status} | {unsettled} | {stats['bounces']} | {stats['events']} | "
        f"{1e6 * stats['kernel_time'] / stats['steps']:.0f} | {stats['sweeps'] / stats['steps']:.1f} | {least:.1e} |",
        f"| {blocks} | {work['bases']:.4g} | {work['friction']:.4g} | {work['impacts']:.3g} | {gained:.4g} | "
        f"{abs(sum(work.values()) - gained) / work['bases']:.0e} |",
    )


def energy(system: hs.MechanicalSystem, x: np.ndarray) -> float:
    """Kinetic and elastic energy."""
    q, v = np.split(x, 2)
    return float(0.5 * v @ (system.M @ v) + 0.5 * q @ (system.K @ q))


def picture(groups: tuple[list[Found], list[Found]]) -> None:
    """Errors over the step, in units of the coarsest one, with the slope of first order."""
    figure = style.figure(style.BROAD, 6.8)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, (found, title) in enumerate(zip(groups, ("dry friction", "impacts"), strict=True)):
        for column, (what, text) in enumerate(
            (("positions", "largest error of positions"), ("velocities", "mean error of velocities (L1)"))
        ):
            axes = panels[row, column]
            for k, one in enumerate(found):
                axes.loglog(
                    one.steps / one.scene.end, getattr(one, what), color=style.PALETTE[k], marker=style.MARKERS[k],
                    ms=4, lw=1.2, label=one.scene.name,
                )  # fmt: skip
            ends = np.array(
                [min(f.steps[-1] / f.scene.end for f in found), max(f.steps[0] / f.scene.end for f in found)]
            )
            for level in (0.3, 30.0):
                axes.loglog(ends, level * ends, color=style.GREY, lw=1.0, ls="--", zorder=1)
            axes.set_title(f"{title}: {text}", fontsize=10, loc="left")
            style.dress(axes)
            if column == 0:
                axes.set_ylabel("relative error")
                handles = [
                    *axes.get_legend_handles_labels()[0],
                    Line2D([], [], color=style.GREY, ls="--", lw=1.0),
                ]
                axes.legend(
                    handles, [*(f.scene.name for f in found), "first order"], fontsize=8, loc="lower right"
                )
            if row == 1:
                axes.set_xlabel("step / span")
    style.save(figure, PICTURE)


def table(found: list[Found]) -> str:
    """A row for each scene."""
    return "\n".join(
        f"| {f.scene.name} | {f.events} | {f.order(f.positions):.2f} | {f.order(f.velocities):.2f} | "
        f"{f.steps[-1]:.2g} | {f.positions[-1]:.1e} | {f.velocities[-1]:.1e} | {f.seconds:.2f} |"
        for f in found
    )


def main() -> None:
    """Measure, draw, write the page."""
    groups: tuple[list[Found], list[Found]] = ([], [])
    for group, scenes in zip(groups, (FRICTION, IMPACTS), strict=True):
        for scene in scenes:
            group.append(measure(scene))
            print(table(group[-1:]), flush=True)
    picture(groups)
    runs, works = zip(*(chain(n) for n in BLOCKS), strict=True)
    every = [f.order(e) for f in (*groups[0], *groups[1]) for e in (f.positions, f.velocities)]
    PAGE.write_text(
        TEXT.format(
            friction=table(groups[0]),
            impacts=table(groups[1]),
            runs="\n".join(runs),
            works="\n".join(works),
            gap=GAP,
            step=STEP,
            span=SPAN,
            least=min(every),
            most=max(every),
            levels=LEVELS,
            neighbours=NEIGHBOURS,
        ),
        encoding="utf-8",
    )
    print(PAGE)


TEXT = """# At which order does time stepping converge?

At which order of the step does time stepping converge? All orders of `moreau` lie between {least:.2f} and
{most:.2f}, in ten scenes with friction and impacts.

The integrator `moreau` does not locate events, and selects modes in its own way. The
script `python docs/studies/moreau.py` runs ten scenes with {levels} step sizes. Each step size is half of the
previous one. The reference is `exact` or `taylor` at rtol 1e-11, which locate every event. The place of an impact
within its step is random, so single errors scatter. Each error is therefore a mean over {neighbours} neighbouring
step sizes.

![Errors over the step](../images/moreau.png)

For positions the table gives the largest error at any time. Velocities jump at impacts. If a jump is one step late,
the error of the velocity during this step is the whole jump. For velocities the table therefore gives the mean
error over the time. The errors of positions and velocities are relative to the largest value, and are for the finest
step. The order is the slope of the error over all steps.

| dry friction | changes of mode | order of x | order of v (L1) | finest step | error of x | error of v | seconds |
| --- | --- | --- | --- | --- | --- | --- | --- |
{friction}

| impacts | impacts and changes | order of x | order of v (L1) | finest step | error of x | error of v | seconds |
| --- | --- | --- | --- | --- | --- | --- | --- |
{impacts}

In `dfcs` the errors are of second order. In the step of a stop, the friction impulse removes exactly the momentum
of the body. At a release the friction force does not jump, because static and kinetic friction are equal. Other
scenes have errors of first order, for these reasons:

- At a reversal without a stop the body sticks for one step, as in `free-decay`.
- A friction force that depends on the speed is evaluated at the end of the step, as in `belt`.
- The time of an impact is accurate to one step only, as in all scenes with impacts.

No scene has a grazing impact. The time of a grazing impact depends on the square root of a parameter. The error of a
grazing impact would therefore be larger.

The scenes with impacts have these motions:

- *vibrating table*: a table throws a ball repeatedly. Each flight ends in an accumulation of bounces, after which
  the ball rests on the table.
- *thrown block*: each impact loads the friction contact. The block slides after the last impact, and then sticks.
- *two balls*: one ball is above the other. The lower ball bounces, and the upper ball falls on it.
- *pendulum*: the gap is nonlinear in all states. The pendulum bounces and comes to rest.
- *shaken mass*: a mass moves between two stops. A spring connects the mass to a block that sticks and slips on a
  belt.

## Chains that collide

`hs.chain_on_belt(n, gap={gap:g})` has n blocks of mass 1 on a belt. The friction force of each block is 1/(1 +
3|v|), where v is the slip velocity. Springs connect neighbouring blocks. If the spring between two blocks is
compressed by {gap:g}, these blocks collide with the restitution e = 0.5. The run lasts {span:g} units of time in
steps of {step:g}. Friction and impacts act on the same blocks. Each step therefore solves one problem with n
friction contacts and n - 1 gaps. A step counts as unsettled if its impulses did not converge to 1e-12 of the
largest impulse. Times are on one core of a machine that also ran other programs.

| n | status | unsettled | bounces | changes of mode | us per step | sweeps per step | least gap |
| --- | --- | --- | --- | --- | --- | --- | --- |
{runs}

| n | work of the belt | of friction | of impacts | gain of energy | missing / belt |
| --- | --- | --- | --- | --- | --- |
{works}

With the option `theta` = 1/2, the sum of all works in a step equals the gain of kinetic and elastic energy. The
last column gives the error of this balance, relative to the work of the belt. This error consists of rounding
errors. The works of friction and impacts are negative, so neither of them adds energy. A contact becomes active in
the first step in which its gap would close by the middle of the step. A gap may therefore become negative. This
overlap is at most 1 - e/2 times the distance that the two blocks approach in a step. No overlap in this study
exceeds this limit.
"""


if __name__ == "__main__":
    main()
