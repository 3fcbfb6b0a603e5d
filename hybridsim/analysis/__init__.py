"""What is asked of a model beyond one run: comparisons of integrators."""

from hybridsim.analysis.compare import compare
from hybridsim.analysis.comparison import Comparison
from hybridsim.analysis.series import Series
from hybridsim.analysis.suite import SuiteComparison, compare_suite

__all__ = ["Comparison", "Series", "SuiteComparison", "compare", "compare_suite"]
