"""This module computes the motion in one combination of modes as Taylor series.

A holding mode (stick) keeps its surface s(t, x) = 0 with an unknown (the friction force) that enters the rates
linearly. Its n-th coefficient follows from s_(n+1) = 0, a small linear system for each order. Afterwards one state
for each surface is computed from s_(n+1) = 0 itself, so that a surface such as v - v_belt stays exactly zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hybridsim.errors import UsageError
from hybridsim.expr import Expression
from hybridsim.reference.multiple_precision.expansion import Expansion, QuantitySeries, terms_of
from hybridsim.reference.multiple_precision.holding import Holding
from hybridsim.reference.multiple_precision.nodes import Node, in_order
from hybridsim.reference.multiple_precision.precision import Number, Precision
from hybridsim.reference.multiple_precision.reading import Reading

# A force from a linear equation is exact to rounding; ten to the minus this is far above that.
_LINEAR = 20


@dataclass(frozen=True)
class Point:
    """The start of a Taylor series: time, states, discrete states, and coefficients of the inputs."""

    t: Number
    x: tuple[Number, ...]
    discrete: tuple[Number, ...]
    input_coefficients: tuple[tuple[Number, ...], ...]


class Program:
    """The Taylor series of states, guards and monitors in one combination of modes."""

    def __init__(self, reading: Reading, precision: Precision, longest: Number) -> None:
        self.reading, self.precision, self.context = reading, precision, precision.context
        self.longest = longest
        self.modes = reading.modes
        self.states = list(reading.states.values())
        self.unknowns = list(reading.unknowns.values())
        self.holding = Holding(reading, self.context) if reading.unknowns else None
        quantities = [node for guards in reading.guards for node in guards] + reading.monitors
        targets = [*reading.rates, *quantities, *reading.surfaces.values()]
        nodes = in_order(targets)
        self.constants = [node for node in nodes if node.constant]
        self.nodes = [node for node in nodes if not node.constant]
        self.forced = _depending(self.nodes, self.unknowns)
        self._known = {id(n) for n in (*nodes, reading.time, *self.states, *self.unknowns)}

    def begin(self, point: Point) -> None:
        """Set all nodes to their values at a point, including the solved unknowns."""
        reading = self.reading
        for held, value in zip(reading.discrete.values(), point.discrete, strict=True):
            held.value = value
        for piece, values in zip(reading.input_coefficients, point.input_coefficients, strict=True):
            for held, value in zip(piece, values, strict=True):
                held.value = value
        for node in (*self.constants, *self.nodes, reading.time, *self.states, *self.unknowns):
            node.c = []
        for node in self.constants:
            node.extend(0)
        zero = self.context.zero
        reading.time.c += [point.t, self.context.one, *[zero] * self.precision.order]
        for state, value in zip(self.states, point.x, strict=True):
            state.c.append(value)
        self._first_coefficients()

    def expand(self, point: Point) -> Expansion:
        """Return the Taylor series of the motion from a point."""
        self.begin(point)
        zero = self.context.zero
        self._states(1)
        for n in range(1, self.precision.order):
            for unknown in self.unknowns:
                unknown.c.append(zero)
            self._extend(self.nodes, n)
            self._solve(n)
            self._states(n + 1)
        return self._expansion(point)

    def _expansion(self, point: Point) -> Expansion:
        reading = self.reading
        rates = dict(zip(map(id, self.states), reading.rates, strict=True))

        def series_of(node: Node) -> QuantitySeries:
            return QuantitySeries(node.c, terms_of(node, rates))

        return Expansion(
            self.precision,
            tuple(map(series_of, self.states)),
            tuple(tuple(map(series_of, row)) for row in reading.guards),
            tuple(map(series_of, reading.monitors)),
            tuple(map(series_of, reading.surfaces.values())),
            self.longest,
        )

    def value(self, expr: Expression, point: Point) -> Number | bool:
        """Return the value of an expression at a point."""
        self.begin(point)
        node = self.reading.node(expr)
        for part in in_order([node]):
            if id(part) not in self._known:
                part.c = []
                part.extend(0)
        return node.c[0]

    def project(self, point: Point) -> Point:
        """Return the point with the held surfaces exactly zero, by a change of one state per surface."""
        if self.holding is None:
            return point
        x = list(point.x)
        for _ in range(
            3
        ):  # Newton's method; most surfaces are linear in the velocities and need one iteration
            self.begin(replace(point, x=tuple(x)))
            changes = self.holding.pin_changes(self.holding.values())
            for i, change in zip(self.holding.pins, changes, strict=True):
                x[i] = x[i] - change
        return replace(point, x=tuple(x))

    def coupled(self, index: int) -> set[int]:
        """Return the held surfaces that an unknown couples with a given surface."""
        return set() if self.holding is None else self.holding.coupled(index)

    # -- orders ---------------------------------------------------------------------------------------------

    def _extend(self, nodes: Sequence[Node], n: int) -> None:
        for node in nodes:
            if len(node.c) <= n:
                node.extend(n)

    def _first_coefficients(self) -> None:
        """Compute the rates at the start without unknown forces, and with each unknown force equal to 1 in turn."""
        one, zero = self.context.one, self.context.zero
        rates: list[list[Number]] = []
        for j in (*range(len(self.unknowns)), -1):  # finally with all of them zero
            for k, unknown in enumerate(self.unknowns):
                unknown.c = [one if k == j else zero]
            self._again(0)
            rates.append([rate.coefficient(0) for rate in self.reading.rates])
        *changed, plain = rates
        if self.holding is not None:
            self.holding.begin(
                [[c - base for c, base in zip(column, plain, strict=True)] for column in changed]
            )
            self._solve(0)

    def _again(self, n: int) -> None:
        """Recompute the n-th coefficients of all nodes that depend on the unknown forces."""
        for node in self.forced:
            node.forget(n)
        self._extend(self.nodes, n)

    def _solve(self, n: int) -> None:
        """Find the n-th coefficients of the unknown forces that keep the surfaces at zero."""
        if self.holding is None:
            return
        rates = self._surface_rates(n)
        for unknown, value in zip(self.unknowns, self.holding.unknowns_for(rates), strict=True):
            unknown.c[n] = value
        self._again(n)
        if n == 0:
            size = max(map(abs, rates)) + self.holding.reach_of([unknown.c[0] for unknown in self.unknowns])
            if max(map(abs, self._surface_rates(0))) > size * self.context.mpf(10) ** -_LINEAR:
                names = ", ".join(self.holding.names)
                raise UsageError(
                    f"the rates are not linear in {names}", remedy="write rates that are linear in each force"
                )

    def _surface_rates(self, n: int) -> list[Number]:
        """Return the n-th coefficients of the rates of the held surfaces."""
        assert self.holding is not None
        for state, rate in zip(self.states, self.reading.rates, strict=True):
            state.c.append(rate.coefficient(n) / (n + 1))
        rates = [(n + 1) * value for value in self.holding.coefficients(n + 1)]
        for state in self.states:
            state.forget(n + 1)
        return rates

    def _states(self, n: int) -> None:
        """Append the n-th coefficients of the states; held states follow from their surfaces."""
        for state, rate in zip(self.states, self.reading.rates, strict=True):
            state.c.append(rate.coefficient(n - 1) / n)
        if self.holding is not None:
            changes = self.holding.pin_changes(self.holding.coefficients(n))
            for i, change in zip(self.holding.pins, changes, strict=True):
                self.states[i].c[n] = self.states[i].c[n] - change


def _depending(nodes: Sequence[Node], sources: Sequence[Node]) -> list[Node]:
    """Return the nodes whose values depend on given nodes, in order."""
    marked = {id(node) for node in sources}
    while True:
        more = {
            id(node) for node in nodes if any(id(o) in marked for o in (*node.operands, *node.delayed))
        } - marked
        if not more:
            return [node for node in nodes if id(node) in marked and node.operands]
        marked |= more
