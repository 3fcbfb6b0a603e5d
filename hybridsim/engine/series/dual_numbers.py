"""This module defines dual numbers, for functions of a model that run as plain Python.

Each number carries a row of derivatives. A generated function is run on dual numbers with mathematical
functions that accept them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np


class Dual:
    """A dual number: a value with its derivatives (D,), or k values (k,) with derivatives (D, k)."""

    __slots__ = ("slope", "value")
    __array_ufunc__ = None  # so that an array plus a dual number is a dual number, not an array of objects

    def __init__(self, value: Any, slope: Any) -> None:
        self.value, self.slope = value, slope

    def __add__(self, other: Any) -> Dual:
        v, d = _parts(other)
        return Dual(self.value + v, self.slope + d)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        v, d = _parts(other)
        return Dual(self.value - v, self.slope - d)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.value, -self.slope)

    def __mul__(self, other: Any) -> Dual:
        v, d = _parts(other)
        return Dual(self.value * v, self.slope * v + self.value * d)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        v, d = _parts(other)
        y = self.value / v
        return Dual(y, (self.slope - y * d) / v)

    def __rtruediv__(self, other: Any) -> Dual:
        y = other / self.value
        return Dual(y, -y * self.slope / self.value)

    def __pow__(self, n: Any) -> Dual:
        if isinstance(n, Dual):
            functions = _OF_ARRAYS if np.ndim(self.value) else _OF_NUMBERS
            found: Dual = functions["pow"](self, n)
            return found
        return Dual(self.value**n, n * self.value ** (n - 1.0) * self.slope)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __abs__(self) -> Dual:
        return Dual(abs(self.value), self.slope if self >= 0.0 else -self.slope)

    def __float__(self) -> float:
        return float(self.value)

    def __lt__(self, other: Any) -> bool:
        return _held(self.value < _parts(other)[0])

    def __le__(self, other: Any) -> bool:
        return _held(self.value <= _parts(other)[0])

    def __gt__(self, other: Any) -> bool:
        return _held(self.value > _parts(other)[0])

    def __ge__(self, other: Any) -> bool:
        return _held(self.value >= _parts(other)[0])

    def __eq__(self, other: object) -> bool:
        return _held(self.value == _parts(other)[0])

    __hash__ = None  # type: ignore[assignment]  # as usual in Python for a class with ==


def _parts(other: Any) -> tuple[float, Any]:
    return (other.value, other.slope) if isinstance(other, Dual) else (other, 0.0)


def _held(condition: Any) -> bool:
    """Return whether a condition holds at all values, or raise an error if it holds at some of the values only."""
    if np.ndim(condition) and not (condition.all() or not condition.any()):
        raise ValueError("a condition is true for some of the values and false for others")
    return bool(np.all(condition))


def _smooth(
    function: Callable[[float], float], slope: Callable[[float, float], float]
) -> Callable[[Any], Any]:
    """Extend a function of one number, with its derivative `slope`, to dual numbers."""

    def lifted(u: Any) -> Any:
        if not isinstance(u, Dual):
            return function(u)
        y = function(u.value)
        return Dual(y, slope(u.value, y) * u.slope)

    return lifted


def _functions(of: Any) -> dict[str, Any]:
    """Return functions of dual numbers for generated code, made from the functions of `math` or of NumPy."""

    def power(base: Any, exponent: Any) -> Any:
        (u, du), (n, dn) = _parts(base), _parts(exponent)
        y = of.pow(u, n)
        by_exponent = y * of.log(u) * dn if isinstance(exponent, Dual) and np.any(dn) else 0.0
        return Dual(y, n * of.pow(u, n - 1.0) * du + by_exponent)

    def atan2(y: Any, x: Any) -> Any:
        (a, da), (b, db) = _parts(y), _parts(x)
        return Dual(of.atan2(a, b), (b * da - a * db) / (a * a + b * b))

    def sign_of(size: Any, sign: Any) -> Any:
        return of.copysign(size, _parts(sign)[0])  # generated code uses only the sign of the result

    return {
        "sqrt": _smooth(of.sqrt, lambda u, y: 0.5 / y),
        "exp": _smooth(of.exp, lambda u, y: y),
        "log": _smooth(of.log, lambda u, y: 1.0 / u),
        "sin": _smooth(of.sin, lambda u, y: of.cos(u)),
        "cos": _smooth(of.cos, lambda u, y: -of.sin(u)),
        "tan": _smooth(of.tan, lambda u, y: 1.0 + y * y),
        "asin": _smooth(of.asin, lambda u, y: 1.0 / of.sqrt(1.0 - u * u)),
        "acos": _smooth(of.acos, lambda u, y: -1.0 / of.sqrt(1.0 - u * u)),
        "atan": _smooth(of.atan, lambda u, y: 1.0 / (1.0 + u * u)),
        "sinh": _smooth(of.sinh, lambda u, y: of.cosh(u)),
        "cosh": _smooth(of.cosh, lambda u, y: of.sinh(u)),
        "tanh": _smooth(of.tanh, lambda u, y: 1.0 - y * y),
        "atan2": atan2,
        "pow": power,
        "copysign": sign_of,
    }


_ARRAYS = SimpleNamespace(
    sqrt=np.sqrt, exp=np.exp, log=np.log, sin=np.sin, cos=np.cos, tan=np.tan, asin=np.arcsin, acos=np.arccos,
    atan=np.arctan, sinh=np.sinh, cosh=np.cosh, tanh=np.tanh, atan2=np.arctan2, pow=np.power, copysign=np.copysign,
)  # fmt: skip
_OF_NUMBERS, _OF_ARRAYS = _functions(math), _functions(_ARRAYS)


def with_slopes(values: Any, slopes: np.ndarray) -> list[Dual]:
    """Return dual numbers (n,) from values (n,) and derivatives (n, D)."""
    return [Dual(float(v), d) for v, d in zip(values, slopes, strict=True)]


def differentiated(function: FunctionType) -> Callable[..., Any]:
    """Return a generated function that accepts dual numbers."""
    return FunctionType(function.__code__, function.__globals__ | _OF_NUMBERS, function.__name__)


def differentiated_rows(function: FunctionType) -> Callable[..., Any]:
    """Return a generated function in a form that accepts dual numbers with k values each.

    It raises `ValueError` if a condition does not hold for all k values or for none of them.
    """
    return FunctionType(function.__code__, function.__globals__ | _OF_ARRAYS, function.__name__)


def values_and_slopes(numbers: list[Any], directions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the values (n,) and derivatives (n, D) of plain or dual numbers."""
    values = np.array([float(n) for n in numbers])
    slopes = [n.slope if isinstance(n, Dual) else np.zeros(directions) for n in numbers]
    return values, np.array(slopes).reshape(len(numbers), directions)
