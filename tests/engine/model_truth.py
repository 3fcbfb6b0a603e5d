"""A declared model evaluated by hand: every expression in mpmath, the unknowns of holding modes by a linear solve.

Nothing that the engine computes is used: names are looked up in the declaration, and what a holding mode solves for
is found from d(surface)/dt = 0, or for a gap from d2(gap)/dt2 = 0, differentiated numerically along the motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import numpy as np
from engine.multiple_precision import evaluate

from hybridsim.engine.system.system import System
from hybridsim.model import Model
from hybridsim.model.parts.switching import ATTRACTION


class ByHand:
    """A model at one instant in one combination of modes."""

    def __init__(
        self,
        model: Model,
        modes: Mapping[str, str],
        t: Any,
        x: Mapping[str, float],
        discrete: Mapping[str, float] | None = None,
        inputs: Mapping[str, Any] | None = None,
    ) -> None:
        self.model, self.t = model, mpmath.mpf(t)
        self.x = {n: mpmath.mpf(v) for n, v in x.items()}
        self.known = {n: mpmath.mpf(v) for n, v in model.parameter_values().items()}
        self.known |= {n: mpmath.mpf(v) for n, v in (discrete or {}).items()}
        self.known |= dict(inputs or {})
        self.formulas = {n: e.text for n, e in model.definitions}
        self.der = {s.name: s.der.text for s in model.states}
        self.guards: dict[str, list[str]] = {}
        self.holding: dict[str, str] = {}  # unknown -> surface, kept at zero by its rate
        self.closed: dict[str, str] = {}  # unknown -> gap, kept at zero by its acceleration
        for component in model.all_components():
            mode = next(m for m in component.modes if m.name == modes[component.name])
            self.formulas |= {n: e.text for n, e in mode.set.items()}
            self.der |= {n: e.text for n, e in mode.der.items()}
            self.guards[component.name] = [g.expr.text for g in mode.guards]
            if component.surface and mode.name == component.surface.hold:
                kept = self.holding if component.surface.restitution is None else self.closed
                kept[component.surface.unknown] = component.surface.function.text
        self.attraction: dict[str, Any] = {}  # how strongly each unknown pulls towards its own surface
        self.unknown: dict[str, Any] = {}
        self.unknown = self.solve()

    def value(self, text: str, t: Any = None, x: Mapping[str, Any] | None = None) -> Any:
        """Value of an expression, here or at another time and state."""
        t, x = (self.t, self.x) if x is None else (t, x)
        return evaluate(text, Names(self, t, x))

    def slope(self, t: Any = None, x: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """dx/dt, here or at another time and state."""
        return {n: self.value(e, t, x) for n, e in self.der.items()}

    def rate(self, surface: str, order: int = 1) -> Any:
        """Derivative of that order of a surface along the motion, d(surface)/dt for 1."""
        return self.along(lambda t, x: self.value(surface, t, x), order, self.t, self.x)

    def along(
        self, quantity: Callable[[Any, Mapping[str, Any]], Any], order: int, t: Any, x: Mapping[str, Any]
    ) -> Any:
        if order == 0:
            return quantity(t, x)
        slope = self.slope(t, x)
        return mpmath.diff(
            lambda h: self.along(quantity, order - 1, t + h, {n: v + h * slope[n] for n, v in x.items()}),
            0,
        )

    def solve(self) -> dict[str, Any]:
        """The forces that keep every held surface where it is: they enter the rates linearly."""
        orders = dict.fromkeys(self.holding, 1) | dict.fromkeys(self.closed, 2)
        kept = self.holding | self.closed
        names = list(kept)
        if not names:
            return {}

        def rates(values: list[Any]) -> Any:
            self.unknown = dict(zip(names, values, strict=True))
            return mpmath.matrix([self.rate(kept[name], orders[name]) for name in names])

        n = len(names)
        at_rest = rates([mpmath.mpf(0)] * n)
        effect = mpmath.matrix(n, n)
        for j in range(n):
            column = rates([mpmath.mpf(int(i == j)) for i in range(n)]) - at_rest
            for i in range(n):
                effect[i, j] = column[i]
        self.attraction = {f"{ATTRACTION}{name}": -effect[i, i] for i, name in enumerate(names)}
        right = -at_rest
        for i, name in enumerate(names):
            if all(effect[i, j] == 0 for j in range(n)) and orders[name] == 1:
                partner = self.held_by(name)
                j = names.index(partner) if partner in names else None
                self.attraction[f"{ATTRACTION}{name}"] = mpmath.mpf(-1) if j is None else -effect[j, i]
                effect[i, i] = mpmath.mpf(1)
                if j is not None:
                    effect[i, j] = mpmath.mpf(-1)
                right[i] = mpmath.mpf(0) if j is not None else self.value(partner)
        solution = mpmath.lu_solve(effect, right)
        return {name: solution[i] for i, name in enumerate(names)}

    def held_by(self, name: str) -> str:
        """The relay whose function is the rate of another's, on which no relay acts: they share one value."""
        rate = self.rate(self.holding[name])
        return next(
            c.surface.unknown
            for c in self.model.all_components()
            if c.surface
            and c.surface.unknown != name
            and abs(self.value(c.surface.function.text) - rate) <= mpmath.mpf(10) ** -30
        )


class Names(Mapping[str, Any]):
    """Every name of a model, worked out when it is asked for."""

    def __init__(self, by_hand: ByHand, t: Any, x: Mapping[str, Any]) -> None:
        self.by_hand = by_hand
        self.given = {"t": t, **by_hand.known, **x, **by_hand.unknown, **by_hand.attraction}

    def __getitem__(self, name: str) -> Any:
        if name not in self.given:
            self.given[name] = evaluate(self.by_hand.formulas[name], self)
        return self.given[name]

    def __iter__(self) -> Any:
        return iter({**self.given, **self.by_hand.formulas})

    def __len__(self) -> int:
        return len(list(iter(self)))


def combinations(system: System) -> list[np.ndarray]:
    """The numbers of the modes of all components, in every combination."""
    sizes = [len(a.modes) for a in system.automata]
    return [np.array(z, dtype=np.int64) for z in itertools.product(*map(range, sizes))]
