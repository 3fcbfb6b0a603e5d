"""Draws every packaged model over its own duration and writes docs/reference/gallery.md, which shows them all.

python docs/make/gallery.py [NAME ...]               pictures, animations, and the page
python docs/make/gallery.py --animations [NAME ...]  animations and the page
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hybridsim as hs
from hybridsim.plot import friction_loop, phase_portrait, save, time_history

DOCS = Path(__file__).parents[2] / "docs"
FOLDER = DOCS / "images" / "scenes"
ANIMATIONS = DOCS / "images" / "animations"
MOST_BYTES = 400_000  # of an animation
PERIODS = 20  # of a scene that does not say how long it runs

# What is drawn of a scene, where the first states and outputs over the whole run do not show it best.
PICTURES: dict[str, Callable[[hs.Solution], Any]] = {
    "base-isolation": lambda sol: time_history(sol, ["x", "d", "f", "acc"]),
    "belt": lambda sol: time_history(sol, ["x", "v", "f"]),
    "blade-damper": lambda sol: friction_loop(sol, "f", "x", t_span=(0.9, 1.0)),
    "buck-converter": lambda sol: time_history(sol, ["v", "i", ["ramp", "control"]], t_span=(17.6e-3, 20e-3)),
    "chua": lambda sol: phase_portrait(sol, "x", "y"),
    "feeny-moon": lambda sol: phase_portrait(sol, t_span=(50, 150)),
    "mode-coupling": lambda sol: time_history(sol, ["x", "y", "f"], t_span=(150, 200)),
    "relay-spiral": lambda sol: phase_portrait(sol, "x", "y"),
    "sampled-servo": lambda sol: time_history(sol, ["x", "v", ["u", "f"]]),
    "sliding-circle": lambda sol: phase_portrait(sol, "x", "y"),
    "static-kinetic": lambda sol: time_history(sol, ["e", "v", "f"]),
    "valve-stiction": lambda sol: time_history(sol, ["x", "f", "p"]),
    "water-tanks": lambda sol: time_history(sol, [["x1", "x2"]]),
}

# The part of a run that is animated, with further settings; all others with a drawing have a picture only.
MOVES: dict[str, dict[str, Any]] = {
    "base-isolation": {"t_span": (0, 16), "speed": 2},
    "belt": {"quantities": ["x"], "t_span": (0, 26), "speed": 4},
    "bouncing-ball": {"quantities": ["h"], "speed": 0.5},
    "dfcs": {"t_span": (0.266, 0.296), "speed": 0.005},
    "drill-string": {"quantities": ["w_bit"], "t_span": (20, 44), "speed": 4},
    "elastic-gap": {"t_span": (0, 8), "speed": 1},
    "free-decay": {"quantities": ["x"], "t_span": (0, 18), "speed": 3},
    "impact-oscillator": {"quantities": ["x"], "t_span": (0, 24), "speed": 4},
    "mode-coupling": {"t_span": (176, 192), "speed": 4},
    "rocking-block": {"quantities": ["theta"], "speed": 1},
    "sampled-servo": {"quantities": ["x"], "t_span": (0, 8), "speed": 1},
    "static-kinetic": {"quantities": ["v"], "t_span": (0, 8), "speed": 1},
    "thrown-block": {"speed": 0.25},
    "valve-stiction": {"quantities": ["x"], "t_span": (40, 100), "speed": 10},
    "vibrating-table": {"quantities": ["gap"], "t_span": (0, 0.5), "speed": 0.05},
    "water-tanks": {"quantities": ["x1", "x2"], "speed": 0.5},
}

HEAD = """# Gallery

This page shows every model of the package. The command `hybridsim run NAME` runs a model over its own duration. The
command `hybridsim check NAME` prints the source and the description of a model. In Python `hs.load("NAME")` loads the
model. Tests compare the models with closed forms, balances and matrix exponentials. The script
`docs/make/gallery.py` makes this page and its pictures.

Many files also contain a [drawing](../how-to/draw-a-mechanism.md) of the mechanism. The command `hybridsim run NAME
--animate NAME.gif` animates this drawing. In the animation the colour of a contact shows its mode.

"""


def main(names: list[str], with_pictures: bool) -> None:
    """Draw these scenes, all if none is named, and write the page."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    ANIMATIONS.mkdir(parents=True, exist_ok=True)
    infos = hs.list_models()
    for info in infos:
        if names and info.name not in names:
            continue
        solution = run(info.name)
        if with_pictures:
            save(picture_of(info.name, solution), FOLDER / f"{info.name}.svg")
        if info.name in MOVES:
            path = solution.animate(
                ANIMATIONS / f"{info.name}.gif", **{"quantities": [], "fps": 12} | MOVES[info.name]
            )
            assert path.stat().st_size < MOST_BYTES, f"{path} has {path.stat().st_size} bytes"
        print(info.name, flush=True)
    sections = (section(hs.load(info.name)) for info in infos)
    (DOCS / "reference" / "gallery.md").write_text(HEAD + "\n".join(sections), encoding="utf-8")


def picture_of(name: str, solution: hs.Solution | None = None) -> Any:
    """The picture of a scene, of its run over its duration."""
    return PICTURES.get(name, time_history)(solution or run(name))


def run(name: str) -> hs.Solution:
    """The scene over its duration, or so many periods of its forcing."""
    model = hs.load(name)
    omega = model.parameter_values().get("omega")
    end = model.duration_value() or (PERIODS * 6.283185307179586 / omega if omega else 1.0)
    return hs.simulate(model, (0, end), rtol=1e-9)


def section(model: hs.Model) -> str:
    """The part of the page about one scene."""
    name = model.name
    moves = f"![The mechanism of {name}](../images/animations/{name}.gif)\n\n" if name in MOVES else ""
    return (
        f"## {model.title}\n\n"
        f"`hybridsim run {model.name}` runs [models/{model.name}.toml](../../models/{model.name}.toml). "
        f"{' '.join(model.look.split())}\n\n"
        f"*{' '.join(model.source.split()).rstrip('.')}.*\n\n"
        f"{moves}"
        f"![{model.name}](../images/scenes/{model.name}.svg)\n"
    )


if __name__ == "__main__":
    main([name for name in sys.argv[1:] if name != "--animations"], "--animations" not in sys.argv)
