"""This package contains the results of runs: it evaluates and explains them, resumes and saves them."""

from hybridsim.solution.event import Event, ModeInterval
from hybridsim.solution.explain.explanation import Explanation
from hybridsim.solution.files.archive import load_solution
from hybridsim.solution.solution import Solution

__all__ = ["Event", "Explanation", "ModeInterval", "Solution", "load_solution"]
