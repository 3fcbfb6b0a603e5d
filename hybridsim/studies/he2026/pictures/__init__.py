"""This package draws the figures of reproduced studies."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from hybridsim.studies.he2026.measured import Study
from hybridsim.studies.he2026.measured.settings import EPS_V, STEPS_PER_PERIOD
from hybridsim.studies.he2026.pictures.convergence import convergence
from hybridsim.studies.he2026.pictures.deviations import deviation_maps, step_lines
from hybridsim.studies.he2026.pictures.maps import (
    required_settings_map,
    simpler_models,
    stick_and_stops,
    timed_map,
)
from hybridsim.studies.he2026.pictures.motions import motions
from hybridsim.studies.he2026.pictures.run_times import interval_cost, stick_cost

__all__ = ["pictures"]


def pictures(study: Study) -> dict[str, Callable[[], Figure]]:
    """Return the figures of a study in the order of the paper; the keys are the ends of their file names."""
    step, interval = "steps per period, h0", "interval eps_v [m/s]"
    return {
        "figure-3": lambda: motions(study.figure_3, "Figure 3: F0/N = 0.75, r = 0.6", spectrum=True),
        "figure-4": lambda: convergence(
            study.over_steps, "Figure 4: A and E over the step, eps_v = 1e-6 m/s", step, STEPS_PER_PERIOD
        ),
        "figure-5": lambda: convergence(
            study.over_eps, "Figure 5: A and E over the zero-velocity interval, h0 = 1200", interval, EPS_V
        ),
        "figure-6": lambda: interval_cost(study.times),
        "figure-7": lambda: stick_cost(study.times),
        "figure-10": lambda: deviation_maps(study.maps, "A"),
        "figure-11": lambda: deviation_maps(study.maps, "E"),
        "figure-12": lambda: motions(study.figure_12, "Figure 12: F0/N = 0.54, r = 0.55"),
        "figure-13": lambda: motions(study.figure_13, "Figure 13: F0/N = 0.80, r = 1.0"),
        "step-study": lambda: step_lines(study.steps),
        "stick": lambda: stick_and_stops(study.truth),
        "simpler-models": lambda: simpler_models(study.truth),
        "needed": lambda: required_settings_map(study.required_settings),
        "timed-map": lambda: timed_map(study.timed_map),
    }
