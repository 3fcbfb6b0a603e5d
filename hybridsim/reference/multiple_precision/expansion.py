"""This module stores Taylor series from one instant, with their accurate range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from hybridsim.reference.multiple_precision.nodes import (
    ExternalSeries,
    Negative,
    Node,
    Product,
    Quotient,
    Sum,
)
from hybridsim.reference.multiple_precision.precision import Number, Precision

Coefficients = Sequence[Number]

# A step of two to this power means an unlimited step.
_FOREVER = 1000.0


@dataclass(frozen=True)
class Term:
    """One term of a sum; the sizes of the terms bound the rounding error of the sum."""

    log2_factor: int
    c: Coefficients
    late: bool


@dataclass(frozen=True)
class QuantitySeries:
    """The Taylor series of a state, guard, monitor or surface, and the terms of its sum."""

    c: Coefficients
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Expansion:
    """The Taylor series of the states, active guards, monitors and surfaces from one instant.

    Parameters
    ----------
    longest : the maximum reach of a series: the length of the run.
    """

    precision: Precision
    states: tuple[QuantitySeries, ...]
    guards: tuple[tuple[QuantitySeries, ...], ...]
    monitors: tuple[QuantitySeries, ...]
    surfaces: tuple[QuantitySeries, ...]
    longest: Number
    _logs: dict[int, list[tuple[int, int]]] = field(default_factory=dict)

    @property
    def quantities(self) -> tuple[QuantitySeries, ...]:
        """Return the quantities that a step must resolve in addition to the states."""
        return (*(guard for row in self.guards for guard in row), *self.monitors)

    @cached_property
    def reach(self) -> Number:
        """Return the time over which the last terms of each series are negligible relative to its other terms."""
        return self.reach_above([self.precision.context.zero] * len(self.states))

    def reach_above(self, sizes: Sequence[Number]) -> Number:
        """Return the time over which the last two terms are negligible at a number of digits."""
        log2_reach = [self._log2_reach(state.c, size) for state, size in zip(self.states, sizes, strict=True)]
        log2_reach += [
            self._log2_reach(quantity.c, self.precision.context.zero) for quantity in self.quantities
        ]
        reach = min(log2_reach, default=_FOREVER)
        whole = int(reach // 1)
        return min(
            self.longest, self.precision.context.ldexp(self.precision.number(2.0 ** (reach - whole)), whole)
        )

    def _log2_reach(self, c: Coefficients, size: Number) -> float:
        logs, last = self._log2(c), len(c) - 1
        if last < 2:
            return _FOREVER
        heads = [(n, log) for n, log in logs if n < last - 1]
        if size != 0:
            heads.append((0, self.precision.log2(size)))
        reach = _FOREVER
        for m, log in logs[-2:]:
            if heads and m >= last - 1:
                reach = min(reach, max((head - log - self.precision.bits) / (m - n) for n, head in heads))
        return reach

    def _log2(self, c: Coefficients) -> list[tuple[int, int]]:
        """Return the index n and the binary magnitude of each non-zero coefficient."""
        if id(c) not in self._logs:
            self._logs[id(c)] = [(n, self.precision.log2(value)) for n, value in enumerate(c) if value != 0]
        return self._logs[id(c)]

    def side_after(self, quantity: QuantitySeries) -> tuple[int, int]:
        """Return the sign just after the start, and the order of the first non-zero coefficient.

        A coefficient counts as zero if it is below 10^-20 (for 32 digits) of the terms of its sum.
        """
        scale, power = self.scale(quantity), self.precision.context.one
        for n, value in enumerate(quantity.c):
            if abs(value) * power > self.precision.zero * scale:
                return (1 if value > 0 else -1), n
            power = power * self.reach
        return 0, 0

    def is_zero(self, quantity: QuantitySeries) -> bool:
        """Return whether a quantity is zero at the start."""
        return bool(abs(quantity.c[0]) <= self.precision.zero * self.scale(quantity))

    def scale(self, quantity: QuantitySeries) -> Number:
        """Return the largest term of a quantity within the accurate range, rounded up to a power of two."""
        log2_reach = self.precision.log2(self.reach)
        sizes = [
            max(log + n * log2_reach for n, log in logs) + term.log2_factor + log2_reach * term.late
            for term in quantity.terms
            if (logs := self._log2(term.c))
        ]
        return self.precision.context.ldexp(1, max(sizes)) if sizes else self.precision.context.zero


def terms_of(node: Node, rates: Mapping[int, Node]) -> tuple[Term, ...]:
    """Return the terms whose sum is a quantity; for a state, also the terms of its rate."""
    found: list[Term] = []
    log2 = node.context.mag
    open_ = [(node, 0, False)]
    while open_:
        part, factor, late = open_.pop()
        if isinstance(part, (Sum, Negative)):
            open_ += [(other, factor, late) for other in part.operands]
        elif isinstance(part, (Product, Quotient)) and (constant := part.operands[1]).constant:
            size = log2(constant.c[0]) if constant.c[0] != 0 else 0
            open_.append((part.operands[0], factor + (size if isinstance(part, Product) else -size), late))
        elif isinstance(part, Product) and (constant := part.operands[0]).constant:
            open_.append(
                (part.operands[1], factor + (log2(constant.c[0]) if constant.c[0] != 0 else 0), late)
            )
        else:
            found.append(Term(factor, part.c, late))
            if isinstance(part, ExternalSeries) and id(part) in rates and not late:
                open_.append((rates[id(part)], factor, True))
    return tuple(found)


def value_at(c: Coefficients, s: Number) -> Number:
    """Return the value of a Taylor series at a time s."""
    total = c[-1]
    for value in reversed(c[:-1]):
        total = total * s + value
    return total


def rate_at(c: Coefficients, s: Number) -> Number:
    """Return the slope of a Taylor series at a time s."""
    return value_at([n * value for n, value in enumerate(c)][1:] or [0 * s], s)
