"""This package computes derivatives of a run with respect to its start and parameters, through all events."""

from hybridsim.analysis.variations.sensitivities import Sensitivities, sensitivities

__all__ = ["Sensitivities", "sensitivities"]
