"""This package fits parameters and start values of models to measurements."""

from hybridsim.analysis.fit.fit import fit
from hybridsim.analysis.fit.record import Record
from hybridsim.analysis.fit.result import Fit
from hybridsim.analysis.fit.unknown import Unknown

__all__ = ["Fit", "Record", "Unknown", "fit"]
