"""This module packs named tuples of arrays, so that kernels receive them by one pointer.

A kernel that is given a tuple of arrays receives seven words per array, copied at every call, and counts
references to each. With a hundred arrays that costs more than the kernel's own work and most of its compile
time. A packed tuple is the address of a table of the arrays' addresses and shapes. Kernels read its fields
like those of the tuple. A field may be another packed tuple. The caller must keep the arrays alive during the call.
"""

from __future__ import annotations

import hashlib
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.native.inner_parts import needed
from hybridsim.engine.native.kernels import ENABLED

SLOTS_PER_ARRAY = 6  # words of 8 bytes per array in the table: its address and up to five lengths
_REST = [(0,) * (SLOTS_PER_ARRAY - 1 - dimensions) for dimensions in range(SLOTS_PER_ARRAY)]


if ENABLED:
    from llvmlite import ir
    from numba import from_dtype, types
    from numba.extending import (
        NativeValue,
        infer_getattr,
        intrinsic,
        lower_getattr_generic,
        models,
        register_model,
        typeof_impl,
        unbox,
    )

    cgutils, populate_array = needed("cgutils"), needed("populate_array")
    AttributeTemplate: Any = needed("AttributeTemplate")

    class Packed:
        """A named tuple of arrays in the form that kernels receive: a table of addresses and shapes."""

        def __init__(self, arrays: Any, table: np.ndarray, numba_type: PackType, address: int) -> None:
            self.arrays, self.table, self.numba_type, self.address = arrays, table, numba_type, address
            if arrays is not None:
                vars(self).update(arrays._asdict())  # fields are attributes, as in the tuple

        if TYPE_CHECKING:

            def __getattr__(self, name: str) -> Any: ...

    class PackType(types.Type):
        """The numba type of a packed tuple, with the name and the type of each field."""

        def __init__(self, title: str, fields: tuple[tuple[str, Any], ...]) -> None:
            self.title, self.fields = title, fields
            self._rows = {name: SLOTS_PER_ARRAY * k for k, (name, _) in enumerate(fields)}
            # the name is part of the names of all kernels that take the pack
            digest = hashlib.sha256(str(fields).encode()).hexdigest()[:12]
            super().__init__(name=f"Pack({title}, {digest})")

        def place(self, name: str) -> int:
            """Return the row of the address table that belongs to a field."""
            return self._rows[name]

    @cache
    def type_of_fields(kind: Any, fields: tuple[Any, ...]) -> PackType:
        """Return the numba type of a named tuple from the types of its fields."""
        found = [
            field
            if isinstance(field, PackType)
            else types.Array(from_dtype(np.dtype(field[0])), field[1], "C")
            for field in fields
        ]
        return PackType(kind.__name__, tuple(zip(kind._fields, found, strict=True)))

    @typeof_impl.register(Packed)
    def _type_of(value: Packed, context: Any) -> PackType:
        return value.numba_type

    @register_model(PackType)
    class _PackModel(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: PackType) -> None:
            super().__init__(manager, kind, ir.IntType(64))

    @unbox(PackType)
    def _unbox(kind: PackType, packed_object: Any, c: Any) -> Any:
        attribute = c.pyapi.object_getattr_string(packed_object, "address")
        address = c.pyapi.long_as_longlong(attribute)
        c.pyapi.decref(attribute)
        return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))

    @infer_getattr
    class _PackAttribute(AttributeTemplate):
        key = PackType

        def generic_resolve(self, kind: PackType, name: str) -> Any:
            return dict(kind.fields).get(name)

    @lower_getattr_generic(PackType)
    def _field(context: Any, builder: Any, kind: PackType, address: Any, name: str) -> Any:
        array_type, word = dict(kind.fields)[name], ir.IntType(64)
        row = kind.place(name)
        constant = builder.module.add_metadata([])

        def loaded(i: int) -> Any:
            place = builder.add(address, word(8 * (row + i)))
            value = builder.load(builder.inttoptr(place, ir.PointerType(word)))
            value.set_metadata("invariant.load", constant)  # arrays do not move while a kernel runs
            return value

        if isinstance(array_type, PackType):
            return loaded(0)
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

    @intrinsic
    def pack_at(typingctx: Any, address: Any, like: Any) -> Any:
        """Return the pack whose table is at an address; `like` gives its type."""
        return like(types.int64, like), lambda context, builder, signature, arguments: arguments[0]

    def opaque(pack: Any) -> Any:
        """Return a pack as a plain address, for kernels that do not read its arrays."""
        return pack.address

    def address_in(pack: Any, name: str) -> np.ndarray:
        """Return the table entry (1,) that holds the address of a field."""
        row = pack.numba_type.place(name)
        place: np.ndarray = pack.table[row : row + 1]
        return place

    def replaced(pack: Any, **inner: Any) -> Any:
        """Replace packs inside a pack, and return the pack; no kernel may be using it."""
        for name, other in inner.items():
            if getattr(pack, name) is not other:
                address_in(pack, name)[0] = other.address
                setattr(pack, name, other)
        return pack

else:

    def pack_at(address: int, like: Any) -> Any:
        """Raise NotImplementedError; addresses require the compiler, which is off."""
        raise NotImplementedError

    def opaque(pack: Any) -> Any:
        """Return the tuple itself, because the compiler is off."""
        return pack

    def address_in(pack: Any, name: str) -> np.ndarray:
        """Raise NotImplementedError; addresses require the compiler, which is off."""
        raise NotImplementedError

    def replaced(pack: Any, **inner: Any) -> Any:
        """Return a copy of a named tuple with some inner tuples replaced."""
        return pack._replace(**inner)


def packed(arrays: Any) -> Any:
    """Pack the arrays of a named tuple for kernels; return the tuple unchanged if the compiler is off."""
    if not ENABLED:
        return arrays
    entries: list[int] = []
    form: list[Any] = []
    for array in arrays:
        if isinstance(array, Packed):
            entries += (array.address, *_REST[0])
            form.append(array.numba_type)
            continue
        assert array.flags.c_contiguous
        entries += (array.__array_interface__["data"][0], *array.shape, *_REST[array.ndim])
        form.append((array.dtype.char, array.ndim))
    table = np.array(entries, dtype=np.int64)
    kind: Any = type(arrays)
    return Packed(arrays, table, type_of_fields(kind, tuple(form)), table.__array_interface__["data"][0])
