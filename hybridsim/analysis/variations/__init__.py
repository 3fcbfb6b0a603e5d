"""This package computes derivatives of a run by its start and its parameters, through all events."""

from hybridsim.analysis.variations.sensitivities import Sensitivities, sensitivities

__all__ = ["Sensitivities", "sensitivities"]
