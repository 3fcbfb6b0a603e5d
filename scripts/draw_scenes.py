"""Draws docs/images/scenes/*.png: what each of these scenes shows, over its own duration or a part of it.

python scripts/draw_scenes.py
"""

from __future__ import annotations

from pathlib import Path

import hybridsim as hs
from hybridsim.plot import friction_loop, phase_portrait, save, time_history

FOLDER = Path(__file__).parent.parent / "docs" / "images" / "scenes"


def main() -> None:
    """Draw all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in ("clutches", "drill-string", "lugre-presliding", "pid-servo", "valve-stiction"):
        save(time_history(run(name)), FOLDER / f"{name}.png")
    save(friction_loop(run("blade-damper"), "f", "x", t_span=(0.9, 1.0)), FOLDER / "blade-damper.png")
    save(phase_portrait(run("feeny-moon"), t_span=(50, 150)), FOLDER / "feeny-moon.png")
    for name in ("relay-control", "relay-pair"):
        save(time_history(run(name)), FOLDER / f"{name}.png")
    for name in ("sliding-circle", "relay-spiral", "chua"):
        save(phase_portrait(run(name), "x", "y"), FOLDER / f"{name}.png")


def run(name: str) -> hs.Solution:
    """The scene over its duration."""
    model = hs.load(name)
    return hs.simulate(model, (0, model.duration_value() or 1), rtol=1e-9)


if __name__ == "__main__":
    main()
