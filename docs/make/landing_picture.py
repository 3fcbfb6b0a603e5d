"""Draws the picture of the landing page: a block on a belt, its motion, and its amplitude over the belt's speed.

python docs/make/landing_picture.py        (writes docs/images/landing.svg)
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import hybridsim as hs
from hybridsim.plot import save

PICTURE = Path(__file__).parents[2] / "docs" / "images" / "landing.svg"
BLUE, ORANGE, BLACK, GREY = "#0072B2", "#D55E00", "#000000", "#777777"
DAMPING, STATIC, FALL = 0.5, 1.0, 3.0  # the force of friction is STATIC/(1 + FALL*v)
ONSET = (
    np.sqrt(STATIC * FALL / DAMPING) - 1
) / FALL  # where the damping equals the fall of friction with speed

MODEL = hs.Model(
    "damped-belt",
    states=[hs.State("x", 0, "v"), hs.State("v", 0, "-x - c*v - f")],
    parameters={"c": DAMPING, "v_belt": 0.2, "static": STATIC, "fall": FALL},
    contacts=[hs.Contact("f", "v - v_belt", "static", hs.load("belt").contacts[0].law, {"delta": "fall"})],
)


def draw_mechanism(axes: Axes) -> None:
    """A block between a wall and a moving belt, held by a spring and a damper."""
    axes.axis("off")
    axes.set(xlim=(0, 10), ylim=(0, 3.4), aspect="equal")
    axes.plot([0.6, 0.6], [1.0, 3.2], color=BLACK, lw=2)
    for y in np.arange(1.0, 3.2, 0.3):
        axes.plot([0.3, 0.6], [y, y + 0.25], color=GREY, lw=0.8)
    coil = np.linspace(0, 1, 13)
    axes.plot(
        np.concatenate([[0.6], 1.1 + 2.4 * coil, [4.0]]),
        2.6 + np.concatenate([[0], [0], 0.22 * (-1.0) ** np.arange(11), [0], [0]]),
        color=BLACK,
        lw=1.2,
    )
    axes.plot([0.6, 2.1], [1.7, 1.7], color=BLACK, lw=1.2)
    axes.plot([2.7, 2.1, 2.1, 2.7], [1.95, 1.95, 1.45, 1.45], color=BLACK, lw=1.2)
    axes.plot([2.4, 2.4], [1.52, 1.88], color=BLACK, lw=1.8)
    axes.plot([2.4, 4.0], [1.7, 1.7], color=BLACK, lw=1.2)
    axes.add_patch(mpl.patches.Rectangle((4.0, 1.15), 2.4, 1.9, facecolor="#d9e8f3", edgecolor=BLACK))
    axes.text(5.2, 2.1, "m", ha="center", va="center")
    axes.plot([1.6, 9.0], [1.1, 1.1], color=ORANGE, lw=2)
    axes.plot([1.6, 9.0], [0.3, 0.3], color=ORANGE, lw=2)
    for x in (1.6, 9.0):
        axes.add_patch(mpl.patches.Circle((x, 0.7), 0.4, facecolor="white", edgecolor=GREY))
    axes.annotate("", (8.6, 1.45), (7.0, 1.45), arrowprops={"arrowstyle": "->", "color": ORANGE})
    axes.text(7.8, 1.65, "belt", color=BLACK, ha="center")


def draw_motion(axes: Axes) -> None:
    """The velocity over time; the intervals of stick are thick."""
    speed = 0.2
    sol = hs.simulate(MODEL, (0, 40), params={"v_belt": speed})
    t = np.linspace(10, 40, 3000)
    axes.plot(t, sol(t)[1], color=BLUE, lw=1.5, label="slip")
    for interval in sol.modes["f"]:
        if interval.mode == "stick" and interval.t1 > 10:
            ends = [max(interval.t0, 10), interval.t1]
            axes.plot(ends, [speed, speed], color=BLACK, lw=4, solid_capstyle="butt", label="stick")
    axes.set(xlabel="time", ylabel="velocity of the block", xlim=(10, 40), ylim=(-0.68, 0.27))
    labels = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    axes.legend(labels.values(), labels.keys(), loc="lower right", ncols=2, frameon=False)


def draw_amplitudes(axes: Axes) -> None:
    """Amplitude of the motion that starts from rest, over the belt's speed, and where steady sliding is stable."""
    speeds = np.linspace(0.04, 0.9, 87)
    orbits = [hs.steady_state(MODEL, params={"v_belt": float(speed)}) for speed in speeds]
    sizes = np.array([orbit.amplitude["x"] if orbit.kind == "periodic" else np.nan for orbit in orbits])
    axes.plot(speeds, sizes, color=BLACK, lw=2, label="stick-slip")
    axes.plot([ONSET, speeds[-1]], [0, 0], color=BLUE, lw=2, label="stable sliding")
    axes.plot([0, ONSET], [0, 0], color=BLUE, lw=1.2, ls="--", label="unstable sliding")
    last = np.flatnonzero(np.isfinite(sizes))[-1]
    axes.plot([speeds[last]] * 2, [0, sizes[last]], color=GREY, lw=1, ls=":")
    axes.axvspan(ONSET, float(speeds[last]), color=GREY, alpha=0.12, lw=0)
    axes.text(speeds[last] + 0.03, 0.28, "in the grey range\nboth are stable", color="#444444")
    axes.set(
        xlabel="speed of the belt", ylabel="amplitude of the vibration", xlim=(0, 0.9), ylim=(-0.02, 0.95)
    )
    axes.legend(loc="upper left", frameon=False)


def main() -> None:
    """Draw the three parts side by side."""
    with plt.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = plt.figure(figsize=(7.3, 3.6), dpi=150, layout="constrained")
        parts = figure.subplot_mosaic(
            [["mechanism", "amplitude"], ["motion", "amplitude"]], height_ratios=[2, 3]
        )
        draw_mechanism(parts["mechanism"])
        draw_motion(parts["motion"])
        draw_amplitudes(parts["amplitude"])
        save(figure, PICTURE)


if __name__ == "__main__":
    main()
