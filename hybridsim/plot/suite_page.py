"""This module draws the comparison suite on one page: a small chart per test case, and one legend."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from hybridsim.plot.shared import style
from hybridsim.plot.shared.lines import looks
from hybridsim.plot.work_precision import draw_panel, handles

if TYPE_CHECKING:
    from hybridsim.analysis import Comparison, SuiteComparison

_COLUMNS = 3
_HEIGHT, _AROUND = 2.5, 1.9  # inches of a row of panels, and of title and legend
_LETTERS = 75  # of the titles of a row of panels
_MARKER = 4.5


def suite_page(suite: SuiteComparison) -> tuple[Axes, ...]:
    """Draw the largest error of the states over the run against the wall time, test case by test case.

    Runs with a wrong sequence of modes are hollow and at the top edge. Dashed lines show SciPy's own event
    finding, or the refined form of the published method, in the colour of the solid line.
    """
    comparisons = [result.comparison for result in suite.results]
    rows = [row for comparison in comparisons for row in comparison.rows]
    columns = min(_COLUMNS, len(comparisons))
    count = math.ceil(len(comparisons) / columns)
    figure = style.figure(style.WIDTH, _HEIGHT * count + _AROUND)
    style.put_title(figure, _headline(comparisons), size=10)
    panels = figure.subplots(count, columns, squeeze=False).ravel()
    chosen = looks(rows)
    for panel, result in zip(panels, suite.results, strict=False):
        draw_panel(panel, result.comparison, "state", chosen, _MARKER)
        title = textwrap.fill(result.scene.title, _LETTERS // columns)
        panel.set_title(style.literal(title), fontsize=9, loc="left", pad=8)
    for k, panel in enumerate(panels[: len(comparisons)]):
        panel.set_ylabel("state error / amplitude" if k % columns == 0 else "", fontsize=9)
        panel.set_xlabel("wall time" if k + columns >= len(comparisons) else "", fontsize=9)
    for panel in panels[len(comparisons) :]:
        panel.remove()
    style.legend_below(
        figure, handles([row for row in rows if row.errors is not None], comparisons, chosen, _MARKER)
    )
    return tuple(panels[: len(comparisons)])


def _headline(comparisons: Sequence[Comparison]) -> str:
    """Return the number of test cases in which each method is the cheapest, as text."""
    from hybridsim.analysis.compare.table import TARGET, fastest

    firsts = Counter(row.label for one in comparisons if (row := fastest(one.rows)) is not None)
    if not firsts:
        return style.wrapped(f"No run reaches an error of {TARGET:.0e} with the right modes")
    names = [f"{label} in {count}" for label, count in firsts.most_common()]
    return style.wrapped(
        f"Cheapest at an error of {TARGET:.0e}, of {len(comparisons)} scenes: {', '.join(names)}"
    )
