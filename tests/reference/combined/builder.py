"""Draws numbers, corners and conditions on time for the parts of a random model, and notes which forms it has."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any

from .forms import TIME, Abstract, Node, Number, abs_, cond, constant, max_, min_, node, sin, var, window

WRITTEN = (
    ["literal"] * 8
    + ["parameter"] * 7
    + ["expression"] * 3
    + ["definition"] * 3
    + ["discrete"] * 3
    + ["derived"] * 2
    + ["input"]
)


class Builder:
    """A model that grows part by part."""

    def __init__(self, seed: int):
        self.rng = random.Random(seed)
        self.m = Abstract()
        self.count: dict[str, int] = {}

    def name(self, stem: str) -> str:
        self.count[stem] = self.count.get(stem, 0) + 1
        return f"{stem}{self.count[stem]}"

    def tag(self, *features: str) -> None:
        self.m.features.update(features)

    def chance(self, p: float) -> bool:
        return self.rng.random() < p

    # -- numbers ---------------------------------------------------------------------------------------------------

    def num(self, low: Any, high: Any, steps: int = 20, fixed: bool = False) -> Node:
        """A number between two bounds, on a grid of decimal fractions."""
        written = "literal" if fixed else self.rng.choice(WRITTEN)
        number = Number(Fraction(str(low)), Fraction(str(high)), steps, written)
        if written in ("literal", "input"):
            number.value = drawn(number, self.rng)
        self.tag(f"number: {written}")
        key = self.name("c")
        self.m.numbers[key] = number
        return Node("num", (key,))

    def derived(self, formula: Node) -> Node:
        """A number that is what a formula of others gives, written as a number of its own or as the formula."""
        if self.chance(0.4):
            return formula
        key = self.name("c")
        written = self.rng.choice(["parameter", "expression", "definition", "discrete", "derived"])
        self.m.numbers[key] = Number(Fraction(0), Fraction(0), 1, written, None, formula)
        return Node("num", (key,))

    def either(self, e: Node) -> Node:
        return e if self.chance(0.5) else -e

    # -- forms -----------------------------------------------------------------------------------------------------

    def corner(self, x: Node, place: str, size: float = 1.0) -> Node:
        """A continuous function of x with zeros, most often with corners."""
        kind = self.rng.choice(["plain", "max", "min", "abs", "conditional", "nested", "sum", "two-sided"])
        a, w = self.num(-size, size), self.num(0.2 * size, size)
        self.tag(f"in {place}")
        if kind == "plain":
            return x - a
        self.tag("abs" if kind in ("nested", "sum") else "max" if kind == "two-sided" else kind)
        if kind == "max":
            return max_(x - a, self.num(0.2, 0.9) * (x - w))
        if kind == "min":
            return min_(x - a, self.num(0.2, 0.9) * (x + w))
        if kind == "abs":
            return self.either(abs_(x - a) - w)
        if kind == "conditional":
            k = self.num(0.2, 0.8)
            return cond(x - a, x - a, k * (x - a)) + w * node("0.5")
        if kind == "nested":
            return self.either(abs_(abs_(x) - w) - self.num(0.1, 0.2))
        if kind == "sum":
            return abs_(x) + abs_(x - w) - (w + self.num(0.2, 0.8))
        return max_(x - w, -x - w)

    def positive(self, x: Node, place: str) -> Node:
        """A function of x that is above zero and has corners."""
        base, k = self.num(1, 3), self.num(0.2, 1)
        kind = self.rng.choice(["abs", "max", "min", "conditional"])
        self.tag(kind, f"in {place}")
        if kind == "abs":
            return base + k * abs_(x)
        if kind == "max":
            return max_(base, base + k * x)
        if kind == "min":
            return base + k * min_(abs_(x), self.num(0.5, 1))
        return cond(x, base + k * x, base - node("0.5") * k * x)

    def moment(self) -> Node:
        """A time within the run."""
        return self.num("0.4", "4.4", 40)

    def switched(self, a: Any, b: Any, place: str) -> Node:
        """``a`` in a part of time, ``b`` in the rest."""
        kind = self.rng.choice(["after", "and", "or", "not", "near", "both"])
        one = self.moment()
        two = one + self.num("0.1", 1)
        self.tag(
            "condition on time: single" if kind == "after" else "condition on time: Boolean", f"in {place}"
        )
        tests: dict[str, tuple[Any, ...]] = {
            "after": ("after", one),
            "and": ("and", ("after", one), ("before", two)),
            "or": ("or", ("before", one), ("after", two)),
            "not": ("not", ("after", one)),
            "near": ("near", one, self.num("0.05", "0.3", 5)),
            "both": (
                "and",
                ("not", ("before", one)),
                ("or", ("before", two), ("after", two + self.num("0.1", "0.5"))),
            ),
        }
        return window(tests[kind], a, b)

    def force(self, low: float = -2, high: float = 2) -> Node:
        """A force of time: constant, a sine, switched, a table."""
        kind = self.rng.choice(["constant", "constant", "sine", "switched", "table", "wave"])
        if kind == "constant":
            return self.num(low, high)
        if kind == "sine":
            self.tag("sine")
            return self.num(low, high) + self.num(0.5, 3) * sin(self.num(1, 5) * TIME)
        if kind == "switched":
            return self.switched(self.num(low, high), self.num(low, high), "rate")
        return self.table(low, high) if kind == "table" else self.wave()

    def wave(self) -> Node:
        """A square or triangle wave, known as the table of its knots."""
        self.tag("input: wave")
        name, square = self.name("wave"), self.chance(0.5)
        period, size = Fraction(self.rng.randint(4, 20), 10), Fraction(self.rng.randint(5, 20), 10)
        times, values = [], []
        for k in range(-4, 4 * int(6 / period + 2)):
            at = period * k / 4
            if square and k % 2 == 0:
                times += [at, at]
                values += [-size, size] if k % 4 == 0 else [size, -size]
            elif not square and k % 2:
                times.append(at)
                values.append(size if k % 4 == 1 else -size)
        self.m.tables[name] = [node(t) for t in times], [node(v) for v in values]
        self.m.waves[name] = "square" if square else "triangle", period, size
        return Node("table", (name,))

    def other(self) -> Node | None:
        """A state that is there already, of a kind whose value may be anything."""
        names = [n for n in self.m.states if n[0] in "xyvqu"]
        return var(self.rng.choice(names)) if names else None

    def table(self, low: float, high: float) -> Node:
        self.tag("input: table")
        name = self.name("tab")
        n = self.rng.randint(2, 4)
        inner = sorted(self.rng.sample(range(5, 45), n))
        times = [node(-1)] + [node(Fraction(k, 10)) for k in inner] + [node(6)]
        if self.chance(0.5):
            self.tag("input: jump")
            times.insert(2, times[1])
        grid = [
            node(Fraction(self.rng.randint(0, 20), 20) * Fraction(high - low) + Fraction(low)) for _ in times
        ]
        self.m.tables[name] = times, grid
        return Node("table", (name,))

    def state(self, stem: str, start: Any, rate: Any) -> Node:
        name = self.name(stem)
        self.m.states[name] = node(start), node(rate)
        return var(name)

    def add_rate(self, x: Node, rate: Node) -> None:
        start, old = self.m.states[x.args[0]]
        self.m.states[x.args[0]] = start, old + rate


def drawn(number: Number, rng: random.Random) -> Fraction:
    """A value of a number."""
    return number.low + (number.high - number.low) * Fraction(rng.randint(0, number.steps), number.steps)


def number_set(model: Abstract, seed: int, draw: int) -> dict[str, Fraction]:
    """The values of all numbers in one draw."""
    rng = random.Random(seed * 1000003 + draw)
    out = {}
    for key, number in model.numbers.items():
        value = drawn(number, rng)
        out[key] = value if number.value is None else number.value
        if number.formula is not None:
            out[key] = constant(number.formula, out)
    return out
