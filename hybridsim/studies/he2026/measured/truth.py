"""This module computes the exact motion on a map: regions of stick, and errors of simpler models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.reference.closed_forms.den_hartog import largest_friction, linear_amplitude, no_stops
from hybridsim.reference.closed_forms.harmonic_balance import equivalent_viscous_amplitude
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import DAMPING_RATIO, MU, STIFFNESS, Point, Size
from hybridsim.studies.he2026.measured.steady import exact

RATIO_SPAN, R_SPAN = (0.5, 1.5), (0.05, 2.0)
NO_FRICTION, VISCOUS, NO_STOPS = "no friction", "equivalent viscous damping", "no stops (Den Hartog)"
MODELS = (NO_FRICTION, VISCOUS, NO_STOPS)
_BOUNDARY_POINTS = 400


@dataclass(frozen=True)
class Truth:
    """Exact steady states over F0/N (rows) and r (columns), and the amplitudes of the simpler models.

    boundary : (r, F0/N) above which there are no stops, from the closed form.
    holds : the points at which the closed form without stops is valid.
    """

    ratios: np.ndarray
    r: np.ndarray
    amplitude: np.ndarray
    energy: np.ndarray
    stick: np.ndarray
    stops: np.ndarray
    residual: np.ndarray
    models: dict[str, np.ndarray]
    holds: np.ndarray
    boundary: tuple[np.ndarray, np.ndarray]

    def deviation(self, model: str) -> np.ndarray:
        """Return the relative error of the amplitude A of a model, or nan if it is undefined."""
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.abs(self.models[model] - self.amplitude) / self.amplitude
        return np.asarray(np.where(self.amplitude > 0.0, value, np.nan))

    def to_plain(self) -> dict[str, Any]:
        """Return the results without the maps, for a JSON file."""
        free = self.stick == 0.0
        moving = self.amplitude > 0.0
        off = self.deviation(NO_STOPS)
        within = {name: float(np.mean(self.deviation(name)[moving] <= 0.01)) for name in MODELS}
        return {
            "grid": {"F0/N": RATIO_SPAN, "r": R_SPAN, "points": [len(self.ratios), len(self.r)]},
            "share of the map without stops": float(free.mean()),
            "points on which the closed form and the exact run disagree whether there are stops": int(
                (free[moving] != self.holds[moving]).sum()
            ),
            "largest deviation of the closed form where it holds": float(np.nanmax(off[self.holds & moving])),
            "most stops per period": int(self.stops.max()),
            "largest stick fraction of a moving body": float(self.stick[moving].max()),
            "median residual of periodicity": float(np.median(self.residual)),
            "largest residual of periodicity": float(self.residual.max()),
            "share of the moving points where a model's amplitude is within 1 %": within,
            "stick fraction below which the closed form without stops is within 1 %": self.harmless(0.01),
            "stick fraction below which the closed form without stops is within 5 %": self.harmless(0.05),
        }

    def harmless(self, tol: float) -> float:
        """Return the smallest stick fraction at which the error of the no-stop formula exceeds `tol`."""
        off = self.deviation(NO_STOPS)
        bad = (self.amplitude > 0.0) & ~(off <= tol)
        return float(self.stick[bad].min()) if bad.any() else 1.0


def truth(size: Size, pool: Pool) -> Truth:
    """Compute the exact steady motion at every point of the map."""
    ratios, r = np.linspace(*RATIO_SPAN, size.map_count), np.linspace(*R_SPAN, size.map_count)
    points = [Point(float(b), float(a)) for a in ratios for b in r]
    states = pool.map(exact, points, 0.0, 0.85)
    shape = (len(ratios), len(r))
    free = pool.map(lambda p: no_stops(p.r, DAMPING_RATIO, p.friction), points, 0.85, 0.92)
    unit = np.array([p.force / STIFFNESS for p in points])
    models = {
        NO_FRICTION: unit * np.array([linear_amplitude(p.r, DAMPING_RATIO) for p in points]),
        VISCOUS: unit
        * np.array([equivalent_viscous_amplitude(p.r, DAMPING_RATIO, p.friction) for p in points]),
        NO_STOPS: unit * np.array([state.amplitude for state in free]),
    }
    along = np.linspace(*R_SPAN, min(_BOUNDARY_POINTS, 4 * size.map_count))
    largest = pool.map(lambda x: largest_friction(float(x), DAMPING_RATIO), along, 0.92, 1.0)
    with np.errstate(divide="ignore"):
        boundary = MU / np.array(largest)

    def shaped(values: list[Any]) -> np.ndarray:
        return np.array(values).reshape(shape)

    return Truth(
        ratios,
        r,
        shaped([s.amplitude for s in states]),
        shaped([s.energy for s in states]),
        shaped([s.stick for s in states]),
        shaped([s.stops for s in states]),
        shaped([s.residual for s in states]),
        {name: values.reshape(shape) for name, values in models.items()},
        shaped([state.holds for state in free]),
        (along, boundary),
    )
