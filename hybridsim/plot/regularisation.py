"""This module draws the error and the cost of regularised friction laws against their width v0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from hybridsim.plot.shared import style
from hybridsim.plot.shared.lines import draw_line, looks
from hybridsim.plot.work_precision import handles, headline, verdict_of

if TYPE_CHECKING:
    from hybridsim.analysis import Comparison
    from hybridsim.analysis.compare.rows import Row

_HEIGHT = 3.4
"""The height of title and panels, in inches. The legend comes below."""

_POWERS = "in brackets: powers of v$_{\\mathregular{0}}$ in the error and in the work (evaluations)"


def regularisation(comparison: Comparison) -> tuple[Axes, Axes]:
    """Draw two panels over v0: the largest error of the states over the run, and the wall time.

    The legend gives the powers of v0 that fit the error and the work (evaluations).
    Horizontal lines are the set-valued law.
    """
    from hybridsim.analysis.compare.regularised import exponent_text, exponents

    figure = style.figure(style.WIDTH, _HEIGHT)
    style.put_title(figure, f"{headline(comparison)}\n{_POWERS}", size=10)
    errors, times = figure.subplots(1, 2)
    chosen = looks(comparison.rows)
    for label in comparison.labels:
        rows = [row for row in comparison.rows if row.label == label and row.cost and row.errors]
        over_v0 = [row for row in rows if row.form]
        for panel, quantity in ((errors, _error), (times, _time)):
            points = [(row.setting[1], quantity(row)) for row in over_v0]
            draw_line(
                panel, chosen[label], points, [(x, x) for x, _ in points], [verdict_of(r) for r in over_v0]
            )
            for row in rows:
                if not row.form:
                    panel.axhline(quantity(row), color=chosen[label].colour, linestyle=chosen[label].dashes)
    for panel, title in ((errors, "state error / amplitude"), (times, "wall time")):
        style.dress(panel)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_ylabel(title, fontsize=9)
        panel.set_xlabel("v$_{\\mathregular{0}}$, in the unit of the velocity", fontsize=9)
        panel.yaxis.set_minor_formatter(NullFormatter())
    errors.yaxis.set_major_locator(LogLocator(numticks=9))
    times.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=20))
    times.yaxis.set_major_formatter(EngFormatter(unit="s", sep="\N{THIN SPACE}"))
    found = handles(comparison.rows, [], chosen)
    fitted = exponents(comparison.rows)
    for handle, label in zip(found, chosen, strict=False):
        if label in fitted:
            power, work = map(exponent_text, fitted[label])
            handle.set_label(f"{handle.get_label()} ({power}, {work})")
        else:
            handle.set(marker="None")
    figure.set_figheight(_HEIGHT + style.legend_below(figure, found))
    return errors, times


def _error(row: Row) -> float:
    return row.errors.state if row.errors else 0.0


def _time(row: Row) -> float:
    return row.cost.wall_time if row.cost else 0.0
