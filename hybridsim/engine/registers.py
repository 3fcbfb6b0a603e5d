"""Where the inputs of a tape are among its registers, as index arrays that kernels take."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.layout import Layout
from hybridsim.engine.lean_tape import twins_of
from hybridsim.engine.packs import packed


class Inputs(NamedTuple):
    """Registers of a tape's inputs: constants with values and error bounds (m, 2), parameters and their places in p,
    phases, time (1,) (-1: none), states."""

    constants: np.ndarray
    values: np.ndarray
    parameters: np.ndarray
    sources: np.ndarray
    phases: np.ndarray
    time: np.ndarray
    states: np.ndarray


class Registers:
    """Where the tape's inputs are, as index arrays."""

    def __init__(self, tape: dict[str, Any], layout: Layout) -> None:
        self.twins = twins_of(tape)
        self.count: int = tape["registers"] + len(self.twins)
        time: int = tape["time"]
        constants = np.array([r for r, *_ in tape["constants"]], dtype=np.int64)
        values = np.array([v for _, *v in tape["constants"]], dtype=float).reshape(-1, 2)
        parameters = np.array([r for r, _ in tape["parameters"]], dtype=np.int64)
        sources = np.array([i for _, i in tape["parameters"]], dtype=np.int64)
        is_phase = (sources >= layout.phases_at) & (sources < layout.signals_at)
        phases, states = parameters[is_phase], np.array(tape["states"], dtype=np.int64)
        self.inputs = packed(
            Inputs(constants, values, parameters, sources, phases, np.array([time], dtype=np.int64), states)
        )
