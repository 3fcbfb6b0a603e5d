"""Record the arithmetic of a computation, so that compiled code can repeat it with other numbers.

The operations may depend on the numbers: whether one is zero, or whether two are equal. Such comparisons are
recorded with their results, and a recipe holds for other numbers if all comparisons have the same results.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import Precompiled, kernel
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.series.operations import ADD, DIV, MUL, NEG, SUB

_PLAIN = {ADD: operator.add, SUB: operator.sub, MUL: operator.mul}  # equal results in Python, and faster


def computed(op: int, values: Sequence[float], b: int, c: int) -> tuple[float, float]:
    """Apply one instruction of a tape to numbers, and return its two results."""
    if op in _PLAIN:
        return _PLAIN[op](values[0], values[1]), 0.0
    V = np.zeros((4, 1))
    V[: len(values), 0] = values
    advance(np.array([[op, 0, 1 if len(values) > 1 else b, c, 2]], dtype=np.int64), V, 0)
    return float(V[2, 0]), float(V[3, 0])


class Numbers:
    """The registers of a recorded computation: inputs first, then constants and results in order."""

    def __init__(self, inputs: Sequence[float]) -> None:
        self.values = list(inputs)
        self.rows: list[tuple[int, int, int, int, int]] = []
        self.comparisons: list[tuple[int, int, bool]] = []
        self._constants: dict[str, int] = {}
        self.inputs = [Traced(value, self, i) for i, value in enumerate(self.values)]

    def place(self, value: float) -> int:
        """Return the register of a number; a number that was not computed here becomes a constant."""
        if isinstance(value, Traced):
            return value.register
        name = float(value).hex()  # distinguishes 0.0 and -0.0
        if name not in self._constants:
            self._constants[name] = len(self.values)
            self.values.append(value)
        return self._constants[name]

    def operation(self, op: int, values: Sequence[float], b: int = 0, c: int = 0) -> tuple[Traced, Traced]:
        """Record one instruction and the result that it has for given numbers."""
        operand_registers, out = [self.place(value) for value in values], len(self.values)
        self.rows.append(
            (op, operand_registers[0], operand_registers[1] if len(operand_registers) > 1 else b, c, out)
        )
        self.values += computed(op, [self.values[i] for i in operand_registers], b, c)
        return Traced(self.values[out], self, out), Traced(self.values[out + 1], self, out + 1)

    def equal(self, a: float, b: float) -> bool:
        """Return whether two numbers are equal, and record the comparison."""
        i, j = self.place(a), self.place(b)
        found = self.values[i] == self.values[j]
        self.comparisons.append((i, j, found))
        return found


def _operators(op: int) -> tuple[Any, Any]:
    """Return two methods of `Traced` for an operation, such as __sub__ and __rsub__ for a difference."""

    def first(self: Traced, other: float) -> Traced:
        return self.numbers.operation(op, (self, other))[0]

    def second(self: Traced, other: float) -> Traced:
        return self.numbers.operation(op, (other, self))[0]

    return first, second


class Traced(float):
    """A float that remembers which register of the recorded computation holds it."""

    __slots__ = ("numbers", "register")
    numbers: Numbers
    register: int

    def __new__(cls, value: float, numbers: Numbers, register: int) -> Traced:
        """Return a traced float with the number of a register."""
        self = super().__new__(cls, value)
        self.numbers, self.register = numbers, register
        return self

    __add__, __radd__ = _operators(ADD)
    __sub__, __rsub__ = _operators(SUB)
    __mul__, __rmul__ = _operators(MUL)
    __truediv__, __rtruediv__ = _operators(DIV)

    def __neg__(self) -> Traced:
        return self.numbers.operation(NEG, (self,))[0]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, float) and self.numbers.equal(self, other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = float.__hash__
    # decisions that are not recorded are forbidden
    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = None  # type: ignore[assignment]  # they raise TypeError


@kernel
def repeat(rows: Any, start: Any, compared: Any, inputs: Any, registers: Any) -> bool:
    """Repeat the recorded operations for some inputs, and return whether all comparisons have the recorded results.

    rows, start (R, 1), compared: the parts of a `Recipe`. registers (R, 1) receives all results.
    """
    for r in range(start.shape[0]):
        registers[r, 0] = start[r, 0]
    for j in range(inputs.shape[0]):
        registers[j, 0] = inputs[j]
    advance(rows, registers, 0)
    for i in range(compared.shape[0]):
        is_equal = registers[compared[i, 0], 0] == registers[compared[i, 1], 0]
        if is_equal != (compared[i, 2] != 0):
            return False
    return True


@kernel
def repeat_each(
    rows: Any, start: Any, compared: Any, inputs: Any, registers: Any, found: Any, holds: Any
) -> None:
    """Repeat the recorded operations for each row of inputs, and write all results to the rows of `found`."""
    for i in range(inputs.shape[0]):
        holds[i] = repeat(rows, start, compared, inputs[i], registers)
        for r in range(start.shape[0]):
            found[i, r] = registers[r, 0]


_repeat, _repeat_each = Precompiled(repeat), Precompiled(repeat_each)
# registers, rows, and comparisons (both registers and the result)
_NOTHING = np.empty((0, 1)), np.empty((0, 5), dtype=np.int64), np.empty((0, 3), dtype=np.int64)


class Recipe:
    """A recorded computation, to be repeated with other inputs."""

    def __init__(self, numbers: Numbers, begun: Recipe | None = None) -> None:
        parts = _NOTHING if begun is None else begun._parts
        written: tuple[Sequence[Any], ...] = (numbers.values, numbers.rows, numbers.comparisons)
        self._parts: tuple[np.ndarray, ...] = tuple(
            _gone_on_with(part, lines) for part, lines in zip(parts, written, strict=True)
        )
        self._start, self._rows, self._compared = self._parts

    def values(self, inputs: Any) -> np.ndarray | None:
        """Return all registers for the given inputs, or None if a comparison differs from the recorded comparison."""
        registers = np.empty_like(self._start)
        holds = _repeat(self._rows, self._start, self._compared, np.array(inputs, dtype=float), registers)
        return registers.reshape(-1) if holds else None

    def values_at(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Repeat the computation for many inputs; also return a mask of the inputs for which all comparisons agree."""
        found, holds = np.empty((len(inputs), len(self._start))), np.empty(len(inputs), dtype=np.bool_)
        again = self._rows, self._start, self._compared, np.array(inputs, dtype=float)
        _repeat_each(*again, np.empty_like(self._start), found, holds)
        return found, holds


def _gone_on_with(known: np.ndarray, written: Sequence[Any]) -> np.ndarray:
    """Append the new recorded rows to an existing array, and return the result."""
    new = np.array(written[len(known) :], dtype=known.dtype).reshape(-1, known.shape[1])
    return np.concatenate([known, new])
