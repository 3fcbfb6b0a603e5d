"""Taylor series of a motion in one configuration of a model, coefficient by coefficient, in any arithmetic."""

from __future__ import annotations

from typing import Any

from .forms import Node

Slots = list[list[Any]]


class Tape:
    """The operations of some expressions, each once, and where their series stand."""

    def __init__(self, states: list[str], unknowns: list[str]):
        self.states, self.unknowns = states, unknowns
        self.ops: list[tuple[str, int, Any]] = []
        self.at: dict[Node, int] = {}
        self.size = 0
        self.fixed: set[int] = set()  # slots whose value never changes
        self.state_slot = {name: self._new() for name in states}
        self.unknown_slot = {name: self._new() for name in unknowns}
        self.rates: list[tuple[int, int]] = []
        self.constraints: list[int] = []
        self.switches: dict[Node, int] = {}  # argument of a conditional: its slot

    def _new(self) -> int:
        self.size += 1
        return self.size - 1

    def add(self, e: Node) -> int:
        """The slot of a lowered expression."""
        if e in self.at:
            return self.at[e]
        if e.op == "var" and e.args[0] in self.state_slot:
            return self.state_slot[e.args[0]]
        if e.op == "var" and e.args[0] in self.unknown_slot:
            return self.unknown_slot[e.args[0]]
        if e.op == "if":
            test = self.add(e.args[0])
            self.switches[e.args[0]] = test
            data: Any = (e.args[0], self.add(e.args[1]), self.add(e.args[2]))
        elif e.op == "window":
            data = (e.args[0], self.add(e.args[1]), self.add(e.args[2]))
        elif e.op in ("num", "const", "var", "t", "table", "slope"):
            data = e.args
        elif e.op in ("sin", "cos"):
            first = self.add(e.args[0])
            other = Node("cos" if e.op == "sin" else "sin", e.args)
            here, there = self._new(), self._new()
            self.at[e], self.at[other] = here, there
            self.ops.append(
                (
                    "sincos",
                    here if e.op == "sin" else there,
                    (here + there - (here if e.op == "sin" else there), first),
                )
            )
            return here
        else:
            data = tuple(self.add(a) for a in e.args)
        slot = self._new()
        self.at[e] = slot
        if e.op in ("num", "const") or (
            e.op in ("add", "sub", "mul", "div", "neg") and self.fixed.issuperset(data)
        ):
            self.fixed.add(slot)
        self.ops.append((e.op, slot, data))
        return slot


class Surroundings:
    """What a tape reads besides its states: numbers, discrete variables, time, sides of conditionals."""

    def __init__(self, values: dict[str, Any], time: Any, sides: dict[Node, bool], clock: Any, maths: Any):
        self.values, self.time, self.sides, self.clock, self.maths = values, time, sides, clock, maths


def one_pass(tape: Tape, c: Slots, k: int, s: Surroundings) -> None:
    """The coefficients of order k of all operations, from those of the states up to k."""
    for op, slot, data in tape.ops:
        if k and slot in tape.fixed:
            _put(c[slot], k, 0)
            continue
        if op == "add":
            value = c[data[0]][k] + c[data[1]][k]
        elif op == "sub":
            value = c[data[0]][k] - c[data[1]][k]
        elif op == "neg":
            value = -c[data[0]][k]
        elif op == "mul":
            a, b = c[data[0]], c[data[1]]
            if data[0] in tape.fixed or data[1] in tape.fixed:
                _put(c[slot], k, a[0] * b[k] if data[0] in tape.fixed else a[k] * b[0])
                continue
            value = 0
            for i in range(k + 1):
                if a[i] and b[k - i]:
                    value = value + a[i] * b[k - i]
        elif op in ("const", "num", "var"):
            value = s.values[data[0]] if k == 0 else 0
        elif op == "if":
            value = c[data[1] if s.sides[data[0]] else data[2]][k]
        elif op == "window":
            value = c[data[1] if s.clock.holds(data[0]) else data[2]][k]
        elif op == "t":
            value = s.time if k == 0 else 1 if k == 1 else 0
        elif op == "div":
            a, b, q = c[data[0]], c[data[1]], c[slot]
            value = a[k]
            for i in range(1, k + 1):
                if b[i]:
                    value = value - b[i] * q[k - i]
            value = value / b[0]
        elif op == "sqrt":
            a, q = c[data[0]], c[slot]
            if k == 0:
                value = s.maths.sqrt(a[0])
            else:
                value = a[k]
                for i in range(1, k):
                    value = value - q[i] * q[k - i]
                value = value / (2 * q[0])
        elif op == "sincos":
            other, first = data
            u = c[first]
            if k == 0:
                value, partner = s.maths.sin(u[0]), s.maths.cos(u[0])
            else:
                value = partner = 0
                for i in range(1, k + 1):
                    if u[i]:
                        value = value + i * u[i] * c[other][k - i]
                        partner = partner - i * u[i] * c[slot][k - i]
                value, partner = value / k, partner / k
            _put(c[other], k, partner)
        elif op == "table":
            here = s.clock.table(data[0])
            value = here[k] if k < 2 else 0
        elif op == "slope":
            value = s.clock.table(data[0])[1] if k == 0 else 0
        else:
            raise ValueError(op)
        _put(c[slot], k, value)


def _put(row: list[Any], k: int, value: Any) -> None:
    if len(row) == k:
        row.append(value)
    else:
        row[k] = value


def solved(matrix: list[list[Any]], right: list[Any]) -> list[Any] | None:
    """The solution of a small linear system by elimination; None where it is singular."""
    n = len(right)
    rows = [list(matrix[i]) + [right[i]] for i in range(n)]
    for i in range(n):
        p = max(range(i, n), key=lambda r: abs(rows[r][i]))
        if abs(rows[p][i]) < 1e-9:
            return None
        rows[i], rows[p] = rows[p], rows[i]
        for r in range(n):
            if r != i and rows[r][i]:
                f = rows[r][i] / rows[i][i]
                rows[r] = [x - f * y for x, y in zip(rows[r], rows[i])]
    return [rows[i][n] / rows[i][i] for i in range(n)]


def series(tape: Tape, start: list[Any], s: Surroundings, order: int) -> Slots | None:
    """Series of all slots up to the order; None where the forces that hold are not determined."""
    c: Slots = [[] for _ in range(tape.size)]
    for slot, value in zip(tape.state_slot.values(), start):
        c[slot].append(value)
    unknown = list(tape.unknown_slot.values())
    effect: list[list[Any]] = []
    for k in range(order + 1):
        for slot in unknown:
            _put(c[slot], k, 0)
        one_pass(tape, c, k, s)
        if unknown:
            left = [c[q][k] for q in tape.constraints]
            if k == 0:
                columns = []
                for slot in unknown:
                    c[slot][0] = 1
                    one_pass(tape, c, 0, s)
                    columns.append([c[q][0] - free for q, free in zip(tape.constraints, left)])
                    c[slot][0] = 0
                effect = [[column[i] for column in columns] for i in range(len(left))]
            answer = solved(effect, [-free for free in left])
            if answer is None:
                return None
            for slot, value in zip(unknown, answer):
                c[slot][k] = value
            one_pass(tape, c, k, s)
        if k < order:
            for state, rate in tape.rates:
                _put(c[state], k + 1, c[rate][k] / (k + 1))
    return c
