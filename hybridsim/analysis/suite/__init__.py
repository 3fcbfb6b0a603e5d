"""This package compares all integrators on test cases, each of which shows one kind of error."""

from hybridsim.analysis.suite.result import SuiteComparison
from hybridsim.analysis.suite.running import compare_suite

__all__ = ["SuiteComparison", "compare_suite"]
