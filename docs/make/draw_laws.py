"""Draws docs/images/laws/*.svg: each friction law that comes with the package, at values where its shape is seen.

python docs/make/draw_laws.py [NAME ...]
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hybridsim as hs
from hybridsim.model import list_laws
from hybridsim.plot import friction_law, save
from hybridsim.plot.shared import style

FOLDER = Path(__file__).parents[2] / "docs" / "images" / "laws"

FALLING = {"mu_s": 0.6, "mu_k": 0.35, "v_s": 0.3}
# arguments of each law and how it is driven, at a normal load of 1; velocities and displacements are in their own units
LAWS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "arctan": ({"mu": 0.5, "v0": 0.03}, {"speed": 1}),
    "asymmetric": ({"mu_forward": 0.5, "mu_backward": 0.3}, {"speed": 1}),
    "coulomb": ({"mu": 0.5}, {"speed": 1}),
    "dahl": ({"mu": 0.5, "sigma": 2}, {"speed": 1}),
    "elasto-plastic": (
        {"mu": 0.5, "sigma_0": 2, "sigma_1": 0, "sigma_2": 0, "share": 0.6},
        {"speed": 1},
    ),
    "hyperbolic": ({"mu": 0.6, "delta": 3}, {"speed": 1}),
    "iwan": ({"n": 8, "mu": 0.5, "k": 2}, {"speed": 1}),
    "jenkins": ({"mu": 0.5, "k": 2}, {"speed": 1}),
    "lugre": (FALLING | {"sigma_0": 20, "sigma_1": 0.1, "sigma_2": 0.05}, {"speed": 1}),
    "rate-and-state": (
        {"mu_0": 0.6, "a": 0.01, "b": 0.015, "L": 0.2, "v_0": 1},
        {"speed": 0.95, "mean": 1},
    ),
    "static-kinetic": ({"mu_s": 0.6, "mu_k": 0.4}, {"speed": 1}),
    "stribeck": (FALLING, {"speed": 1}),
    "stribeck-exponent": (FALLING | {"exponent": 0.7, "c": 0.08, "blunt": 1e-3}, {"speed": 1}),
    "stribeck-exponential": (FALLING, {"speed": 1}),
    "tanh": ({"mu": 0.5, "v0": 0.03}, {"speed": 1}),
    "viscous": ({"mu": 0.3, "c": 0.3}, {"speed": 1}),
}
# a table of points belongs to whoever measured them; this one stands for any
MEASURED = hs.FrictionLaw(
    "table",
    slip="mu*N",
    stick="mu*N",
    tables=[hs.LawTable("mu", [0, 0.05, 0.15, 0.4, 0.75, 1], [0.6, 0.5, 0.38, 0.34, 0.38, 0.45])],
    title="A table of points",
)


def main(names: list[str]) -> None:
    """Draw the laws of these names, or all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or [*list_laws(), "table"]:
        law = MEASURED if name == "table" else name
        arguments, motion = LAWS.get(name, ({}, {"speed": 1}))
        save(small(friction_law(law, arguments, **motion)), FOLDER / f"{name}.svg")


def small(axes: list[Axes]) -> Figure:
    """The picture of a law at the width at which a table shows it, with its title in shorter lines."""
    figure, title = style.figure_of(axes), axes[0].get_title(loc="left").replace("\n", " ")
    figure.set_size_inches(2.8, 2.3 * len(axes))
    grid = figure.add_gridspec(len(axes), 1)
    for k, each in enumerate(axes):
        each.set_subplotspec(grid[k])
        each.tick_params(labelleft=True)
        each.set_ylabel(axes[0].get_ylabel(), fontsize=9)
    width = 30
    lines = title.split(", ", 1) if len(title) > width else [title]
    if max(map(len, lines)) > width:
        lines = textwrap.wrap(title, width)
    else:
        lines[:-1] = [f"{line}," for line in lines[:-1]]
    axes[0].set_title("\n".join(lines), fontsize=9, loc="left")
    return figure


if __name__ == "__main__":
    main(sys.argv[1:])
