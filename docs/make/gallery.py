"""Draws every packaged model over its own duration and writes docs/reference/gallery.md, which shows them all.

python docs/make/gallery.py [NAME ...]
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
PERIODS = 20  # of a scene that does not say how long it runs

# what is drawn of a scene, where its run over time is not what shows it
PICTURES: dict[str, Callable[[hs.Solution], Any]] = {
    "blade-damper": lambda sol: friction_loop(sol, "f", "x", t_span=(0.9, 1.0)),
    "buck-converter": lambda sol: time_history(sol, ["v", "i", "ramp", "control"], t_span=(17.6e-3, 20e-3)),
    "chua": lambda sol: phase_portrait(sol, "x", "y"),
    "feeny-moon": lambda sol: phase_portrait(sol, t_span=(50, 150)),
    "relay-spiral": lambda sol: phase_portrait(sol, "x", "y"),
    "sliding-circle": lambda sol: phase_portrait(sol, "x", "y"),
}

HEAD = """# Gallery

Every model that comes with the package: `hybridsim run NAME` runs one over its own duration, `hybridsim check NAME`
says where it is from and what to look at, `hs.load("NAME")` gives it to Python. Tests hold them against closed forms,
balances and matrix exponentials. The page and its pictures are made by `docs/make/gallery.py`.

"""


def main(names: list[str]) -> None:
    """Draw these scenes, all if none is named, and write the page."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    infos = hs.list_models()
    for info in infos:
        if not names or info.name in names:
            save(PICTURES.get(info.name, time_history)(run(info.name)), FOLDER / f"{info.name}.png")
            print(info.name, flush=True)
    sections = (section(hs.load(info.name)) for info in infos)
    (DOCS / "reference" / "gallery.md").write_text(HEAD + "\n".join(sections), encoding="utf-8")


def run(name: str) -> hs.Solution:
    """The scene over its duration, or so many periods of its forcing."""
    model = hs.load(name)
    omega = model.parameter_values().get("omega")
    end = model.duration_value() or (PERIODS * 6.283185307179586 / omega if omega else 1.0)
    return hs.simulate(model, (0, end), rtol=1e-9)


def section(model: hs.Model) -> str:
    """The part of the page about one scene."""
    return (
        f"## {model.title}\n\n"
        f"`hybridsim run {model.name}`, declared in [models/{model.name}.toml](../../models/{model.name}.toml). "
        f"{' '.join(model.look.split())}\n\n"
        f"*{' '.join(model.source.split()).rstrip('.')}.*\n\n"
        f"![{model.name}](../images/scenes/{model.name}.png)\n"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
