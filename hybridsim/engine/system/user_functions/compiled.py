"""Compile a user's Python functions with numba, or wrap functions that numba cannot compile."""

from __future__ import annotations

import ctypes
import inspect
import math
import re
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import NumbaError, literal_unroll, types
from numba.extending import intrinsic, overload

from hybridsim.engine.native.model_functions import SIGNATURE
from hybridsim.engine.system.user_functions.forms import Failures, Parts, Scalar, number, rates
from hybridsim.engine.system.user_functions.helpers import compiled_with_helpers
from hybridsim.expr import function_name

_REASON = 160  # largest number of characters shown of a reason
_HEADS = ("Failed in nopython mode", "During:", "File ", "<source", "def ", "- Resolution", "^")


@intrinsic
def _doubles_at(typingctx: Any, address: Any) -> Any:
    """Return a pointer to doubles at an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.float64)(types.int64), generate


@intrinsic(prefer_literal=True)
def _as_tuple(typingctx: Any, array: Any, count: Any) -> Any:
    """Return the first numbers of an array as a tuple with a constant length."""
    kind = types.UniTuple(types.float64, count.literal_value)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(array)(context, builder, args[0]).data
        pointers = [builder.gep(data, [context.get_constant(types.intp, i)]) for i in range(len(kind))]
        return context.make_tuple(builder, kind, [builder.load(place) for place in pointers])

    return kind(array, count), generate


@numba.njit
def _mark(address: int, function: int, t: float, x: Any, p: Any) -> None:
    """Store the last call that raised an exception: function number, t, states, parameters."""
    last_call = numba.carray(_doubles_at(address), (2 + x.shape[0] + p.shape[0],))
    last_call[0], last_call[1] = function, t
    last_call[2 : 2 + x.shape[0]] = x
    last_call[2 + x.shape[0] :] = p


class Compiler:
    """Compiles the functions of one model; `refused` is the reason why numba cannot compile them."""

    def __init__(self, parts: Parts) -> None:
        self.parts = parts
        self.count = len(parts.parameters._fields)
        self.last_call = np.zeros(2 + parts.states + self.count)
        self.functions: list[Any] = []
        self.refused = ""
        self._written: dict[tuple[int, bool], Any] = {}
        scalars = (*parts.guards, *parts.monitors, *parts.outputs)
        used = [(f, True) for _, f in parts.flows]
        used += [(scalar.function, False) for scalar in scalars if callable(scalar.function)]
        for function, is_flow in used:
            self.refused = self.refused or self._take(function, is_flow)

    def flow(self) -> tuple[int, Any]:
        """Return the address of the flow, and an object that keeps it alive."""
        flows = [(mode, self._written[id(function), True]) for mode, function in self.parts.flows]
        chosen = _in_every_mode(flows[-1][1])
        for mode, write in flows[-2::-1]:
            chosen = _either(self.parts.component, mode, write, chosen)
        return _as_cfunc(chosen)

    def row(self, scalars: tuple[Scalar, ...]) -> tuple[int, Any]:
        """Return the address of a function of several numbers, and an object that keeps it alive."""
        write_all = _nothing
        for k, scalar in reversed(list(enumerate(scalars))):
            f = scalar.function
            write = self._written[id(f), False] if callable(f) else _constant(f)
            write_all = _one_more(write, k, scalar.component, scalar.mode, write_all)
        return _as_cfunc(write_all)

    def replay(self, failures: Failures) -> None:
        """Repeat the last failed call of compiled code in plain Python, to get its exception."""
        if self.last_call[0] == 0.0:
            return
        function, is_flow = self.functions[int(self.last_call[0]) - 1]
        t, x = float(self.last_call[1]), self.last_call[2 : 2 + self.parts.states].copy()
        p = self.parts.parameters(*self.last_call[2 + self.parts.states :].tolist())
        self.last_call[0] = 0.0
        try:
            rates(function, self.parts.states, t, x, p) if is_flow else number(function, t, x, p)
        except Exception as fault:  # user code may raise anything; the run ends with its error
            failures.note(function, t, fault, True)

    def _take(self, function: Any, is_flow: bool) -> str:
        """Compile a function and the code that writes its result. If numba cannot compile them, return the reason."""
        if (id(function), is_flow) in self._written:
            return ""
        if not (inspect.isfunction(function) or hasattr(function, "py_func")):
            return f"{function_name(function)}: numba compiles plain functions only"
        own = function if hasattr(function, "py_func") else compiled_with_helpers(function)
        named = numba.typeof(self.parts.parameters(*[0.0] * self.count))
        signature = (types.float64, types.Array(types.float64, 1, "C"), named)
        try:
            own.compile(signature)
        except (
            NumbaError,
            NotImplementedError,
            TypeError,
        ) as fault:  # TypeError is for arguments with defaults
            return f"{function_name(function)}: {_in_short(fault)}"
        returned = own.overloads[signature].signature.return_type
        if _put_compiled(returned, None, None, None) is None:
            return f"{function_name(function)} returns {returned}"
        self.functions.append((function, is_flow))
        width = self.parts.states if is_flow else -1
        self._written[id(function), is_flow] = self._wrapped(own, len(self.functions), width)
        return ""

    def _wrapped(self, function: Any, number: int, width: int) -> Any:
        """Return code that calls a function and writes `width` numbers; -1 means a scalar."""
        n, count, origin = self.parts.states, self.count, self.parts.origin_at
        parameters, address, length = self.parts.parameters, self.last_call.ctypes.data, abs(width)

        @numba.njit(error_model="numpy")
        def write(s: float, x: Any, p: Any, out: Any, at: int) -> None:
            t, state, parameter_array = p[origin] + s, numba.carray(x, (n,)), numba.carray(p, (count,))
            raised = False
            try:
                named = parameters(*_as_tuple(parameter_array, count))
                _put(function(t, state.copy(), named), out, at, width)
            except Exception:  # numba supports no other clause; a repeated call gives the error
                raised = True
            if raised:
                if p[origin + 1] > 0.0:  # on the run, not in finite differences far from it
                    _mark(address, number, t, state, parameter_array)
                for i in range(length):
                    out[at + i] = math.nan

        return write


def _put(result: Any, out: Any, at: int, width: int) -> None:
    """Write the result of a function, `width` numbers or a scalar; raise an error for other results."""
    raise NotImplementedError("the function runs in compiled code only")


def _put_compiled(result: Any, out: Any, at: Any, width: Any) -> Any:
    """Return code that writes results of a type, or None for a type that is not numeric."""
    real = (types.Float, types.Integer, types.Boolean)
    parts = result.types if isinstance(result, types.BaseTuple) else (getattr(result, "dtype", result),)
    if not all(isinstance(part, real) for part in parts):
        return None
    if isinstance(result, real):

        def single(result: Any, out: Any, at: Any, width: Any) -> Any:
            if width != -1:
                raise ValueError("one number")
            out[at] = result

        return single
    if isinstance(result, types.Tuple):  # a tuple of different types

        def mixed(result: Any, out: Any, at: Any, width: Any) -> Any:
            if len(result) != width:
                raise ValueError("the number of rates is wrong")
            i = at
            for number in literal_unroll(result):
                out[i] = number
                i += 1

        return mixed
    if isinstance(result, (types.UniTuple, types.List)) or (
        isinstance(result, types.Array) and result.ndim == 1
    ):

        def row(result: Any, out: Any, at: Any, width: Any) -> Any:
            if len(result) != width:
                raise ValueError("the number of rates is wrong")
            for i in range(width):
                out[at + i] = result[i]

        return row
    return None


overload(_put)(_put_compiled)


@numba.njit
def _nothing(s: float, x: Any, p: Any, z: Any, out: Any) -> None:
    """Do nothing; this is the last function in a chain of functions, each of which writes one number."""


def _constant(value: float) -> Any:
    @numba.njit
    def write(s: float, x: Any, p: Any, out: Any, at: int) -> None:
        out[at] = value

    return write


def _one_more(write: Any, place: int, component: int, mode: int, rest: Any) -> Any:
    """Return a function that writes a number of one mode (or 1 in other modes), and then calls the function `rest`."""

    @numba.njit
    def write_row(s: float, x: Any, p: Any, z: Any, out: Any) -> None:
        if component < 0 or z[component] == mode:
            write(s, x, p, out, place)
        else:
            out[place] = 1.0
        rest(s, x, p, z, out)

    return write_row


def _either(component: int, mode: int, write: Any, other: Any) -> Any:
    """Return a function that calls `write` in one mode of a component, and `other` in its other modes."""

    @numba.njit
    def chosen(s: float, x: Any, p: Any, z: Any, out: Any) -> None:
        if z[component] == mode:
            write(s, x, p, out, 0)
        else:
            other(s, x, p, z, out)

    return chosen


def _in_every_mode(write: Any) -> Any:
    @numba.njit
    def flow(s: float, x: Any, p: Any, z: Any, out: Any) -> None:
        write(s, x, p, out, 0)

    return flow


def _as_cfunc(function: Any) -> tuple[int, Any]:
    def form(s: float, x: Any, p: Any, z: Any, out: Any) -> int:
        function(s, x, p, z, out)
        return 0

    compiled = numba.cfunc(SIGNATURE)(form)
    return compiled.address, compiled


def called_back(form: Callable[..., int], parts: Parts, components: int, width: int) -> tuple[int, Any]:
    """Return the address of a C function that calls a Python function, and an object that keeps it alive."""
    sizes = (parts.states, parts.origin_at + 2)

    def call(s: float, x: int, p: int, z: int, out: int) -> int:
        return form(
            s,
            (ctypes.c_double * sizes[0]).from_address(x),
            (ctypes.c_double * sizes[1]).from_address(p),
            (ctypes.c_int64 * components).from_address(z),
            (ctypes.c_double * width).from_address(out),
        )

    pointer = ctypes.c_void_p
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, pointer, pointer, pointer, pointer)
    function = kind(call)
    address = ctypes.cast(function, pointer).value
    assert address is not None
    return address, function


def _in_short(fault: Exception) -> str:
    """Return the first informative line of an error, without colours."""
    lines = [line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", str(fault)).splitlines()]
    telling = [line for line in lines if line and not line.startswith(_HEADS)]
    text = (telling or [type(fault).__name__])[0]
    return text if len(text) <= _REASON else f"{text[: _REASON - 3]}..."
