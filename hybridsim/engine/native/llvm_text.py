"""This module writes LLVM assembly text of functions, in which each value is computed once."""

from __future__ import annotations

import struct
from collections.abc import Iterable

# A function of this many lines compiles in half a second; the interpreter evaluates a longer one.
_LONGEST = 12000
_COMMUTES = ("fadd", "fmul")
ONE = "1.0"

DECLARATIONS = """
declare double @llvm.sin.f64(double)
declare double @llvm.cos.f64(double)
declare double @llvm.exp.f64(double)
declare double @llvm.sqrt.f64(double)
declare double @llvm.fabs.f64(double)
declare double @llvm.fmuladd.f64(double, double, double)
declare <4 x double> @llvm.fabs.v4f64(<4 x double>)
declare <4 x double> @llvm.fmuladd.v4f64(<4 x double>, <4 x double>, <4 x double>)
declare double @c_tan(double)
declare double @c_tanh(double)
"""


class TooLong(Exception):
    """Raised for an instruction tape whose code would take too long to compile."""


def number(value: float) -> str:
    """Return a double as text in LLVM's hexadecimal notation."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class Lines:
    """The lines of code of one function, in which each value is computed once."""

    def __init__(self, prefix: str = "v") -> None:
        self.lines: list[str] = []
        self._prefix = prefix  # first letters of value names
        self._known: dict[tuple[str, ...], str] = {}

    def put(self, line: str) -> None:
        """Append a line of code that computes no value."""
        self.lines.append(line)
        if len(self.lines) > _LONGEST:
            raise TooLong

    def value(self, form: str, *parts: str) -> str:
        """Write a line of code and return the name of its result; an equal line is written only once."""
        key = (form, *parts)
        if key not in self._known:
            name = f"%{self._prefix}{len(self._known)}"
            self.put(f"  {name} = {form.format(*parts)}")
            self._known[key] = name
        return self._known[key]

    def op(self, name: str, a: str, b: str) -> str:
        """Emit an arithmetic operation on two doubles."""
        if name in _COMMUTES and b < a:
            a, b = b, a
        return self.value(name + " double {}, {}", a, b)

    def negative(self, a: str) -> str:
        """Emit the negative of a value."""
        return self.value("fneg double {}", a)

    def call(self, name: str, a: str) -> str:
        """Emit a call of a function with one double as argument."""
        return self.value("call double @" + name + "(double {})", a)

    def load(self, array: str, i: int) -> str:
        """Load an element of an array that the function never writes."""
        place = self.value("getelementptr inbounds double, ptr {}, i64 " + str(i), array)
        return self.value("load double, ptr {}", place)

    def store(self, value: str, array: str, i: int) -> None:
        """Write an element of an array."""
        place = self.value("getelementptr inbounds double, ptr {}, i64 " + str(i), array)
        self.put(f"  store double {value}, ptr {place}")

    def fused(self, a: str, b: str, c: str) -> str:
        """Emit a fused product and sum a*b + c."""
        return self.value("call double @llvm.fmuladd.f64(double {}, double {}, double {})", a, b, c)

    def choice(self, condition: str, a: str, b: str, then: str, otherwise: str) -> str:
        """Emit a choice between two values by a comparison of `a` and `b`."""
        is_so = self.value("fcmp " + condition + " double {}, {}", a, b)
        return self.value("select i1 {}, double {}, double {}", is_so, then, otherwise)


def function(name: str, lines: Iterable[str]) -> str:
    """Return the text of a function that consists of the lines of code so far."""
    arguments = "double %s, double %e, ptr noalias %x, ptr noalias %g, ptr noalias %c, ptr noalias %out"
    return "\n".join((f"define void @{name}({arguments}) {{", *lines, "  ret void", "}", ""))
