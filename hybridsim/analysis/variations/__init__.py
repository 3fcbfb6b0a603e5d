"""This package computes derivatives of a run by its initial state and parameters, through all events."""

from hybridsim.analysis.variations.sensitivities import Sensitivities, sensitivities

__all__ = ["Sensitivities", "sensitivities"]
