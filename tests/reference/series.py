"""Truncated power series in mpmath numbers: the arithmetic of a Taylor integrator, with no symbolic step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath

MP = mpmath.mp.clone()
MP.dps = 32


class Series:
    """Coefficients c[0] + c[1] s + ...; operations keep as many as the longer operand has."""

    def __init__(self, coefficients: Sequence[Any]) -> None:
        self.c = [MP.mpf(value) for value in coefficients]

    def __getitem__(self, n: int) -> Any:
        return self.c[n] if n < len(self.c) else MP.mpf(0)

    def __len__(self) -> int:
        return len(self.c)

    def __call__(self, s: Any) -> Any:
        total = MP.mpf(0)
        for value in reversed(self.c):
            total = total * s + value
        return total

    def __add__(self, other: Any) -> Series:
        other = _series(other)
        return Series([self[n] + other[n] for n in range(max(len(self), len(other)))])

    def __neg__(self) -> Series:
        return Series([-value for value in self.c])

    def __sub__(self, other: Any) -> Series:
        return self + (-_series(other))

    def __rsub__(self, other: Any) -> Series:
        return _series(other) - self

    def __mul__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            return Series([value * other for value in self.c])
        length = max(len(self), len(other))
        return Series([sum(self[i] * other[n - i] for i in range(n + 1)) for n in range(length)])

    def __truediv__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            return Series([value / other for value in self.c])
        out: list[Any] = []
        for n in range(max(len(self), len(other))):
            rest = self[n] - sum(other[i] * out[n - i] for i in range(1, n + 1))
            out.append(rest / other[0])
        return Series(out)

    def __rtruediv__(self, other: Any) -> Series:
        return Series([other] + [0] * (len(self) - 1)) / self

    __radd__, __rmul__ = __add__, __mul__


def _series(value: Any) -> Series:
    return value if isinstance(value, Series) else Series([value])


def exp(a: Series) -> Series:
    out = [MP.exp(a[0])]
    for n in range(1, len(a)):
        out.append(sum(i * a[i] * out[n - i] for i in range(1, n + 1)) / n)
    return Series(out)


def sin_cos(a: Series) -> tuple[Series, Series]:
    s, c = [MP.sin(a[0])], [MP.cos(a[0])]
    for n in range(1, len(a)):
        s.append(sum(i * a[i] * c[n - i] for i in range(1, n + 1)) / n)
        c.append(-sum(i * a[i] * s[n - i] for i in range(1, n + 1)) / n)
    return Series(s), Series(c)


def tanh(a: Series) -> Series:
    out = [MP.tanh(a[0])]
    square: list[Any] = []
    for n in range(1, len(a)):
        square.append(sum(out[i] * out[n - 1 - i] for i in range(n)))
        slope = [(1 - square[0]), *(-value for value in square[1:])]
        out.append(sum(i * a[i] * slope[n - i] for i in range(1, n + 1)) / n)
    return Series(out)
