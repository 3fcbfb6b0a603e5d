"""This module builds Taylor series of functions, as integrals of their slopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.reference.multiple_precision.nodes import Held, Integral, Node, Power, Product, Quotient, Sum
from hybridsim.reference.multiple_precision.precision import Number


class Functions:
    """Builds the series nodes of smooth functions in one arithmetic."""

    def __init__(self, context: Any) -> None:
        self.context = context
        self.one = Held(context, 1)

    def build(self, name: str, u: Node) -> Node:
        """Return the series node of a smooth function of one argument."""
        made: Node = getattr(self, "_" + name)(u)
        return made

    def _exp(self, u: Node) -> Node:
        return Integral(self.context, u, self.context.exp)  # exp is its own slope

    def _pair(self, u: Node, names: tuple[str, str], minus: bool) -> tuple[Integral, Integral]:
        """Return two functions, such as sine and cosine, each of which is the other's derivative up to a sign."""
        first, second = (Integral(self.context, u, getattr(self.context, name)) for name in names)
        first.slope, second.slope = (second, False), (first, minus)
        return first, second

    def _sin(self, u: Node) -> Node:
        return self._pair(u, ("sin", "cos"), True)[0]

    def _cos(self, u: Node) -> Node:
        return self._pair(u, ("sin", "cos"), True)[1]

    def _tan(self, u: Node) -> Node:
        return Quotient(self.context, self._pair(u, ("sin", "cos"), True))

    def _sinh(self, u: Node) -> Node:
        return self._pair(u, ("sinh", "cosh"), False)[0]

    def _cosh(self, u: Node) -> Node:
        return self._pair(u, ("sinh", "cosh"), False)[1]

    def _tanh(self, u: Node) -> Node:
        made = Integral(self.context, u, self.context.tanh)
        made.slope = (self._one_plus_square(made, minus=True), False)
        return made

    def _log(self, u: Node) -> Node:
        made = Integral(self.context, u, self._within("log", self.context.log, lambda x: x > 0))
        made.slope = (Quotient(self.context, (self.one, u)), False)
        return made

    def _sqrt(self, u: Node) -> Node:
        return Power(self.context, u, self.context.mpf(1) / 2)

    def _atan(self, u: Node) -> Node:
        made = Integral(self.context, u, self.context.atan)
        made.slope = (Quotient(self.context, (self.one, self._one_plus_square(u))), False)
        return made

    def _asin(self, u: Node) -> Node:
        return self._arc("asin", u, False)

    def _acos(self, u: Node) -> Node:
        return self._arc("acos", u, True)

    def _arc(self, name: str, u: Node, minus: bool) -> Node:
        inside = self._within(name, getattr(self.context, name), lambda x: abs(x) < 1)
        made = Integral(self.context, u, inside)
        root = self._sqrt(self._one_plus_square(u, minus=True))
        made.slope = (Quotient(self.context, (self.one, root)), minus)
        return made

    def _one_plus_square(self, u: Node, *, minus: bool = False) -> Node:
        return Sum(self.context, self.one, Product(self.context, (u, u)), minus)

    def _within(
        self, name: str, function: Callable[[Number], Number], allowed: Callable[[Number], bool]
    ) -> Callable[[Number], Number]:
        def value(x: Number) -> Number:
            if not allowed(x):
                raise UsageError(
                    f"the run reaches {name}({float(x):g}), which has no Taylor series",
                    remedy="use reference='runs', because the multiple-precision run cannot pass this point",
                )
            return function(x)

        return value
