"""This module defines the closed form of a motion, which comparisons use as a reference."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.reference.trajectory import Trajectory


@dataclass(frozen=True)
class ClosedForm:
    """An exact motion in closed form, with its events.

    Parameters
    ----------
    title : its description for the report.
    exact : the motion.
    nudged : the motion after a change of all numbers in their last digits. Its distance from `exact` shows how
        well the answer is determined in double precision.
    """

    title: str
    exact: Trajectory
    nudged: Trajectory
