"""This module draws the comparison suite on one page: a small chart per scene, and one legend."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from hybridsim.plot import style
from hybridsim.plot.lines import looks
from hybridsim.plot.work_precision import draw_panel, handles

if TYPE_CHECKING:
    from hybridsim.analysis import SuiteComparison

_COLUMNS = 3
_MARKER = 4.5


def suite_page(suite: SuiteComparison) -> tuple[Axes, ...]:
    """Draw the largest error of the states over the run against the wall time, scene by scene.

    Runs with a wrong sequence of modes are hollow. Dashed lines show SciPy's own event finding, or the
    refined form of the published method, in the colour of the solid line.
    """
    comparisons = [result.comparison for result in suite.results]
    rows = [row for comparison in comparisons for row in comparison.rows]
    columns = min(_COLUMNS, len(comparisons))
    count = math.ceil(len(comparisons) / columns)
    figure = style.figure(4.3 * columns, 3.3 * count + 1.6)
    style.put_title(
        figure, "Largest error of the states over the run / amplitude, against the time of the run"
    )
    panels = figure.subplots(count, columns, squeeze=False).ravel()
    chosen = looks(rows)
    for panel, result in zip(panels, suite.results, strict=False):
        draw_panel(panel, result.comparison, "state", chosen, _MARKER)
        panel.set_title(style.literal(result.scene.title), fontsize=10, loc="left")
        panel.set_xlabel("")
    for panel in panels[len(comparisons) :]:
        panel.remove()
    figure.legend(
        handles=handles([row for row in rows if row.errors is not None], comparisons, chosen, _MARKER),
        loc="outside lower center",
        ncols=min(4, columns + 1),
        frameon=False,
        fontsize=9,
        handlelength=3.5,
    )
    return tuple(panels[: len(comparisons)])
