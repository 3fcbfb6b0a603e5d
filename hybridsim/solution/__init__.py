"""What a run gives back, how it goes on, and how it is kept in a file."""

from hybridsim.solution.archive import load_solution
from hybridsim.solution.event import Event, ModeInterval
from hybridsim.solution.explanation import Explanation
from hybridsim.solution.solution import Solution

__all__ = ["Event", "Explanation", "ModeInterval", "Solution", "load_solution"]
