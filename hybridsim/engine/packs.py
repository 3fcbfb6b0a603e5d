"""Many arrays for a kernel behind one pointer.

A kernel that is given a tuple of arrays gets seven words for each of them, copied at every call, and counts references
to each; with a hundred arrays that costs more than the kernel's own work, and most of its compilation. A packed tuple
is the address of a table of the arrays' addresses and shapes. In a kernel its fields are read as those of the tuple.
Whoever calls the kernel holds the arrays meanwhile.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from hybridsim.engine.jit import ENABLED

_WORDS = 6  # of an array in the table: its address, and up to five lengths
_REST = [(0,) * (_WORDS - 1 - dimensions) for dimensions in range(_WORDS)]

if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.core.typing.templates import AttributeTemplate
    from numba.extending import (
        NativeValue,
        infer_getattr,
        lower_getattr_generic,
        models,
        register_model,
        typeof_impl,
        unbox,
    )
    from numba.np.arrayobj import populate_array
    from numba.np.numpy_support import from_dtype

    class Packed:
        """A named tuple of C-contiguous arrays, as kernels take it."""

        def __init__(self, arrays: Any) -> None:
            self.arrays = arrays
            words: list[int] = []
            for array in arrays:
                assert array.flags.c_contiguous
                words += (array.__array_interface__["data"][0], *array.shape, *_REST[array.ndim])
            self.table = np.array(words, dtype=np.int64)
            self.address = self.table.__array_interface__["data"][0]
            kind: Any = type(arrays)
            self.numba_type = _type_of_arrays(kind, tuple((a.dtype.char, a.ndim) for a in arrays))

        def __getattr__(self, name: str) -> Any:
            return getattr(self.arrays, name)

    class PackType(types.Type):
        """Type of a packed tuple: its name, and (name, dtype, dimensions) of each field."""

        def __init__(self, title: str, fields: tuple[tuple[str, str, int], ...]) -> None:
            self.title, self.fields = title, fields
            super().__init__(name=f"Pack({title}, {fields})")

        def place(self, name: str) -> int:
            """Row of a field in the table."""
            return [field[0] for field in self.fields].index(name)

        def array(self, name: str) -> Any:
            """Type of a field."""
            _, dtype, dimensions = self.fields[self.place(name)]
            return types.Array(from_dtype(np.dtype(dtype)), dimensions, "C")

    @cache
    def _type_of_arrays(kind: Any, fields: tuple[tuple[str, int], ...]) -> PackType:
        named = zip(kind._fields, fields, strict=True)
        return PackType(kind.__name__, tuple((name, str(np.dtype(char)), n) for name, (char, n) in named))

    @typeof_impl.register(Packed)
    def _type_of(value: Packed, context: Any) -> PackType:
        return value.numba_type

    @register_model(PackType)
    class _PackModel(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: PackType) -> None:
            super().__init__(manager, kind, ir.IntType(64))

    @unbox(PackType)
    def _unbox(kind: PackType, given: Any, c: Any) -> Any:
        attribute = c.pyapi.object_getattr_string(given, "address")
        address = c.pyapi.long_as_longlong(attribute)
        c.pyapi.decref(attribute)
        return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))

    @infer_getattr
    class _PackAttribute(AttributeTemplate):
        key = PackType

        def generic_resolve(self, kind: PackType, name: str) -> Any:
            return kind.array(name) if name in [field[0] for field in kind.fields] else None

    @lower_getattr_generic(PackType)
    def _field(context: Any, builder: Any, kind: PackType, address: Any, name: str) -> Any:
        array_type, word = kind.array(name), ir.IntType(64)
        row = kind.place(name) * _WORDS
        constant = builder.module.add_metadata([])

        def loaded(i: int) -> Any:
            place = builder.add(address, word(8 * (row + i)))
            value = builder.load(builder.inttoptr(place, ir.PointerType(word)))
            value.set_metadata("invariant.load", constant)  # nobody moves the arrays while a kernel runs
            return value

        array = context.make_array(array_type)(context, builder)
        size = context.get_abi_sizeof(context.get_data_type(array_type.dtype))
        shape = [loaded(1 + i) for i in range(array_type.ndim)]
        strides: list[Any] = []
        step = word(size)
        for length in reversed(shape):
            strides.insert(0, step)
            step = builder.mul(step, length)
        data = builder.inttoptr(loaded(0), context.get_data_type(array_type.dtype).as_pointer())
        populate_array(array, data=data, shape=shape, strides=strides, itemsize=word(size), meminfo=None)
        return array._getvalue()


def packed(arrays: Any) -> Any:
    """A named tuple of arrays as kernels take it; the tuple itself where the compiler is switched off."""
    return Packed(arrays) if ENABLED else arrays
