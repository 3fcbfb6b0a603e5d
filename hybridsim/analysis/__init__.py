"""This package analyses models by many runs: comparisons, steady states, sensitivities and sweeps."""

from hybridsim.analysis.advise import Advice, advise
from hybridsim.analysis.compare.compare import compare
from hybridsim.analysis.compare.comparison import Comparison
from hybridsim.analysis.compare.lines import Series
from hybridsim.analysis.continuation import Branch, continuation
from hybridsim.analysis.equilibria import Equilibrium, Linearization, equilibria, linearize
from hybridsim.analysis.fit import Fit, Record, Unknown, fit
from hybridsim.analysis.laws import LawComparison, LawFits, compare_laws, fit_laws
from hybridsim.analysis.lyapunov import LyapunovExponents, lyapunov_exponents
from hybridsim.analysis.steady import SteadyState, steady_state
from hybridsim.analysis.suite import SuiteComparison, compare_suite
from hybridsim.analysis.sweep import Sweep, bifurcation, frequency_response, sweep
from hybridsim.analysis.variations import Sensitivities, sensitivities

__all__ = [
    "Advice",
    "Branch",
    "Comparison",
    "Equilibrium",
    "Fit",
    "LawComparison",
    "LawFits",
    "Linearization",
    "LyapunovExponents",
    "Record",
    "Sensitivities",
    "Series",
    "SteadyState",
    "SuiteComparison",
    "Sweep",
    "Unknown",
    "advise",
    "bifurcation",
    "compare",
    "compare_laws",
    "compare_suite",
    "continuation",
    "equilibria",
    "fit",
    "fit_laws",
    "frequency_response",
    "linearize",
    "lyapunov_exponents",
    "sensitivities",
    "steady_state",
    "sweep",
]
