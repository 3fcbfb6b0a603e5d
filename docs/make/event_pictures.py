"""Draw the pictures of docs/explanation/events.md: ends of modes, releases, an accumulation, pasts that are many.

    python docs/make/event_pictures.py

Writes docs/images/event-*.svg. What they show is computed: events by runs, the chance of signs by plain arithmetic.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpmath import mp

import hybridsim as hs
from hybridsim.plot.shared import style

IMAGES = Path(__file__).parents[2] / "docs" / "images"
BLUE, ORANGE, GREEN = style.PALETTE[:3]


def draw_domains() -> None:
    """Four guards over one step of an integrator, and where their modes end."""
    cases = {
        "goes below zero": "0.6 - t",
        "touches zero and turns back": "(t - 0.5)**2",
        "is zero at the start and rises": "t*(1.5 - t)",
        "goes below zero and comes back": "1.8*(t - 0.4)*(t - 0.7)",
    }
    figure = style.figure(style.WIDTH, 4.6)
    t = np.linspace(0, 1, 501)
    grid = figure.subplots(2, 2, sharex=True)
    for axes, (title, guard) in zip(grid.ravel(), cases.items(), strict=True):
        model = hs.Model(
            "one-guard",
            states=[hs.State("x", 0, "1")],
            components=[
                hs.Component(
                    "c",
                    [hs.Mode("inside", hs.Guard("g", guard, "after")), hs.Mode("after")],
                    initial="inside",
                )
            ],
        )
        events = [
            e.t for e in hs.simulate(model, (0, 1), integrator="dop853").events if e.kind == "transition"
        ]
        values = np.array([value_of(guard, s) for s in t])
        style.dress(axes)
        axes.axhspan(-1, 0, color="#f3e3da", linewidth=0)
        axes.axhline(0, color=style.INK, linewidth=0.8)
        axes.plot(t, values, color=BLUE, linewidth=1.8)
        axes.plot(
            [0, 1],
            values[[0, -1]],
            linestyle="none",
            marker="o",
            color=style.INK,
            markersize=5,
            clip_on=False,
            zorder=5,
        )
        for at in events:
            axes.plot(at, 0, marker="v", color=ORANGE, markersize=10, zorder=6)
        outcome = f"ends at t = {events[0]:.1f}" if events else "goes on"
        is_seen = np.sign(values[0]) != np.sign(values[-1])
        test = "right" if is_seen == bool(events) else "wrong"
        axes.set_title(f"{title}:\nmode {outcome}; test of signs {test}", fontsize=9, loc="left")
        axes.set_ylim(-0.45, 0.75)
    for axes in grid[1]:
        axes.set_xlabel("time t (one step)", fontsize=9)
    for axes in grid[:, 0]:
        axes.set_ylabel("guard g", fontsize=9)
    for axes in grid[:, 1]:
        axes.set_yticklabels([])
    style.save(figure, IMAGES / "event-domain.svg")


def value_of(guard: str, t: float) -> float:
    """The value of a guard of time."""
    from hybridsim.expr import evaluate, parse

    return evaluate(parse(guard), {"t": t})


def draw_releases() -> None:
    """The computed acceleration at four hundred releases, and its rate."""
    rng = np.random.default_rng(1)
    omega, turns = rng.uniform(5, 20, 400), rng.integers(0, 50, 400)
    force, limit, mass = 5.0, 3.0, 1.0
    with mp.workdps(40):  # the doubles next to the instants at which the load is the limit
        phase = mp.asin(mp.mpf(limit) / mp.mpf(force))
        release = np.array(
            [float((2 * mp.pi * int(k) + phase) / mp.mpf(w)) for w, k in zip(omega, turns, strict=True)]
        )
    acceleration = (force * np.sin(omega * release) - limit) / mass  # exactly zero in exact arithmetic
    rate = force * omega * np.cos(omega * release) / mass
    backward = acceleration < 0
    figure = style.figure(style.WIDTH, 3.4)
    left, right = figure.subplots(1, 2)
    for axes, values, unit in ((left, acceleration * 1e13, r"$10^{-13}$ m/s²"), (right, rate, "m/s³")):
        style.dress(axes)
        for chosen, colour, marker, label in (
            (~backward, BLUE, "o", "zero or above: slips"),
            (backward, ORANGE, "x", "below zero: sticks again"),
        ):
            axes.plot(
                release[chosen],
                values[chosen],
                linestyle="none",
                marker=marker,
                markersize=4,
                color=colour,
                label=label,
            )
        axes.axhline(0, color=style.INK, linewidth=0.8)
        axes.set_xlabel("time of the release [s]")
        axes.set_ylabel(("acceleration" if axes is left else "rate of the acceleration") + f" [{unit}]")
    left.set_title(
        f"The sign of the acceleration\nis wrong at {100 * backward.mean():.0f} % of the releases",
        fontsize=10,
        loc="left",
    )
    right.set_title(
        "The first derivative that is not zero\ndecides: its sign is always right", fontsize=10, loc="left"
    )
    right.set_ylim(0, None)
    style.legend_below(figure, left.get_legend_handles_labels()[0])
    style.save(figure, IMAGES / "event-release.svg")


def draw_accumulation() -> None:
    """Bounces of a ball, and the intervals between them up to their limit."""
    ball = hs.Model(
        "ball",
        parameters={"g": 9.81, "e": 0.7},
        states=[hs.State("h", 1, "w", nominal=1), hs.State("w", 0, "-g + p", nominal=1)],
        impacts=[hs.Impact("p", gap="h", restitution="e")],
    )
    sol = hs.simulate(ball, (0, 3.2))
    bounces = np.array([e.t for e in sol.events if e.target == "open"])
    rest = sol.modes["p"][-1].t0
    figure = style.figure(style.WIDTH, 3.0)
    left, right = figure.subplots(1, 2)
    t = np.linspace(0, 3.2, 3201)
    style.dress(left)
    left.plot(t, sol(t)[0], color=BLUE, linewidth=1.5)
    left.plot([rest, 3.2], [0, 0], color=style.INK, linewidth=4, solid_capstyle="butt")
    left.annotate(
        f"closed from t = {rest:.4f} s on",
        (rest, 0.01),
        (0.9, 0.7),
        fontsize=9,
        arrowprops={"arrowstyle": "->", "color": style.INK},
    )
    left.set_xlabel("time t [s]")
    left.set_ylabel("height h [m]")
    left.set_ylim(-0.04, 1.05)
    gaps = np.diff(bounces)
    gaps = gaps[gaps > 0]
    style.dress(right)
    right.semilogy(np.arange(1, len(gaps) + 1), gaps, linestyle="none", marker="o", markersize=3, color=BLUE)
    end = 1024 * np.spacing(rest)
    right.axhline(end, color=ORANGE, linewidth=1.2)
    right.text(2, 1.6 * end, "1024 units in the last place of t", fontsize=9, color=style.INK, va="bottom")
    right.set_xlabel("number of the bounce")
    right.set_ylabel("time to the next [s]")
    left.set_title("Infinitely many bounces in a finite time", fontsize=10, loc="left")
    right.set_title("The intervals fall to the resolution of t", fontsize=10, loc="left")
    style.save(figure, IMAGES / "event-accumulation.svg")


def draw_pasts() -> None:
    """Four motions that come to one state of rest."""
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 2, "-f", nominal=1)],
        contacts=[hs.Contact("f", velocity="v", normal=9.81, law="coulomb", arguments={"mu": 0.1})],
    )
    figure = style.figure(6.5, 3)
    axes = figure.subplots()
    style.dress(axes)
    t = np.linspace(0, 3, 601)
    for speed, colour in zip((2.2, 1.5, 0.7, -1.1), style.PALETTE, strict=False):
        axes.plot(t, hs.simulate(block, (0, 3), x0={"v": speed})(t)[1], color=colour, linewidth=1.8)
    axes.plot([2.25, 3], [0, 0], color=style.INK, linewidth=4, solid_capstyle="butt")
    axes.annotate(
        "from here, which way back?",
        (2.9, 0.03),
        (1.75, 1.2),
        fontsize=9,
        arrowprops={"arrowstyle": "->", "color": style.INK},
    )
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("velocity v [m/s]")
    axes.set_title("Four starts, one state of rest", fontsize=10, loc="left")
    style.save(figure, IMAGES / "event-pasts.svg")


if __name__ == "__main__":
    draw_domains()
    draw_releases()
    draw_accumulation()
    draw_pasts()
