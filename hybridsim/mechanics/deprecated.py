"""This module keeps former class names of the results of mechanical systems, which are now `Solution`.

They are deprecated and will go in version 0.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory
from hybridsim.mechanics.time_stepping.stepped_trajectory import SteppedTrajectory
from hybridsim.solution.solution import Solution

if TYPE_CHECKING:
    MechanicalSolution = SteppedSolution = Solution
else:

    class _Former(type):
        """The class of a former name; `isinstance` accepts the solutions that formerly had this class."""

        trajectory: ClassVar[type]

        def __instancecheck__(cls, instance: object) -> bool:
            return isinstance(instance, Solution) and isinstance(instance._trajectory, cls.trajectory)

    class MechanicalSolution(Solution, metaclass=_Former):
        """The former name of a `Solution` that ``taylor`` returned for a `MechanicalSystem`."""

        trajectory = SeriesTrajectory

    class SteppedSolution(Solution, metaclass=_Former):
        """The former name of a `Solution` that ``moreau`` returned for a `MechanicalSystem`."""

        trajectory = SteppedTrajectory
