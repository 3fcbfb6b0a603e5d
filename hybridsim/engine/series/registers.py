"""This module lists the registers of the inputs of an instruction tape, as index arrays for kernels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.layout import Layout
from hybridsim.engine.series.optimise import separate_registers
from hybridsim.expr import own_roundoff


class Inputs(NamedTuple):
    """The registers of the inputs of an instruction tape, with one index array for each kind of input.

    These are constants with values and error bounds (m, 2), parameters and their places in p, phases, time
    (1,) (-1: none) and states.
    """

    constants: np.ndarray
    values: np.ndarray
    parameters: np.ndarray
    sources: np.ndarray
    phases: np.ndarray
    time: np.ndarray
    states: np.ndarray


class Registers:
    """The registers of an instruction tape: their count, and the inputs that kernels read."""

    def __init__(self, tape: dict[str, Any], layout: Layout) -> None:
        self.separate = separate_registers(tape)
        self.count: int = tape["registers"] + len(self.separate)
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
        self._rounded: tuple[bytes, Inputs] | None = None  # last values of parameters, and their inputs

    def with_roundoff(self, p: np.ndarray) -> Inputs:
        """Return the numbers that a tape reads, with the rounding error of each."""
        known: Inputs = self.inputs
        values_now = p[known.sources]
        key, last = values_now.tobytes(), self._rounded
        if last is not None and last[0] == key:
            return last[1]
        inputs, values = self.rounded()
        self.fill(values, p)
        self._rounded = key, inputs
        return inputs

    def rounded(self) -> tuple[Inputs, np.ndarray]:
        """Return the numbers that a tape reads, with error bounds; parameters count as constants."""
        known: Inputs = self.inputs
        values = np.zeros((len(known.constants) + len(known.parameters), 2))
        values[: len(known.constants), 0] = known.values[:, 0]
        errors = [own_roundoff(number) for number in known.values[:, 0].tolist()]
        values[: len(known.constants), 1] = np.maximum(errors, known.values[:, 1])
        none, constants = np.zeros(0, dtype=np.int64), np.concatenate([known.constants, known.parameters])
        return packed(Inputs(constants, values, none, none, known.phases, known.time, known.states)), values

    def fill(self, values: np.ndarray, p: np.ndarray) -> None:
        """Write the parameters in the run-time vector p and their roundoff to the values of `rounded` inputs."""
        known: Inputs = self.inputs
        numbers, first = p[known.sources], len(known.constants)
        former = values[first:, 0].tolist()
        values[first:, 0] = numbers
        for k, (number, old) in enumerate(zip(numbers.tolist(), former, strict=True), first):
            if number != old:
                values[k, 1] = own_roundoff(number)
