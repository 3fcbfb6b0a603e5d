"""This module represents quantities as truncated power series in time.

A node computes its n-th coefficient from the coefficients of its operands up to the n-th (A. Griewank, A.
Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 13, doi:10.1137/1.9780898717761). A step costs a
number of products that grows as the square of the order. The coefficients of the states follow order by
order: x_(n+1) = (rate of x)_n / (n + 1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.reference.multiple_precision.precision import Number


class Node:
    """A quantity as a power series; ``c`` contains its coefficients so far."""

    __slots__ = ("c", "constant", "context", "operands")

    def __init__(self, context: Any, operands: Sequence[Node], constant: bool | None = None) -> None:
        self.context = context
        self.operands = tuple(operands)
        self.constant: bool = all(node.constant for node in operands) if constant is None else constant
        self.c: list[Any] = []

    @property
    def delayed(self) -> tuple[Node, ...]:
        """Return the operands whose n-th coefficient is not needed for the n-th coefficient of this node."""
        return ()

    def coefficient(self, n: int) -> Number:
        """Return the n-th coefficient; a constant has zeros after the first coefficient."""
        return self.c[n] if n < len(self.c) else self.context.zero

    def extend(self, n: int) -> None:
        """Append the n-th coefficient; a constant has only the first coefficient."""
        raise NotImplementedError

    def forget(self, n: int) -> None:
        """Delete the coefficients from the n-th on."""
        del self.c[n:]


class Held(Node):
    """A number that is constant during a mode: a parameter, a discrete state, or a literal."""

    __slots__ = ("value",)

    def __init__(self, context: Any, value: Any) -> None:
        super().__init__(context, (), constant=True)
        self.value = context.mpf(value) if not isinstance(value, bool) else value

    def extend(self, n: int) -> None:
        self.c.append(self.value)


class ExternalSeries(Node):
    """A power series whose coefficients are set from outside: a state, a force, the time, an input."""

    __slots__ = ()

    def __init__(self, context: Any) -> None:
        super().__init__(context, (), constant=False)

    def extend(self, n: int) -> None:
        """Do nothing, because the coefficients are appended from outside."""


class Sum(Node):
    """The sum of two quantities, a + sign*b."""

    __slots__ = ("minus",)

    def __init__(self, context: Any, a: Node, b: Node, minus: bool) -> None:
        super().__init__(context, (a, b))
        self.minus = minus

    def extend(self, n: int) -> None:
        a, b = self.operands
        if n and b.constant:
            self.c.append(a.c[n])
        elif n and a.constant:
            self.c.append(-b.c[n] if self.minus else b.c[n])
        else:
            self.c.append(a.c[n] - b.c[n] if self.minus else a.c[n] + b.c[n])


class Negative(Node):
    """The negative of a quantity, -a."""

    __slots__ = ()

    def extend(self, n: int) -> None:
        self.c.append(-self.operands[0].c[n])


class Product(Node):
    """The product of two quantities, a*b."""

    __slots__ = ()

    def extend(self, n: int) -> None:
        a, b = self.operands
        if a.constant:
            self.c.append(a.c[0] * b.c[n])
        elif b.constant:
            self.c.append(a.c[n] * b.c[0])
        else:
            self.c.append(self.context.fdot(a.c[: n + 1], b.c[n::-1]))


class Quotient(Node):
    """The quotient of two quantities, a/b."""

    __slots__ = ()

    def extend(self, n: int) -> None:
        a, b = self.operands
        if b.c[0] == 0:
            raise UsageError(
                "division by zero",
                remedy="use reference='runs', because the multiple-precision run cannot pass this point",
            )
        value = a.coefficient(n)
        if n and not b.constant:
            value = value - self.context.fdot(b.c[1 : n + 1], self.c[n - 1 :: -1])
        self.c.append(value / b.c[0])


class Power(Node):
    """The power of a quantity with a constant exponent; the quantity must not be zero."""

    __slots__ = ("exponent",)

    def __init__(self, context: Any, u: Node, exponent: Number) -> None:
        super().__init__(context, (u,))
        self.exponent = exponent

    def extend(self, n: int) -> None:
        u = self.operands[0].c
        if u[0] < 0 or (u[0] == 0 and (self.exponent < 0 or not self.constant)):
            raise UsageError(
                f"the run reaches the power {float(self.exponent):g} of {float(u[0]):g}, which has no Taylor series",
                remedy="use reference='runs', because the multiple-precision run cannot pass this point",
            )
        if n == 0:
            self.c.append(u[0] ** self.exponent)
            return
        weights = [(k * self.exponent - (n - k)) * u[k] for k in range(1, n + 1)]
        self.c.append(self.context.fdot(weights, self.c[n - 1 :: -1]) / (n * u[0]))


class Integral(Node):
    """A function f(u), computed as the integral of its slope; the slope may depend on f."""

    __slots__ = ("first", "slope", "weights")

    def __init__(self, context: Any, u: Node, first: Callable[[Number], Number]) -> None:
        super().__init__(context, (u,))
        self.first = first
        self.slope: tuple[Node, bool] = (self, False)  # the node, and whether it is negated
        self.weights: list[Any] = []  # k u_k

    @property
    def delayed(self) -> tuple[Node, ...]:
        return (self.slope[0],)

    def extend(self, n: int) -> None:
        u, (slope, minus) = self.operands[0], self.slope
        if n == 0:
            self.c.append(self.first(u.c[0]))
            return
        self.weights[n - 1 :] = [n * u.c[n]]
        if slope.constant:
            total = self.weights[n - 1] * slope.c[0]
        else:
            total = self.context.fdot(self.weights, slope.c[n - 1 :: -1])
        self.c.append(-total / n if minus else total / n)


class Pointwise(Node):
    """A corner, a jump or a condition, which has a power series only while its operands are constant."""

    __slots__ = ("function", "text")

    def __init__(
        self, context: Any, operands: Sequence[Node], function: Callable[..., Any], text: str
    ) -> None:
        super().__init__(context, operands)
        self.function = function
        self.text = text

    def extend(self, n: int) -> None:
        if n:
            raise UsageError(
                f"'{self.text}' is not smooth, but the multiple-precision run supports smooth modes only",
                remedy="write both sides of the expression as modes with guards, or use reference='runs'",
            )
        self.c.append(self.function(*(node.c[0] for node in self.operands)))


def in_order(targets: Sequence[Node]) -> list[Node]:
    """Return all nodes on which the given nodes depend, sorted so that operands come first.

    A cycle is an error, unless it passes a node of which only lower coefficients are used.
    """
    order: list[Node] = []
    done: set[int] = set()
    open_: set[int] = set()
    roots = list(targets)
    while roots:
        stack = [(roots.pop(0), False)]
        while stack:
            node, finished = stack.pop()
            if finished:
                open_.discard(id(node))
                done.add(id(node))
                order.append(node)
                continue
            if id(node) in done:
                continue
            if id(node) in open_:
                raise UsageError("a quantity depends on itself", remedy="remove the circular definition")
            open_.add(id(node))
            stack.append((node, True))
            stack += [(other, False) for other in node.operands if id(other) not in done]
            roots += [other for other in node.delayed if id(other) not in done]
    return order
