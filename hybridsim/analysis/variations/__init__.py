"""How a run changes when its start or its parameters do: the variational flow, carried through events."""

from hybridsim.analysis.variations.sensitivities import Sensitivities, sensitivities

__all__ = ["Sensitivities", "sensitivities"]
