"""This module contains the system, the settings and the problem sizes of the study of He et al. (2026)."""

from __future__ import annotations

import math
from dataclasses import dataclass

SOURCE = "He, Pan, Zhang, Mei, Zhang, Symmetry 18 (2026) 57, doi:10.3390/sym18010057"

# Table 1 of the paper
MASS, DAMPING, STIFFNESS, MU = 0.2, 5.65, 1e5, 0.5
NATURAL_FREQUENCY = math.sqrt(STIFFNESS / MASS)
DAMPING_RATIO = DAMPING / (2.0 * math.sqrt(STIFFNESS * MASS))

NORMAL = 40.0  # N: the normal load if the paper gives F0/N alone; the scale of all runs
STEPS_PER_PERIOD, EPS_V = 1200, 8e-4  # the paper's final choice
EPS_V_SMALL = 1e-6  # the paper's choice while it varies the step


@dataclass(frozen=True)
class Point:
    """A point of a map: frequency ratio r, force ratio F0/N, and normal force N in newtons."""

    r: float
    ratio: float
    normal: float = NORMAL

    @property
    def omega(self) -> float:
        """Angular frequency of the forcing in rad/s."""
        return self.r * NATURAL_FREQUENCY

    @property
    def period(self) -> float:
        """Period of the forcing in seconds."""
        return 2.0 * math.pi / self.omega

    @property
    def force(self) -> float:
        """Amplitude F0 of the forcing in newtons."""
        return self.ratio * self.normal

    @property
    def params(self) -> dict[str, float]:
        """Values of the parameters of the model `dfcs`."""
        return {"F0": self.force, "N": self.normal, "omega": self.omega}

    @property
    def friction(self) -> float:
        """Ratio mu N/F0 of the friction force to the force amplitude: f in Den Hartog's formulas."""
        return MU / self.ratio


@dataclass(frozen=True)
class Variant:
    """One interpretation of the published method: a choice for each detail that the paper leaves open."""

    name: str
    integrator: str
    options: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        return self.name


def _dichotomy(velocity: str, release: str, friction: str, after: str) -> Variant:
    options = {"stick_velocity": velocity, "release": release, "friction": friction, "after_event": after}
    name = f"v {velocity}, release {release}, force by {friction}, {after}"
    return Variant(name, "rk4-dichotomy", tuple(options.items()))


# Every reading; the first is Eq. 4 to the letter.
DICHOTOMIES = tuple(
    _dichotomy(velocity, release, friction, after)
    for velocity in ("kept", "zero")
    for friction in ("step", "stage")
    for release in ("step", "located")
    for after in ("full-step", "rest-of-step")
)
# Readings that differ by more than their spread: in the velocity of a sticking body, and in the time of force
# evaluation.
MATTERING = tuple(v for v in DICHOTOMIES if "release step" in v.name and "full-step" in v.name)
LITERAL = DICHOTOMIES[0]
ZEROED = next(v for v in MATTERING if v.name.startswith("v zero"))
SIGNS = tuple(
    Variant(f"sign by {friction}", "rk4-sign", (("friction", friction),)) for friction in ("step", "stage")
)


def described(pair: str) -> str:
    """Return a description of a pair of methods, one without stick and one with stick."""
    without, _, with_ = pair.partition("; ")
    return f'"{without}". The method with stick has "{with_}"'


@dataclass(frozen=True)
class Size:
    """The amount of computation: numbers of points, periods and repetitions.

    Parameters
    ----------
    periods, last : periods of a run of a fixed-step method, and number of periods at its end for A and E.
    ratios, r : grid of Figures 10 and 11.
    map_count : points along each side of the maps of the exact motion.
    timed_count, timed_sample : points along each side of the timed map, and size of the sample for the published
        method.
    ladder_count : points along each side of the maps of the needed setting.
    timed_periods, repeats : length of a timed run, and number of runs for the mean; the paper uses five.
    """

    name: str
    periods: int
    last: int
    ratios: tuple[float, ...]
    r: tuple[float, ...]
    map_count: int
    timed_count: int
    timed_sample: int
    ladder_count: int
    steps: tuple[int, ...]
    eps: tuple[float, ...]
    timed_periods: int = 100
    repeats: int = 5


def _range(first: float, last: float, step: float) -> tuple[float, ...]:
    return tuple(round(first + k * step, 10) for k in range(round((last - first) / step) + 1))


def _intervals(first: float, step: float) -> tuple[float, ...]:
    """Return powers of ten down to 1e-6, and the velocity interval of the paper."""
    return tuple(sorted([*(10.0**k for k in _range(first, -6.0, -step)), EPS_V], reverse=True))


FULL = Size(
    name="full",
    periods=150,
    last=50,
    ratios=_range(0.51, 0.66, 0.01) + _range(0.70, 1.0, 0.05),
    r=_range(0.5, 1.5, 0.02),
    map_count=121,
    timed_count=101,
    timed_sample=400,
    ladder_count=15,
    steps=_range(100, 2400, 100),  # type: ignore[arg-type]  # whole numbers, made as floats
    eps=_intervals(-1.5, 0.25),
)
QUICK = Size(
    name="quick",
    periods=100,
    last=30,
    ratios=_range(0.52, 0.64, 0.02) + (0.7, 0.8),
    r=_range(0.5, 1.0, 0.05) + _range(1.1, 1.5, 0.1),
    map_count=31,
    timed_count=31,
    timed_sample=60,
    ladder_count=5,
    steps=(100, 200, 400, 600, 800, 1000, 1200, 1400, 2000, 2400),
    eps=_intervals(-2.0, 0.5),
)
