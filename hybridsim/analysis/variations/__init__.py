"""This package computes derivatives of a run through all events, with respect to initial state and parameters."""

from hybridsim.analysis.variations.sensitivities import Sensitivities, sensitivities

__all__ = ["Sensitivities", "sensitivities"]
