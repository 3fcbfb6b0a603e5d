"""This package fits tables of friction laws to measured points, and compares laws in one contact of a model."""

from hybridsim.analysis.laws.compare_laws import compare_laws
from hybridsim.analysis.laws.law_comparison import LawComparison

__all__ = ["LawComparison", "compare_laws"]
