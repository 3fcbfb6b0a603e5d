"""This module evaluates the rates and guards of one combination of modes, with derivatives, at a fixed time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybridsim.arguments import cannot_be, known_entry, known_name
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.sides import modes_by_state
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape
from hybridsim.errors import UsageError

INSIDE = 1e-12  # relative to a guard's terms: the rounding error


class Field:
    """The rates x' = f(x) and the guards g(x) >= 0 of the modes z at time t.

    held (h,): indices of the states that the modes hold on a constraint; free: indices of the others.
    by_state: numbers of the components whose modes follow from the state, in `at_sides`.
    """

    def __init__(self, system: System, z: np.ndarray, t: float = 0.0, by_state: tuple[int, ...] = ()) -> None:
        if not system.has_tape:
            raise UsageError(
                f"model {system.model.name} consists of Python functions, whose derivatives are unknown",
                remedy="write the model in expressions",
            )
        if system.numbers:
            raise UsageError(
                f"model {system.model.name} contains floor, mod or round, whose whole numbers depend on the state: "
                "equilibria and linearisations are not supported",
                remedy="replace the function by a parameter, and choose its value",
            )
        self.system, self.z, self.t, self.by_state = system, z, t, by_state
        self.p = system.vector(Instant(t), system.discrete_start)
        self.guards = np.flatnonzero(system.active(z))
        self._tape = TangentTape(system, z, tuple(self.guards.tolist()))
        self._seeds = np.eye(system.n + 1 + len(self.p), system.n)
        self.held = system.evaluated(z)
        self.free = [i for i in range(system.n) if i not in self.held]

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return rates f, guards g and their derivatives, with held states computed from their constraints."""
        found = self._tape(np.zeros(1), x[None, :], self.p, self._seeds)
        n = self.system.n
        return found.values[0, :n], found.slopes[0, :n], found.values[0, n:], found.slopes[0, n:]

    def at_sides(self, x: np.ndarray) -> Field:
        """Return the equations after choosing those modes that follow from the state x, such as sides of corners."""
        if not self.by_state:
            return self
        z = modes_by_state(self.system, self.by_state, 0.0, x, self.p, self.z)
        return self if (z == self.z).all() else Field(self.system, z, self.t, self.by_state)

    def borders(self, x: np.ndarray) -> list[tuple[int, int]]:
        """Return pairs of a component whose guard is zero within rounding, and a mode to which this guard may lead."""
        _, _, g, G = self(x)
        rounding = dict(zip(self.guards.tolist(), INSIDE * (np.abs(G) @ self.sizes(x)), strict=True))
        value = dict(zip(self.guards.tolist(), g.tolist(), strict=True))
        found = []
        for c in self.by_state:
            automaton, m = self.system.automata[c], self.z[c]
            for k, number in enumerate(automaton.guards[m]):
                if not abs(value[number]) <= rounding[number]:
                    continue
                found += [(c, other) for other in (automaton.targets[m][k] or (automaton.hold,))]
        return found

    def sizes(self, x: np.ndarray) -> np.ndarray:
        """Return the scale of each state at x: its absolute value or nominal size, or 1 if both are zero."""
        found = np.maximum(np.abs(x), [state.nominal or 0.0 for state in self.system.model.states])
        return np.where(found > 0.0, found, 1.0)

    def projected(self, x: np.ndarray) -> np.ndarray:
        """Return the states x after computing held states from their constraints."""
        return self.system.project(0.0, x, self.p, self.z)


def is_driven(system: System) -> bool:
    """Return whether the equations depend on time."""
    tape = system.code.data["tape"]
    if tape is None:
        raise UsageError(
            f"model {system.model.name} consists of Python functions, whose derivatives are unknown",
            remedy="write the model in expressions",
        )
    return tape["time"] >= 0 or bool(system.model.inputs)


def modes_of(system: System, mode: Mapping[str, str] | str | None) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return the given modes as numbers, and the components whose modes follow from the state.

    A string is the mode of the only component. The state determines the modes of corners, tables and jumps of
    a rate, which are not declared as components, unless their mode is given.
    """
    written = {component.name for component in system.written.all_components()}
    declared = tuple(a for a in system.declared if a.name in written) or system.declared
    if isinstance(mode, str):
        if len(declared) != 1:
            raise UsageError(
                f"`mode` is {mode!r}, but model {system.model.name} has {len(declared)} components",
                remedy="use a dict of component names and modes",
            )
        mode = {declared[0].name: mode}
    if not (mode is None or isinstance(mode, Mapping)):
        raise cannot_be("mode", mode, "use a dict of component names and modes")
    mode_names: dict[str, Any] = dict(mode or {})
    names = [a.name for a in system.declared]
    for name in mode_names:
        known_entry(name, names, "mode", f"a component of model {system.model.name}", "components")
    numbers, by_state = [], []
    for c, automaton in enumerate(system.automata):
        chosen = mode_names.get(automaton.name)
        if chosen is None and (automaton.is_corner or automaton.name not in written):
            by_state.append(c)
        elif chosen is None and automaton.initial < 0:
            raise UsageError(
                f"`mode` has no entry for {automaton.name}", remedy=f"use one of {', '.join(automaton.modes)}"
            )
        if chosen is not None:
            known_name(chosen, automaton.modes, f"`mode` of {automaton.name} cannot be", "modes")
        numbers.append(max(automaton.initial, 0) if chosen is None else automaton.modes.index(chosen))
    return np.array(numbers, dtype=np.int64), tuple(by_state)
