"""This module computes powers of a step and sums of Taylor series, four terms at a time.

The results equal those of `tabulate` and `sum_sizes` of `hybridsim.engine.series.interpreter` to the last
bit.
"""

from __future__ import annotations

from hybridsim.engine.native.llvm_text import ONE, Lines, number


class Powers:
    """The powers a**k for k = 0..order, and sums of Taylor series with these powers.

    Powers and terms are computed four at a time from the highest order down; the lowest order % 4 ones are
    scalar.
    """

    def __init__(self, code: Lines, a: str, order: int) -> None:
        self.code, self.order = code, order
        square = code.op("fmul", a, a)
        self._first = [ONE, a, square, code.op("fmul", a, square), code.op("fmul", square, square)]
        self._fourth = self._vector([self._first[4]] * 4)
        self._fours: dict[int, str] = {1: self._vector(self._first[1:])}
        self.begins = list(range(order - 3, 0, -4))

    def _vector(self, elements: list[str]) -> str:
        vector = "poison"
        for i, element in enumerate(elements):
            vector = self.code.value(
                "insertelement <4 x double> {}, double {}, i64 " + str(i), vector, element
            )
        return vector

    def _constants(self, values: list[float]) -> str:
        return "<" + ", ".join(f"double {number(value)}" for value in values) + ">"

    def four(self, k: int) -> str:
        """Return the powers a**k to a**(k + 3) as one vector."""
        if k not in self._fours and k > 4:
            self._fours[k] = self._of_two("fmul", self.four(k - 4), self._fourth)
        elif k not in self._fours:
            indices = ", ".join(f"i32 {k - 1 + i}" for i in range(4))
            form = "shufflevector <4 x double> {}, <4 x double> {}, <4 x i32> <" + indices + ">"
            self._fours[k] = self.code.value(form, self.four(1), self.four(5))
        return self._fours[k]

    def store(self, array: str) -> None:
        """Write code that stores all powers in an array."""
        for k in range(self.order % 4 + 1):
            self.code.store(self._first[k], array, k)
        for k in self.begins:
            place = self.code.value("getelementptr inbounds double, ptr {}, i64 " + str(k), array)
            self.code.put(f"  store <4 x double> {self.four(k)}, ptr {place}, align 8")

    def _load(self, array: str, i: int) -> str:
        place = self.code.value("getelementptr inbounds double, ptr {}, i64 " + str(i), array)
        return self.code.value("load <4 x double>, ptr {}, align 8", place)

    def _of_two(self, name: str, a: str, b: str) -> str:
        return self.code.value(name + " <4 x double> {}, {}", a, b)

    def _fused(self, a: str, b: str, c: str) -> str:
        form = "call <4 x double> @llvm.fmuladd.v4f64(<4 x double> {}, <4 x double> {}, <4 x double> {})"
        return self.code.value(form, a, b, c)

    def _size(self, a: str) -> str:
        return self.code.value("call <4 x double> @llvm.fabs.v4f64(<4 x double> {})", a)

    def _together(self, a: str) -> str:
        """Return the sum of the four elements of a vector."""
        form = "shufflevector <4 x double> {}, <4 x double> poison, <2 x i32> <i32 {first}, i32 {second}>"
        halves = [self.code.value(form.format("{}", first=i, second=i + 1), a) for i in (0, 2)]
        two = self.code.value("fadd <2 x double> {}, {}", *halves)
        return self.code.op(
            "fadd", *(self.code.value("extractelement <2 x double> {}, i64 " + str(i), two) for i in (0, 1))
        )

    def sum(self, array: str, at: int, is_size: bool) -> str:
        """Compute the sum of c_k a**k, or of |c_k| a**k, over k > 0, for a series stored in an array."""
        code, total = self.code, self._constants([0.0] * 4)
        for k in self.begins:
            c = self._load(array, at + k)
            total = self._fused(self._size(c) if is_size else c, self.four(k), total)
        found = self._together(total)
        for k in range(self.order % 4, 0, -1):
            c = code.load(array, at + k)
            c = code.call("llvm.fabs.f64", c) if is_size else c
            found = code.fused(c, self._first[k], found)
        return found

    def terms(self, array: str, at: int) -> tuple[str, str, str]:
        """Write code for three sums over k > 0: of c_k a**k, of k c_k a**k, and of the absolute values of the terms."""
        code, zero = self.code, self._constants([0.0] * 4)
        value, slope, size = zero, zero, zero
        for k in self.begins:
            term = self._of_two("fmul", self._load(array, at + k), self.four(k))
            value = self._of_two("fadd", value, term)
            slope = self._fused(self._constants([k + i for i in range(4)]), term, slope)
            size = self._of_two("fadd", size, self._size(term))
        value, slope, size = self._together(value), self._together(slope), self._together(size)
        for k in range(self.order % 4, 0, -1):
            term = code.op("fmul", code.load(array, at + k), self._first[k])
            value, slope = code.op("fadd", value, term), code.fused(number(k), term, slope)
            size = code.op("fadd", size, code.call("llvm.fabs.f64", term))
        return value, slope, size
