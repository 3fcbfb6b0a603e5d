"""This package contains the class `Simulator`, which runs a model as a whole or in steps.

Read `held_inputs` and `position` first, then `read_only`, `current_state`, `saved_state`, `ownership` and `simulator`.
"""

from hybridsim.simulator.saved_state import SavedState
from hybridsim.simulator.simulator import Simulator

__all__ = ["SavedState", "Simulator"]
