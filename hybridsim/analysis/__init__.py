"""What is asked of a model beyond one run: comparisons of integrators, sweeps over parameters."""

from hybridsim.analysis.compare import compare
from hybridsim.analysis.comparison import Comparison
from hybridsim.analysis.series import Series
from hybridsim.analysis.suite import SuiteComparison, compare_suite
from hybridsim.analysis.sweep import Sweep, sweep

__all__ = ["Comparison", "Series", "SuiteComparison", "Sweep", "compare", "compare_suite", "sweep"]
