"""Rates and guards of one vector of modes with their derivatives, at a frozen instant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.tangents import TangentTape
from hybridsim.engine.timepair import Instant
from hybridsim.errors import UsageError, nearest

if TYPE_CHECKING:
    from hybridsim.engine.system import System


class Field:
    """x' = f(x) and the guards g(x) >= 0 of the modes z at time t.

    held (h,): indices of the states that the modes hold on a constraint; free: of the others.
    """

    def __init__(self, system: System, z: np.ndarray, t: float = 0.0) -> None:
        if not system.has_tape:
            raise UsageError(
                f"model {system.model.name} is made of Python functions, of which derivatives are not known",
                remedy="write it in expressions",
            )
        self.system, self.z = system, z
        self.p = system.vector(Instant(t), system.discrete_start)
        self.guards = np.flatnonzero(system.active(z))
        self._tape = TangentTape(system, z, tuple(self.guards.tolist()))
        self._seeds = np.eye(system.n + 1 + len(self.p), system.n)
        self.held = system.evaluated(z)
        self.free = [i for i in range(system.n) if i not in self.held]

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """f (n,), f_x (n, n), g (G,), g_x (G, n) with held states on their constraints."""
        found = self._tape(np.zeros(1), x[None, :], self.p, self._seeds)
        n = self.system.n
        return found.values[0, :n], found.slopes[0, :n], found.values[0, n:], found.slopes[0, n:]

    def sizes(self, x: np.ndarray) -> np.ndarray:
        """What is large for each state at x: its value or its nominal size, 1 where both are nothing."""
        found = np.maximum(np.abs(x), [state.nominal or 0.0 for state in self.system.model.states])
        return np.where(found > 0.0, found, 1.0)

    def projected(self, x: np.ndarray) -> np.ndarray:
        """x with held states evaluated from their constraints."""
        return self.system.project(0.0, x, self.p, self.z)


def is_driven(system: System) -> bool:
    """Whether the equations depend on time."""
    tape = system.code.data["tape"]
    if tape is None:
        raise UsageError(
            f"model {system.model.name} is made of Python functions, of which derivatives are not known",
            remedy="write it in expressions",
        )
    return tape["time"] >= 0 or bool(system.model.inputs)


def modes_of(system: System, mode: Mapping[str, str] | str | None) -> np.ndarray:
    """Mode numbers from names by component; a text is the mode of the only component."""
    declared = system.declared
    if isinstance(mode, str):
        if len(declared) != 1:
            raise UsageError(
                f"mode is {mode!r}, and model {system.model.name} has {len(declared)} components",
                remedy="give a mapping from components to modes",
            )
        mode = {declared[0].name: mode}
    if not (mode is None or isinstance(mode, Mapping)):
        raise UsageError(f"mode is {mode!r}", remedy="give a mapping from components to modes")
    given: dict[str, Any] = dict(mode or {})
    names = [a.name for a in declared]
    for name in given:
        if name not in names:
            raise UsageError(
                f"mode names {name!r}, which is no component of model {system.model.name}",
                remedy=nearest(str(name), names, kind="components"),
            )
    numbers = []
    for automaton in system.automata:
        chosen = given.get(automaton.name)
        if chosen is None and automaton.initial < 0 and not automaton.is_corner:
            raise UsageError(
                f"mode gives none for {automaton.name}", remedy=f"give one of {', '.join(automaton.modes)}"
            )
        if chosen is not None and chosen not in automaton.modes:
            raise UsageError(
                f"mode of {automaton.name} is {chosen!r}",
                remedy=nearest(str(chosen), automaton.modes, kind="modes"),
            )
        numbers.append(max(automaton.initial, 0) if chosen is None else automaton.modes.index(chosen))
    return np.array(numbers, dtype=np.int64)
