"""This module writes straight-line code by running kernels on symbolic values.

An operator on a `Value` appends its line to the text of a function. If a kernel branches on a value, it is run for both
branches, and the code selects between the results.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

from hybridsim.engine.native.llvm_text import Lines, number

_CALLS = {
    "sin": "llvm.sin.f64",
    "cos": "llvm.cos.f64",
    "exp": "llvm.exp.f64",
    "sqrt": "llvm.sqrt.f64",
    "tan": "c_tan",
    "tanh": "c_tanh",
}


def _is(other: Any, constant: float) -> bool:
    return isinstance(other, int | float) and other == constant


def written(value: Any) -> str:
    """Return the text of a symbolic value or of a Python number."""
    return value.text if isinstance(value, Value) else number(value)


def _compared(kind: str) -> Any:
    """Return a method that compares two symbolic values, for use in class `Value`."""
    return lambda value, other: _Condition(kind, value, other)


class Value:
    """A symbolic value in generated code; operands may be Python numbers."""

    __slots__ = ("code", "text")
    __hash__ = None  # type: ignore[assignment]  # as usual in Python for a class with ==

    def __init__(self, code: Trace, text: str) -> None:
        self.code, self.text = code, text

    def _op(self, name: str, a: Any, b: Any) -> Any:
        return type(self)(self.code, self.code.op(name, written(a), written(b)))

    def __add__(self, other: Any) -> Any:
        return self._op("fadd", self, other)

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __sub__(self, other: Any) -> Any:
        return self._op("fsub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._op("fsub", other, self)

    def __mul__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self._op("fmul", self, other)

    def __rmul__(self, other: Any) -> Any:
        return self * other

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self._op("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._op("fdiv", other, self)

    def __neg__(self) -> Any:
        return type(self)(self.code, self.code.negative(self.text))

    def __abs__(self) -> Size:
        return Size(self.code, self.code.call("llvm.fabs.f64", self.text))

    __lt__, __le__, __gt__ = _compared("olt"), _compared("ole"), _compared("ogt")
    __ge__, __eq__, __ne__ = _compared("oge"), _compared("oeq"), _compared("une")


class Size(Value):
    """A symbolic value that is finite and not negative, such as an error bound; zero terms are omitted."""

    __slots__ = ()

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else super().__add__(other)

    def __mul__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0.0) else super().__mul__(other)

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0.0) else super().__rtruediv__(other)


class _Condition:
    """A comparison of symbolic values, whose result depends on the current path of the code."""

    def __init__(self, name: str, value: Value, other: Any) -> None:
        self.code, self.operands = value.code, (name, value.text, written(other))

    def __bool__(self) -> bool:
        return self.code.branch(self)


class _Undecided(Exception):
    """Raised if the current path does not determine the result of a condition."""

    def __init__(self, condition: _Condition) -> None:
        self.condition = condition


class Coefficients:
    """The Taylor coefficients of registers, by register and order."""

    def __init__(self, order: int, otherwise: Callable[[int, int], Any]) -> None:
        self.shape = (0, order + 1)
        self.known: dict[tuple[int, int], Any] = {}
        self.new = self.known  # replaced while a step is run
        self._otherwise = otherwise

    def __getitem__(self, at: tuple[int, int]) -> Any:
        found = self.new.get(at, self.known.get(at))
        return self._otherwise(*at) if found is None else found

    def __setitem__(self, at: tuple[int, int], value: Any) -> None:
        self.new[at] = value


class Trace(Lines):
    """The lines of code of one generated function, written by kernels that run on symbolic values.

    Parameters
    ----------
    module : its functions run on values, as attributes of `run`.
    replaced : functions that the others call instead of those of the module.
    """

    def __init__(self, prefix: str, module: ModuleType, **replaced: Callable[..., Any]) -> None:
        super().__init__(prefix)
        self._truths: list[bool] = []
        calls = {
            name: lambda u, called=called: Value(self, self.call(called, written(u)))
            for name, called in _CALLS.items()
        }
        names = vars(module) | {
            "math": SimpleNamespace(inf=math.inf, nan=math.nan, **calls),
            "fused": lambda *terms: Value(self, self.fused(*map(written, terms))),
            "call_noinline": lambda kernel, arguments: kernel(*arguments),
        }
        for name, thing in vars(module).items():
            plain = inspect.unwrap(getattr(thing, "py_func", thing))
            if isinstance(plain, FunctionType) and plain.__globals__ is vars(module):
                names[name] = FunctionType(plain.__code__, names, name)
        self.run = SimpleNamespace(**names)
        names |= replaced

    def read(self, array: str, i: int) -> Value:
        """Return an element of an array. The generated function only reads this array."""
        return Value(self, self.load(array, i))

    def branch(self, condition: _Condition) -> bool:
        """Return whether a condition holds on the current path of the code."""
        if not self._truths:
            raise _Undecided(condition)
        return self._truths.pop(0)

    def on_all_paths(
        self, step: Callable[..., Any], row: Any, tables: tuple[Coefficients, ...], k: int
    ) -> None:
        """Run a kernel on all paths of its conditions, and emit code that selects the result of the valid path."""
        for table, new in zip(tables, self._results(step, row, tables, k, ()), strict=True):
            table.new = table.known
            table.known.update(new)

    def _results(
        self, step: Any, row: Any, tables: tuple[Coefficients, ...], k: int, path: tuple[bool, ...]
    ) -> list[dict[tuple[int, int], Any]]:
        """Return the results that a kernel writes to each table on one path of its conditions."""
        self._truths = list(path)
        for table in tables:
            table.new = {}
        try:
            step(row, *tables, k)
        except _Undecided as asked:
            both = [self._results(step, row, tables, k, (*path, truth)) for truth in (True, False)]
            return [
                {at: self._chosen(asked.condition, then[at], other[at]) for at in then}
                for then, other in zip(*both, strict=True)
            ]
        return [table.new for table in tables]

    def _chosen(self, condition: _Condition, then: Any, other: Any) -> Any:
        texts = written(then), written(other)
        kind = Value if type(then) is Value or type(other) is Value else Size
        return then if texts[0] == texts[1] else kind(self, self.choice(*condition.operands, *texts))
