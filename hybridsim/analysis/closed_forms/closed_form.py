"""What a closed form gives to a comparison."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.analysis.trajectory import Trajectory


@dataclass(frozen=True)
class ClosedForm:
    """An exact motion.

    Parameters
    ----------
    title : what it is, for the report.
    exact : the motion.
    nudged : the motion after its numbers were changed in their last digits; how far the two are apart is how
        well the question itself determines the answer in double precision.
    """

    title: str
    exact: Trajectory
    nudged: Trajectory
