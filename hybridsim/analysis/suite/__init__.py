"""The comparison suite: scenes that see every kind of error, by all integrators, on one page."""

from hybridsim.analysis.suite.result import SuiteComparison
from hybridsim.analysis.suite.running import compare_suite

__all__ = ["SuiteComparison", "compare_suite"]
