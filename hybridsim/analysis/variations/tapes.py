"""This module stores instruction tapes that compute derivatives of formulas; models with one structure share them."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape

Numbers = tuple[int, ...]


def tangent_tape(
    system: System, z: np.ndarray, guards: Numbers = (), monitors: Numbers = (), surfaces: Numbers = ()
) -> TangentTape:
    """Return the compiled operations for the rates in the modes z, and for some guards, monitors and surfaces."""
    return _stored(system, z.tobytes(), guards, monitors, surfaces)


@per_structure
def _stored(
    system: System, modes: bytes, guards: Numbers, monitors: Numbers, surfaces: Numbers
) -> TangentTape:
    return TangentTape(system, np.frombuffer(modes, dtype=np.int64), guards, monitors, surfaces)
