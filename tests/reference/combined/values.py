"""What expressions of an abstract model are worth at an instant, and at which known times something changes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .forms import Abstract, Node, lowered, parts_of
from .roots import horner
from .series import Tape

ORDER = 18


class Stop(Exception):
    """The motion ends here, or is not known beyond."""


class Doubles:
    """Arithmetic in doubles."""

    tol, order, last = 1e-9, ORDER, 1e-16
    sin, cos, sqrt = staticmethod(math.sin), staticmethod(math.cos), staticmethod(math.sqrt)

    @staticmethod
    def number(value: Fraction) -> Any:
        return value.numerator / value.denominator


class Digits:
    """Arithmetic in 40 digits."""

    tol, order, last = 1e-24, 36, 1e-36

    def __init__(self) -> None:
        import mpmath

        self.mp = mpmath.mp
        self.mp.dps = 40
        self.sin, self.cos, self.sqrt = mpmath.sin, mpmath.cos, mpmath.sqrt

    def number(self, value: Fraction) -> Any:
        return self.mp.mpf(value.numerator) / value.denominator


@dataclass
class Motion:
    """What the judge found."""

    status: str = "finished"
    message: str = ""
    end: float = 0.0
    pieces: list[tuple[Any, Any, list[list[Any]], dict[str, Any]]] = field(default_factory=list)
    events: list[tuple[float, str, str]] = field(default_factory=list)
    jumps: list[float] = field(default_factory=list)  # all instants at which something happened
    touches: list[tuple[float, str]] = field(default_factory=list)
    near: list[float] = field(default_factory=list)  # known times at which something comes to zero
    unclear: list[tuple[float, str]] = field(default_factory=list)
    borders: list[float] = field(default_factory=list)  # times at which static friction is just enough

    def at(self, time: float, names: list[str]) -> dict[str, float]:
        """States and discrete states at a time."""
        for t, _, rows, discrete in reversed(self.pieces):
            if t <= time:
                values = {n: float(horner(row, time - t)) for n, row in zip(names, rows)}
                return {**values, **{k: float(v) for k, v in discrete.items()}}
        raise ValueError(time)


class Values:
    """The state of a run, and values of expressions in it."""

    def __init__(self, model: Abstract, numbers: dict[str, Fraction], maths: Any = None, nudge: float = 0.0):
        self.m, self.maths = model, maths or Doubles()
        self.tol = self.maths.tol
        self.names = list(model.states)
        self.values: dict[Any, Any] = {k: self.maths.number(v) for k, v in numbers.items()}
        self.rates = {k: lowered(rate) for k, (_, rate) in model.states.items()}
        self.time: Any = self.maths.number(Fraction(0))
        self.x = {k: self.value(start) for k, (start, _) in model.states.items()}
        if nudge:
            self.x = {k: v + nudge * (1 + 0.3 * i) for i, (k, v) in enumerate(self.x.items())}
        self.discrete = {k: self.value(start) for k, start in model.discrete.items()}
        self.modes = {k: a.initial for k, a in model.automata.items()}
        self.config: dict[str, str] = {}
        self.tapes: dict[Any, tuple[Tape, list[tuple[str, str, str, int]]]] = {}
        self.signs: dict[str, int] = {}
        self.motion = Motion()
        self.before: dict[str, Any] = {}
        self.knots: dict[str, list[list[Any]]] = {}
        self.firm: set[str] = set()  # contacts that stick and are not at their limit

    # -- values ----------------------------------------------------------------------------------------------------

    def value(self, e: Node, forces: dict[str, Any] | None = None) -> Any:
        """The value of an expression now; forces that are not given are zero."""
        op, a = e.op, e.args
        if op == "const":
            return self.maths.number(a[0])
        if op == "num":
            return self.values[a[0]]
        if op == "var":
            return self.of_name(a[0], forces)
        if op == "t":
            return self.time
        if op == "window":
            return self.value(a[1] if self.holds(a[0]) else a[2], forces)
        if op in ("table", "slope"):
            return self.table(a[0])[op == "slope"]
        first = self.value(a[0], forces)
        if op == "neg":
            return -first
        if op == "abs":
            return abs(first)
        if op in ("sin", "cos", "sqrt"):
            return getattr(self.maths, op)(first)
        if op == "if":
            return self.value(a[1] if first > 0 else a[2], forces)
        second = self.value(a[1], forces)
        if op == "div":
            return first / second
        return {
            "add": lambda: first + second,
            "sub": lambda: first - second,
            "mul": lambda: first * second,
            "max": lambda: max(first, second),
            "min": lambda: min(first, second),
        }[op]()

    def of_name(self, name: str, forces: dict[str, Any] | None) -> Any:
        if forces and name in forces:
            return forces[name]
        for known in (self.x, self.discrete):
            if name in known:
                return known[name]
        for a, mode in self.modes.items():
            sets = self.m.automata[a].modes[mode].sets
            if name in sets:
                return self.value(sets[name], forces)
        return 0

    def holds(self, c: tuple[Any, ...]) -> bool:
        """Whether a condition on time holds just after now."""
        if c[0] == "and":
            return self.holds(c[1]) and self.holds(c[2])
        if c[0] == "or":
            return self.holds(c[1]) or self.holds(c[2])
        if c[0] == "not":
            return not self.holds(c[1])
        at = self.value(c[1])
        if c[0] == "after":
            return self.time >= at - self.tol
        if c[0] == "before":
            return self.time < at - self.tol
        width = self.value(c[2])
        return at - width - self.tol <= self.time < at + width - self.tol

    def table(self, name: str) -> tuple[Any, Any]:
        """Value and slope of a table just after now."""
        if name not in self.knots:
            self.knots[name] = [[self.value(e) for e in row] for row in self.m.tables[name]]
        times, values = self.knots[name]
        for i in range(len(times) - 2, -1, -1):
            if times[i + 1] > times[i] and self.time >= times[i] - self.tol:
                slope = (values[i + 1] - values[i]) / (times[i + 1] - times[i])
                return values[i] + slope * (self.time - times[i]), slope
        raise Stop("unclear: before the table")

    # -- known times -----------------------------------------------------------------------------------------------

    def known_times(self) -> list[Any]:
        """All times at which something jumps in plain time, or a schedule fires."""
        end = self.m.duration
        times: list[Any] = []
        for test in self.all_tests():
            kind, *rest = test
            at = self.value(rest[0])
            width = self.value(rest[1]) if kind == "near" else 0
            times += [at - width, at + width]
        for knots, _ in self.m.tables.values():
            times += [self.value(e) for e in knots]
        for s in self.m.schedules.values():
            times += self.firings(s)
        out: list[Any] = []
        for t in sorted(times):
            if self.tol < t < end - self.tol and (not out or t - out[-1] > self.tol):
                out.append(t)
        return out + [self.maths.number(Fraction(end))]

    def firings(self, s: Any) -> list[Any]:
        if s.period is None:
            return [self.value(e) for e in s.times]
        first, period = self.value(s.times[0]), self.value(s.period)
        return [first + k * period for k in range(int((self.m.duration - first) / period + 2))]

    def all_tests(self) -> list[tuple[Any, ...]]:
        """The single conditions on time in all expressions."""

        def single(c: tuple[Any, ...]) -> list[tuple[Any, ...]]:
            return (
                single(c[1]) + (single(c[2]) if len(c) > 2 else []) if c[0] in ("and", "or", "not") else [c]
            )

        m = self.m
        whole = [e for s in m.states.values() for e in s] + list(m.relays.values())
        for c in m.contacts.values():
            whole += [c.velocity, c.normal, c.mu_s] + ([c.mu_k] if c.mu_k else [])
        whole += [i.gap for i in m.impacts.values()] + [w.expr for w in m.monitors.values()]
        for a in m.automata.values():
            for mode in a.modes.values():
                whole += (
                    [g.expr for g in mode.guards.values()]
                    + list(mode.rates.values())
                    + list(mode.sets.values())
                )
        return [t for e in whole for p in parts_of(e) if p.op == "window" for t in single(p.args[0])]
