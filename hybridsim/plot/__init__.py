"""This package draws solutions and results; functions return their axes and change no global settings."""

from hybridsim.plot.advice import advice
from hybridsim.plot.branch import branch
from hybridsim.plot.drawing.animation import animate
from hybridsim.plot.drawing.mechanism import mechanism
from hybridsim.plot.eigenvalues import eigenvalues
from hybridsim.plot.event_slopes import event_slopes
from hybridsim.plot.fit import fit
from hybridsim.plot.friction_law import friction_law
from hybridsim.plot.friction_loop import friction_loop
from hybridsim.plot.law_comparison import law_comparison
from hybridsim.plot.law_fits import law_fits
from hybridsim.plot.phase_portrait import phase_portrait
from hybridsim.plot.regularisation import regularisation
from hybridsim.plot.shared.style import save
from hybridsim.plot.suite_page import suite_page
from hybridsim.plot.sweeps.lines import sweep_lines
from hybridsim.plot.sweeps.map import sweep_map
from hybridsim.plot.sweeps.picture import sweep
from hybridsim.plot.time_history import TimeHistoryAxes, time_history
from hybridsim.plot.work_precision import work_precision

__all__ = [
    "TimeHistoryAxes",
    "advice",
    "animate",
    "branch",
    "eigenvalues",
    "event_slopes",
    "fit",
    "friction_law",
    "friction_loop",
    "law_comparison",
    "law_fits",
    "mechanism",
    "phase_portrait",
    "regularisation",
    "save",
    "suite_page",
    "sweep",
    "sweep_lines",
    "sweep_map",
    "time_history",
    "work_precision",
]
