"""This package fits tables of friction laws to measured points, and compares laws in one contact of a model."""

from hybridsim.analysis.laws.compare_laws import compare_laws
from hybridsim.analysis.laws.fit_laws import fit_laws
from hybridsim.analysis.laws.law_comparison import LawComparison
from hybridsim.analysis.laws.law_fits import LawFits

__all__ = ["LawComparison", "LawFits", "compare_laws", "fit_laws"]
