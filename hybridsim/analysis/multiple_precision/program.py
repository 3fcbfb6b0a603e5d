"""The motion of one vector of modes as Taylor series, forces that hold a surface solved for on the way.

A holding mode (stick) keeps its surface s(t, x) = 0 with an unknown (the friction force) that enters the rates
linearly. The n-th coefficient of the unknown enters s_(n+1) through B = J G / (n + 1), with J the slopes of the
surfaces along the states and G the effect of the unknowns on the rates, both at the start of the series: so it is
found from a small linear system, order by order. Afterwards one state for each surface is taken from s_(n+1) = 0
itself, so that a surface such as v - v_belt stays zero exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hybridsim.analysis.multiple_precision.expansion import Expansion, Watched, terms_of
from hybridsim.analysis.multiple_precision.nodes import Node, in_order
from hybridsim.analysis.multiple_precision.precision import Number, Precision
from hybridsim.analysis.multiple_precision.reading import Reading
from hybridsim.errors import UsageError

if TYPE_CHECKING:
    from hybridsim.expr import Expression

# A force found from a linear equation leaves rounding of it; ten to the minus this is far above that.
_LINEAR = 20


@dataclass(frozen=True)
class Point:
    """Where a series starts: time, states, discrete states, and the pieces of the inputs that hold there."""

    t: Number
    x: tuple[Number, ...]
    discrete: tuple[Number, ...]
    pieces: tuple[tuple[Number, ...], ...]


class Program:
    """Taylor series of the states, and of what is watched, in one vector of modes."""

    def __init__(self, reading: Reading, precision: Precision, longest: Number) -> None:
        self.reading, self.precision, self.context = reading, precision, precision.context
        self.longest = longest
        self.modes = reading.modes
        self.states = list(reading.states.values())
        self.unknowns = list(reading.unknowns.values())
        self.held = [reading.surfaces[name] for name in reading.unknowns]
        watched = [node for guards in reading.guards for node in guards] + reading.monitors
        wanted = [*reading.rates, *watched, *reading.surfaces.values()]
        nodes = in_order(wanted)
        self.constants = [node for node in nodes if node.constant]
        self.nodes = [node for node in nodes if not node.constant]
        self.ahead = [node for node in in_order(self.held) if node.operands and not node.constant]
        self.forced = _depending(self.nodes, self.unknowns)
        self._known = {id(n) for n in (*nodes, reading.time, *self.states, *self.unknowns)}
        self.effects: list[list[Number]] = []
        self.slopes: list[list[Number]] = []
        self.pins: list[int] = []

    def begin(self, point: Point) -> None:
        """Set everything up to the values at a point, the unknowns solved for."""
        reading = self.reading
        for held, value in zip(reading.discrete.values(), point.discrete, strict=True):
            held.value = value
        for piece, values in zip(reading.pieces, point.pieces, strict=True):
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
        """The series from a point on."""
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

        def watched(node: Node) -> Watched:
            return Watched(node.c, terms_of(node, rates))

        return Expansion(
            self.precision,
            tuple(map(watched, self.states)),
            tuple(tuple(map(watched, row)) for row in reading.guards),
            tuple(map(watched, reading.monitors)),
            tuple(map(watched, reading.surfaces.values())),
            self.longest,
        )

    def value(self, expr: Expression, point: Point) -> Number | bool:
        """The value of an expression at a point."""
        self.begin(point)
        node = self.reading.node(expr)
        for part in in_order([node]):
            if id(part) not in self._known:
                part.c = []
                part.extend(0)
        return node.c[0]

    def project(self, point: Point) -> Point:
        """The point with the held surfaces exactly zero: one state each is set."""
        if not self.held:
            return point
        x = list(point.x)
        for _ in range(
            3
        ):  # Newton's method: a surface is linear in the velocities, as a rule, and zero at once
            self.begin(Point(point.t, tuple(x), point.discrete, point.pieces))
            for i, change in zip(self.pins, self._pin_changes(0), strict=True):
                x[i] = x[i] - change
        return Point(point.t, tuple(x), point.discrete, point.pieces)

    def coupled(self, index: int) -> set[int]:
        """The held surfaces whose rates the unknown of one of them changes, or the reverse."""
        product = self._product()
        return {j for j in range(len(self.held)) if product[index][j] != 0 or product[j][index] != 0}

    # -- orders ---------------------------------------------------------------------------------------------

    def _extend(self, nodes: Sequence[Node], n: int) -> None:
        for node in nodes:
            if len(node.c) <= n:
                node.extend(n)

    def _first_coefficients(self) -> None:
        """Order 0: rates with every unknown zero, then one by one 1; slopes of the surfaces; the unknowns."""
        one, zero = self.context.one, self.context.zero
        m = len(self.unknowns)
        columns: list[list[Number]] = []
        for j in range(-1, m):
            for k, unknown in enumerate(self.unknowns):
                unknown.c = [one if k == j else zero]
            for node in self.forced:
                node.forget(0)
            self._extend(self.nodes, 0)
            columns.append([rate.coefficient(0) for rate in self.reading.rates])
        self.effects = [
            [c - base for c, base in zip(column, columns[0], strict=True)] for column in columns[1:]
        ]
        if not m:
            return
        for unknown in self.unknowns:
            unknown.c = [zero]
        for node in self.forced:
            node.forget(0)
        self._extend(self.nodes, 0)
        self._find_slopes()
        self.pins = self._choose_pins()
        self._solve(0)
        for state in self.states:
            state.forget(1)

    def _find_slopes(self) -> None:
        """The slope of each held surface along each state, from its first-order coefficient."""
        zero, one = self.context.zero, self.context.one
        rows = []
        for i in range(-1, len(self.states)):
            for k, state in enumerate(self.states):
                state.c[1:] = [one if k == i else zero]
            self._extend(self.ahead, 1)
            rows.append([surface.coefficient(1) for surface in self.held])
            for node in self.ahead:
                node.forget(1)
        for state in self.states:
            state.forget(1)
        self.slopes = [[row[j] - rows[0][j] for row in rows[1:]] for j in range(len(self.held))]

    def _product(self) -> list[list[Number]]:
        """B = J G: row j, the rate of surface j under each unknown."""
        return [[self.context.fdot(row, effect) for effect in self.effects] for row in self.slopes]

    def _choose_pins(self) -> list[int]:
        """For each held surface a state that it can be solved for: elimination with the largest pivots."""
        rows = [
            [slope if any(e[i] != 0 for e in self.effects) else 0 * slope for i, slope in enumerate(row)]
            for row in self.slopes
        ]
        pins = [-1] * len(rows)
        for _ in rows:
            size, j, i = max(
                (abs(value), j, i) for j, row in enumerate(rows) if pins[j] < 0 for i, value in enumerate(row)
            )
            if size == 0:
                name = list(self.reading.unknowns)[j]
                raise UsageError(
                    f"the force {name} does not act on the velocity of its own contact",
                    remedy="let it enter the rate of that velocity",
                )
            pins[j] = i
            for k, row in enumerate(rows):
                if pins[k] < 0 and row[i] != 0:
                    factor = row[i] / rows[j][i]
                    rows[k] = [a - factor * b for a, b in zip(row, rows[j], strict=True)]
                    rows[k][i] = self.context.zero
        return pins

    def _solve(self, n: int) -> None:
        """Find the n-th coefficients of the unknowns: with them, the surfaces have no coefficient n + 1."""
        if not self.unknowns:
            return
        self._states(n + 1, pinned=False)
        self._extend(self.ahead, n + 1)
        residual = [(n + 1) * surface.coefficient(n + 1) for surface in self.held]
        for node in (*self.ahead, *self.states):
            node.forget(n + 1)
        solution = self._linear(self._product(), residual)
        for unknown, value in zip(self.unknowns, solution, strict=True):
            unknown.c[n] = -value
        for node in self.forced:
            node.forget(n)
        self._extend(self.nodes, n)
        if n == 0:
            self._check_linear(residual)

    def _check_linear(self, residual: Sequence[Number]) -> None:
        self._states(1, pinned=False)
        self._extend(self.ahead, 1)
        left = [abs(surface.coefficient(1)) for surface in self.held]
        for node in (*self.ahead, *self.states):
            node.forget(1)
        size = max(abs(value) for value in residual) + max(
            abs(a * u.c[0]) for row in self._product() for a, u in zip(row, self.unknowns, strict=True)
        )
        if max(left) > size * self.context.mpf(10) ** -_LINEAR:
            names = ", ".join(self.reading.unknowns)
            raise UsageError(
                f"the rates are not linear in {names}", remedy="a holding force must enter them linearly"
            )

    def _linear(self, matrix: list[list[Number]], right: list[Number]) -> list[Number]:
        if len(right) == 1:
            if matrix[0][0] == 0:
                name = next(iter(self.reading.unknowns))
                raise UsageError(
                    f"the force {name} does not act on the velocity of its own contact",
                    remedy="let it enter the rate of that velocity",
                )
            return [right[0] / matrix[0][0]]
        try:
            return list(self.context.lu_solve(self.context.matrix(matrix), self.context.matrix(right)))
        except ZeroDivisionError:
            names = ", ".join(self.reading.unknowns)
            raise UsageError(
                f"the holding forces {names} have no unique values", remedy="merge contacts that act as one"
            ) from None

    def _pin_changes(self, n: int) -> list[Number]:
        """By how much the pinned states' n-th coefficients are to fall, so that the surfaces' vanish."""
        values = [surface.coefficient(n) for surface in self.held]
        if len(values) == 1:
            return [values[0] / self.slopes[0][self.pins[0]]]
        return self._linear([[row[i] for i in self.pins] for row in self.slopes], values)

    def _states(self, n: int, *, pinned: bool = True) -> None:
        """Append the n-th coefficients of the states; the pinned ones follow from their surfaces."""
        for state, rate in zip(self.states, self.reading.rates, strict=True):
            state.c.append(rate.coefficient(n - 1) / n)
        if pinned and self.held:
            self._extend(self.ahead, n)
            changes = self._pin_changes(n)
            for node in self.ahead:
                node.forget(n)
            for i, change in zip(self.pins, changes, strict=True):
                self.states[i].c[n] = self.states[i].c[n] - change


def _depending(nodes: Sequence[Node], sources: Sequence[Node]) -> list[Node]:
    """The nodes, in order, whose values depend on the sources, also by way of a slope."""
    marked = {id(node) for node in sources}
    while True:
        more = {
            id(node) for node in nodes if any(id(o) in marked for o in (*node.operands, *node.delayed))
        } - marked
        if not more:
            return [node for node in nodes if id(node) in marked and node.operands]
        marked |= more
