"""Draws the chart of README: five methods in three scenes, error of the states against the time of a run.

python docs/make/comparison_picture.py        (writes docs/images/comparison.svg and comparison.json, in a few minutes)
"""

from __future__ import annotations

from pathlib import Path

import hybridsim as hs
from hybridsim.plot import save, suite_page

IMAGES = Path(__file__).parents[2] / "docs" / "images"
SCENES = ["P1", "static-kinetic", "bouncing-ball"]
METHODS = ["dop853", "taylor", "scipy-dop853", "cvode-bdf", "rk4-sign"]


def main() -> None:
    """Compare the methods, and write the chart and its data."""
    found = hs.compare_suite(scenes=SCENES, integrators=METHODS, budget=240)
    found.to_json(IMAGES / "comparison.json")
    save(suite_page(found), IMAGES / "comparison.svg")


if __name__ == "__main__":
    main()
