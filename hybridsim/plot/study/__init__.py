"""The pictures of published studies that were done again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from hybridsim.plot.study.deviations import deviation_maps, step_lines
from hybridsim.plot.study.motions import motions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hybridsim.analysis.study import Study

__all__ = ["pictures"]


def pictures(study: Study) -> dict[str, Callable[[], Figure]]:
    """What to draw of a study, by the end of the file's name; in the order of the paper, then beyond it."""
    return {
        "figure-3": lambda: motions(study.figure_3, "Figure 3: F0/N = 0.75, r = 0.6", spectrum=True),
        "figure-10": lambda: deviation_maps(study.maps, "A"),
        "figure-11": lambda: deviation_maps(study.maps, "E"),
        "figure-12": lambda: motions(study.figure_12, "Figure 12: F0/N = 0.54, r = 0.55"),
        "figure-13": lambda: motions(study.figure_13, "Figure 13: F0/N = 0.80, r = 1.0"),
        "step-study": lambda: step_lines(study.steps),
    }
