"""Taylor series of motions in integers: fixed point with so many bits that rounding does not matter.

An expression is a tree of tuples: ("+", a, b), ("sin", a), ..., whose leaves are names and doubles. It has two
readings, which share nothing: `text` is what a model is written with, `Flow` expands it. Numbers are integers in
units of 2**-BITS; sums of products of coefficients are shifted once, so a series of order thirty costs some
thousand products.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from operator import mul
from typing import Any

import mpmath

BITS = 320
ONE = 1 << BITS
Tree = Any  # a tuple, a name or a double

_MP = mpmath.mp.clone()
_MP.prec = BITS + 64
_ARITHMETIC = ("+", "-", "*", "/")


def fixed(value: float | Fraction) -> int:
    """A double, exactly where its last bit is above 2**-BITS."""
    return int(Fraction(value) * ONE)


def real(number: int) -> Fraction:
    """The number that an integer stands for."""
    return Fraction(number, ONE)


def text(tree: Tree) -> str:
    """The expression as a model file has it."""
    if isinstance(tree, str):
        return tree
    if isinstance(tree, float):
        return repr(tree)
    if tree[0] in _ARITHMETIC:
        return f"({text(tree[1])} {tree[0]} {text(tree[2])})"
    return f"{tree[0]}({text(tree[1])})"


def _leading(function: Callable[[Any], Any], a: int) -> int:
    return int(_MP.nint(_MP.ldexp(function(_MP.ldexp(_MP.mpf(a), -BITS)), BITS)))


class Flow:
    """States by name with their rates, and further functions; time is the name t."""

    def __init__(self, rates: Mapping[str, Tree], functions: Sequence[Tree] = ()) -> None:
        self.rows: list[tuple[str, int, int]] = []  # operation and the numbers of its operands
        self.known: dict[Tree, int] = {}
        self.states = {name: self._row(name) for name in rates}
        self._row("t")
        self.rates = [self._row(tree) for tree in rates.values()]
        self.functions = [self._row(tree) for tree in functions]

    def _row(self, tree: Tree) -> int:
        if tree not in self.known:
            operands = [self._row(part) for part in tree[1:]] if isinstance(tree, tuple) else [0]
            self.known[tree] = len(self.rows)
            self.rows.append((tree[0] if isinstance(tree, tuple) else "", operands[0], operands[-1]))
        return self.known[tree]

    def expand(self, values: Mapping[str, int], order: int) -> list[list[int]]:
        """Coefficients 0..order of all rows along the motion from these states, time and parameters."""
        V: list[list[int]] = [[] for _ in self.rows]
        beside: list[list[int]] = [[] for _ in self.rows]  # what goes with a result: the cosine of a sine
        constant = set()
        for leaf, row in self.known.items():
            if isinstance(leaf, tuple):
                continue
            V[row].append(fixed(leaf) if isinstance(leaf, float) else values[leaf])
            if leaf == "t":
                V[row] += [ONE] + [0] * (order - 1)
            elif leaf not in self.states:
                V[row] += [0] * order
                constant.add(row)
        moving = [(k, op, V[a], V[b], V[k], beside[k]) for k, (op, a, b) in enumerate(self.rows) if op]
        pairs = [(V[s], V[r]) for s, r in zip(self.states.values(), self.rates, strict=True)]
        flat = {k: (self.rows[k][1] in constant, self.rows[k][2] in constant) for k, *_ in moving}
        for n in range(order + 1):
            for k, op, a, b, out, also in moving:
                out.append(_coefficient(op, a, b, out, also, n, flat[k]))
            if n < order:
                for state, rate in pairs:
                    state.append(rate[n] // (n + 1))
        return V

    def folds(self, one: Mapping[str, int], other: Mapping[str, int]) -> bool:
        """Whether some part comes down to a number: it has the same value at two random places."""
        first, second = self.expand(one, 1), self.expand(other, 1)
        return any(op and first[k][0] == second[k][0] for k, (op, _, _) in enumerate(self.rows))


def _weighted(a: list[int], b: list[int], n: int, last: int) -> int:
    """sum over i = 1..last of i a_i b_{n-i}."""
    return sum(
        i * x * y for i, x, y in zip(range(1, last + 1), a[1 : last + 1], b[n - last : n][::-1], strict=True)
    )


def _product(a: list[int], b: list[int], n: int) -> int:
    return sum(map(mul, a[: n + 1], b[n::-1]))


def _coefficient(
    op: str, a: list[int], b: list[int], out: list[int], also: list[int], n: int, flat: tuple[bool, bool]
) -> int:
    """Coefficient n of an operation; flat: operands that do not move."""
    if op == "+":
        return a[n] + b[n]
    if op == "-":
        return a[n] - b[n]
    if op == "*":
        if flat[0]:
            return (a[0] * b[n]) >> BITS
        return (a[n] * b[0] if flat[1] else _product(a, b, n)) >> BITS
    if op == "/":
        rest = (a[n] << BITS) - (0 if n == 0 or flat[1] else sum(map(mul, out[:n], b[n:0:-1])))
        return rest // b[0]
    if op == "exp":
        return _leading(_MP.exp, a[0]) if n == 0 else (_weighted(a, out, n, n) // n) >> BITS
    if op == "sqrt":
        return _leading(_MP.sqrt, a[0]) if n == 0 else ((a[n] << BITS) - _inner(out, n)) // (2 * out[0])
    if op in ("sin", "cos"):
        # (sin)' = cos a', (cos)' = -sin a'; what goes beside has the other sign
        sign = 1 if op == "sin" else -1
        other = _MP.cos if op == "sin" else _MP.sin
        if n == 0:
            also.append(_leading(other, a[0]))
            return _leading(getattr(_MP, op), a[0])
        value = (sign * _weighted(a, also, n, n) // n) >> BITS
        also.append((-sign * _weighted(a, out, n, n) // n) >> BITS)
        return value
    if op == "tanh":
        value = _leading(_MP.tanh, a[0]) if n == 0 else (_weighted(a, also, n, n) // n) >> BITS
        also.append((ONE if n == 0 else 0) - (_product([*out, value], [*out, value], n) >> BITS))
        return value
    if op == "atan":
        also.append((ONE if n == 0 else 0) + (_product(a, a, n) >> BITS))
        if n == 0:
            return _leading(_MP.atan, a[0])
        return ((a[n] << BITS) - _weighted(out, also, n, n - 1) // n) // also[0]
    raise ValueError(op)


def _inner(out: list[int], n: int) -> int:
    """sum over i = 1..n-1 of out_i out_{n-i}."""
    return sum(map(mul, out[1:n], out[n - 1 : 0 : -1]))


def horner(coefficients: Sequence[int], h: int) -> int:
    """The value of a series at a distance h."""
    total = 0
    for c in reversed(coefficients):
        total = ((total * h) >> BITS) + c
    return total


def follow(
    flow: Flow, values: dict[str, int], times: Sequence[float], order: int = 32, digits: int = 30
) -> list[list[int]]:
    """States at increasing times from values["t"] on, each step good to so many digits of the largest term."""
    values, found = dict(values), []
    for end in map(fixed, times):
        while values["t"] < end:
            V = flow.expand(values, order)
            h = end - values["t"]
            for row in flow.states.values():
                scale = max(abs(V[row][0]), ONE >> 40)
                for n in (order - 1, order):
                    if V[row][n]:
                        h = min(h, fixed(float(_MP.root(_MP.mpf(scale) / 10**digits / abs(V[row][n]), n))))
            for name, row in flow.states.items():
                values[name] = horner(V[row], h)
            values["t"] += h
        found.append([values[name] for name in flow.states])
    return found
