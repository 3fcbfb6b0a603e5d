"""This module defines the symbols and intermediate results that all steps of a lowering share."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import sympy as sp

from hybridsim.engine.lowering.program import Assign, Switch
from hybridsim.engine.lowering.program_names import shown, user
from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.errors import Place
from hybridsim.expr.parse import Expression
from hybridsim.expr.symbolic import to_sympy
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.switching import ATTRACTION


class LoweringState:
    """The symbols of one model, and the intermediate results of its lowering."""

    def __init__(self, model: Model) -> None:
        self.sp = sp
        self.model = model
        self.components: tuple[Any, ...] = tuple(model.all_components())
        names = [p.name for p in model.parameters] + [s.name for s in model.states]
        names += [d.name for d in model.discrete] + [i.name for i in model.inputs]
        names += [n for n, _ in model.definitions] + ["t"]
        names += sorted({n for c in self.components for m in c.modes for n in m.set})
        names += [c.surface.unknown for c in self.components if c.surface]
        names += [ATTRACTION + c.surface.unknown for c in self.components if c.surface and c.surface.unique]
        self.symbols = {n: sp.Symbol(user(n), real=True) for n in names}
        self.s = sp.Symbol("s", real=True)
        self.t = self.symbols["t"]
        self.parameters = {self.symbols[p.name] for p in model.parameters}
        self.states = [self.symbols[s.name] for s in model.states]
        self._number = {x: i for i, x in enumerate(self.states)}
        self._read: dict[Any, set[Any]] = {}  # free symbols of definitions
        self._gradients: dict[Any, dict[int, Any]] = {}
        self.rates: list[Any] = []
        self.periods: dict[int, Any] = {}  # of waves, by the index of their rate
        self.unknown: dict[int, Any] = {}  # unknown of each surface
        self.definitions: dict[Any, Any] = {}
        self.effects: list[Any] = []  # effect of each unknown on the rate of its own surface
        # held quantity of each unknown: a surface function, or the rate of a gap
        self.held_rates: dict[int, Any] = {}
        self.open_rates: list[Any] = []  # rates of the states as functions of the unknowns
        # components whose unknown does not act on the rate of their surface
        self.never_held: set[int] = set()
        self.partners: dict[int, Any] = {}  # `Partner` relays that the surface of their rate holds
        self.stop_couplings: list[Any] = []  # `StopCoupling` of each gap with friction along it
        self.effect: dict[tuple[int, int], Any] = {}  # effect of unknowns on the rates of held quantities
        self.angles = self._defined_angles()

    def _defined_angles(self) -> dict[Any, Any]:
        """Substitute definitions that grow linearly in time, such as theta = omega*t, in sines and cosines."""
        waiting = {self.symbols[n]: to_sympy(e, self.symbols) for n, e in self.model.definitions}
        found: dict[Any, Any] = {}
        while True:
            written_out = {name: e.subs(found) for name, e in waiting.items() if name not in found}
            grow = {name: e for name, e in written_out.items() if self._rate(e) is not None}
            if not grow:
                return found
            found |= grow

    def _rate(self, e: Any) -> Any:
        """Return the time derivative of an expression if it is not zero and depends on parameters only, else None."""
        if self.t not in e.free_symbols:
            return None
        rate = self.sp.diff(e, self.t)
        return None if rate == 0 or rate.free_symbols - self.parameters else rate

    def convert(self, expression: Expression) -> Any:
        """Return a declared expression in SymPy, in which angles that grow in time are relative to the local time."""
        sp = self.sp
        value = to_sympy(expression, self.symbols)
        if value.has(sp.I, sp.nan, sp.zoo, sp.oo):
            raise expression.error(
                f"'{expression.text}' is not a finite real number: it simplifies to {shown(str(value))}",
                remedy="look for a root or a logarithm of a negative number, or a division by zero",
            )
        return self._local_angles(value)

    def _local_angles(self, e: Any) -> Any:
        sp = self.sp
        if not e.free_symbols & {self.t, *self.angles}:
            return e

        def rewrite(argument: Any, kind: Any) -> Any:
            argument = self._local_angles(argument) if argument.has(sp.sin, sp.cos, sp.tan) else argument
            written_out = argument.subs(self.angles)
            rate = self._rate(written_out)
            if rate is None:
                return kind(argument)
            argument = written_out
            if rate not in self.rates:
                self.rates.append(rate)
            phase = sp.Symbol(f"phase_{self.rates.index(rate)}", real=True)
            return kind(phase + rate * self.s + argument.subs(self.t, 0))

        for kind in (sp.sin, sp.cos, sp.tan):
            e = e.replace(kind, lambda a, k=kind: rewrite(a, k))
        return e

    def signal(self, index: int) -> Any:
        """Return an input as an expression in local time, which is valid until its next knot."""
        sp = self.sp
        declared = self.model.inputs[index]
        if (kind := declared.kind) == "connected":
            raise declared.not_connected(self.model.name)
        c = [sp.Symbol(f"signal_{index}_{j}", real=True) for j in range(SIGNAL_SLOTS)]
        d = self.s - c[4]
        if kind == "step":
            return c[0]
        if kind == "table" or (kind == "wave" and self.model.inputs[index].shape != "sine"):
            return c[0] + d * (c[1] + d * (c[2] + d * c[3]))
        if kind == "wave":
            expressions = declared.expressions
            offset, amplitude, period = (
                self.convert(expressions[n]) for n in ("offset", "amplitude", "period")
            )
            angle = 2 * sp.pi * self.t / period
            value = self._local_angles(offset + amplitude * sp.sin(angle + c[0]))
            if (rate := self._rate(angle)) in self.rates:
                self.periods[self.rates.index(rate)] = period
            return value
        return c[3] * sp.sin(c[0] + d * (c[1] + d * c[2]))

    def inlined(self, expression: Expression) -> Any:
        """Return a declared expression in SymPy with all definitions substituted."""
        return self.inline(self.convert(expression), self.definitions)

    def inline(self, e: Any, definitions: dict[Any, Any]) -> Any:
        """Substitute definitions in an expression, repeatedly, until none is left."""
        while occurring := e.free_symbols & definitions.keys():
            waiting = list(occurring)
            while waiting:  # those that occur in definitions
                definition = definitions[waiting.pop()]
                if definition not in self._read:
                    self._read[definition] = definition.free_symbols
                more = (self._read[definition] & definitions.keys()) - occurring
                occurring |= more
                waiting += more
            e = e.subs({name: definitions[name] for name in occurring})
        return e

    def gradient(self, e: Any) -> dict[int, Any]:
        """Return the derivatives of an expression with respect to its states, by the index of the state."""
        if e not in self._gradients:
            numbers = sorted(self._number[x] for x in e.free_symbols & self._number.keys())
            self._gradients[e] = {i: self.sp.diff(e, self.states[i]) for i in numbers}
        return self._gradients[e]

    def title(self, c: int, plural: bool = False) -> str:
        """Return the term for the function of a surface in messages, such as 'gap' or 'relative velocity'."""
        one, many = "relative velocity", "relative velocities"
        if self.components[c].surface.unique:
            one, many = "switching function", "switching functions"
        elif self.components[c].surface.is_unilateral:
            one, many = "gap", "gaps"
        return many if plural else one

    def written(self, c: int) -> str:
        """Return the declared text of the function of a surface."""
        return " ".join(str(self.components[c].surface.function.text).split())

    def place(self, c: int) -> Place | None:
        """Return the place in the model at which the function of a surface is declared."""
        component = self.components[c]
        return component.surface.function.place or component.place

    def in_modes(self, c: int, name: str, in_hold: Any, otherwise: Any = None, without: Any = None) -> Switch:
        """Return an item that sets a name to one value in the holding mode, and to another in other modes.

        otherwise : value by mode; without it, the unknown's declared value. without : values substituted in
            declared values.
        """
        component = self.components[c]
        surface = component.surface
        rows = []
        for m in component.modes:
            value = in_hold
            if m.name != surface.hold:
                value = self.convert(m.set[surface.unknown]) if otherwise is None else otherwise[m.name]
                if without:
                    value = self.inline(value, self.definitions).subs(without)
            rows.append((Assign(name, value),))
        return Switch(c, tuple(rows))


def pattern_of(e: Any, moving: Container[Any] = ()) -> tuple[Any, dict[Any, Any]]:
    """Return an expression with numbered names in place of its symbols, and a dict of the new name of each symbol.

    Copies of a part have the same pattern, and so share symbolic results. The numbers are in the order of the names, on
    which the order of terms depends. moving : symbols that get another kind of name.
    """
    numbered = {
        s: sp.Symbol(f"{'moving' if s in moving else 'fixed'}_{i:04d}", real=True)
        for i, s in enumerate(sorted(e.free_symbols, key=str))
    }
    return e.xreplace(numbered), numbered
