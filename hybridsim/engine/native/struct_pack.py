"""Named tuples of many arrays, which are passed to kernels by one pointer.

A kernel that is given a tuple of arrays receives seven words per array, copied at every call, and counts
references to each. With a hundred arrays that costs more than the kernel's own work and most of its compile
time. A packed tuple is the address of a table of the arrays' addresses and shapes. Kernels read its fields
like those of the tuple. A field may be another packed tuple. The caller must keep the arrays alive during the call.
"""

from __future__ import annotations

import ctypes
import hashlib
import math
from collections import namedtuple
from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.native.inner_parts import needed
from hybridsim.engine.native.kernels import ENABLED, kernel

_SLOTS_PER_ARRAY = 6  # words of 8 bytes per array in the table: its address and up to five lengths
ALIGNED = 64  # bytes; suitable for numbers of any kind
_LARGE, LARGEST = 1 << 18, 1 << 21  # bytes of blocks that go through a pool
_RETURNED = 2  # first blocks that a layout keeps for reuse
_REST = [(0,) * (_SLOTS_PER_ARRAY - 1 - dimensions) for dimensions in range(_SLOTS_PER_ARRAY)]

_MAX_FREE_BLOCKS = 4  # most free blocks in a pool

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
        """A named tuple of C-contiguous arrays in the form that kernels take: a table of addresses and shapes."""

        def __init__(self, arrays: Any, table: np.ndarray, numba_type: PackType, address: int) -> None:
            self.arrays, self.table, self.numba_type, self.address = arrays, table, numba_type, address
            if arrays is not None:
                vars(self).update(arrays._asdict())  # fields are attributes, as in the tuple

        if TYPE_CHECKING:

            def __getattr__(self, name: str) -> Any: ...

    class PackType(types.Type):
        """The numba type of a packed tuple: its name, and the name and the numba type of each field."""

        def __init__(self, title: str, fields: tuple[tuple[str, Any], ...]) -> None:
            self.title, self.fields = title, fields
            # the name is part of the names of all kernels that take the pack
            digest = hashlib.sha256(str(fields).encode()).hexdigest()[:12]
            super().__init__(name=f"Pack({title}, {digest})")

        def place(self, name: str) -> int:
            """Return the row of a field in the table."""
            return [field[0] for field in self.fields].index(name)

    @cache
    def _type_of_fields(kind: Any, fields: tuple[Any, ...]) -> PackType:
        """Return the type of a named tuple; fields: a `PackType`, or dtype and dimensions of an array."""
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
        row = kind.place(name) * _SLOTS_PER_ARRAY
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
        """Return the pack whose table is at an address, with the type of another pack."""
        return like(types.int64, like), lambda context, builder, signature, arguments: arguments[0]

    def opaque(pack: Any) -> Any:
        """Return a pack for a kernel that only passes it on to a kernel that knows its type: its address."""
        return pack.address

    def address_in(pack: Any, name: str) -> np.ndarray:
        """Return the place (1,) of the address of a field in the table of a pack."""
        row = pack.numba_type.place(name) * _SLOTS_PER_ARRAY
        place: np.ndarray = pack.table[row : row + 1]
        return place

    def replaced(pack: Any, **inner: Any) -> Any:
        """Return a pack with other packs in it: itself, with new addresses. No kernel may be using it."""
        for name, other in inner.items():
            if getattr(pack, name) is not other:
                address_in(pack, name)[0] = other.address
                setattr(pack, name, other)
        return pack

else:

    def pack_at(address: int, like: Any) -> Any:
        """Raise an error: without a compiler there are no addresses."""
        raise NotImplementedError

    def opaque(pack: Any) -> Any:
        """Return the tuple itself, because the compiler is off."""
        return pack

    def address_in(pack: Any, name: str) -> np.ndarray:
        """Raise an error: without a compiler there are no addresses."""
        raise NotImplementedError

    def replaced(pack: Any, **inner: Any) -> Any:
        """Return a tuple with other tuples in it."""
        return pack._replace(**inner)


def packed(arrays: Any) -> Any:
    """Pack a named tuple of arrays and packs for kernels; return the tuple itself if the compiler is off."""
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
    return Packed(arrays, table, _type_of_fields(kind, tuple(form)), table.__array_interface__["data"][0])


@kernel
def _lay_out(entries: Any, steps: Any, owners: Any, skipped: Any, blocks: Any, table: Any) -> int:
    """Fill the table of arrays that lie in some blocks and return its address; see `ArrayLayout`."""
    for k in range(entries.shape[0]):
        for i in range(entries.shape[1]):
            table[k, i] = entries[k, i] + skipped[k] * steps[k, i]
        table[k, 0] += blocks[owners[k]].ctypes.data
    address: int = table.ctypes.data
    return address


@lru_cache(64)
def _whole_numbers(numbers: tuple[int, ...]) -> np.ndarray:
    return np.array(numbers, dtype=np.int64)


class ArrayLayout:
    """A layout of arrays of rows that lie one behind the other in a few blocks of memory.

    Offsets are computed once; a new block is a single allocation, and packing all arrays takes a few
    additions. A block is freed with the last array in it, so arrays with different lifetimes belong in
    different blocks.

    Parameters
    ----------
    kinds : types of named tuples, whose arrays lie one behind the other.
    fields : dtype, shape and block number of each array.
    """

    def __init__(self, kinds: Sequence[Any], fields: Sequence[tuple[Any, tuple[int, ...], int]]) -> None:
        self._kinds = [(kind, len(kind._fields)) for kind in kinds]
        self._kind: Any = namedtuple("Rows", [name for kind in kinds for name in kind._fields])  # type: ignore[misc]
        self._specs: list[tuple[tuple[int, ...], np.dtype[Any], int, int]] = []
        self._sizes = [0] * (1 + max(block for *_, block in fields))
        # the table without the addresses of the blocks
        self._entries = np.zeros((len(fields), _SLOTS_PER_ARRAY), dtype=np.int64)
        self._steps = np.zeros_like(self._entries)  # change of the table per skipped row
        self._owners = np.array([block for *_, block in fields], dtype=np.int64)
        for k, (name, shape, block) in enumerate(fields):
            dtype, offset = np.dtype(name), self._sizes[block]
            row = dtype.itemsize * math.prod(shape[1:])
            self._specs.append((shape, dtype, block, offset))
            self._entries[k, : 1 + len(shape)] = offset, *shape
            self._steps[k, :2] = row, -1
            self._sizes[block] += -(-row * shape[0] // ALIGNED) * ALIGNED
        self._pools = [BufferPool(size) if _LARGE <= size <= LARGEST else None for size in self._sizes]
        form = [(dtype.char, len(shape)) for shape, dtype, *_ in self._specs]
        self._types: list[
            tuple[Any, int]
        ] = []  # the type of each pack, and the bytes of its part of the table
        for kind, count in self._kinds if ENABLED else ():
            self._types.append((_type_of_fields(kind, tuple(form[:count])), 8 * _SLOTS_PER_ARRAY * count))
            del form[:count]
        self._returned: list[np.ndarray] = []
        self._from_the_first = np.zeros(len(fields), dtype=np.int64)

    def blank(self) -> tuple[np.ndarray, ...]:
        """Return uninitialised blocks that nothing else uses."""
        try:
            first = self._returned.pop()
        except IndexError:  # another thread may take the last one after a test
            first = self._block(0)
        return first, *map(self._block, range(1, len(self._sizes)))

    def _block(self, k: int) -> np.ndarray:
        pool = self._pools[k]
        return np.empty(self._sizes[k], dtype=np.uint8) if pool is None else pool.block()

    def take_back(self, block: np.ndarray) -> None:
        """Return an unused first block to the layout, which uses it again for the next call."""
        if len(self._returned) < _RETURNED:
            self._returned.append(block)

    def packed(self, blocks: tuple[np.ndarray, ...], skipped: Sequence[int] | None = None) -> list[Any]:
        """Pack the arrays of each named tuple for kernels; skipped: rows to omit at the start of each array."""
        packs: list[Any] = []
        if not ENABLED:
            arrays = iter(zip(self.rows(blocks), skipped or self._from_the_first, strict=True))
            for kind, count in self._kinds:
                packs.append(kind(*(a[k:] for a, k in islice(arrays, count))))
            return packs
        rows = self._from_the_first if skipped is None else _whole_numbers(tuple(skipped))
        table = np.empty_like(self._entries)
        address = _lay_out(self._entries, self._steps, self._owners, rows, blocks, table)
        for form, size in self._types:
            packs.append(Packed(None, table, form, address))
            address += size
        return packs

    def rows(self, blocks: tuple[np.ndarray | None, ...]) -> Any:
        """Return the arrays, with None for arrays in missing blocks."""
        return self._kind(
            *[
                None if blocks[k] is None else np.ndarray(shape, dtype, blocks[k], offset)
                for shape, dtype, k, offset in self._specs
            ]
        )

    def row(self, blocks: tuple[np.ndarray, ...], name: str, i: int) -> np.ndarray:
        """Return a copy of row i of the array with this name."""
        shape, dtype, k, offset = self._specs[self._kind._fields.index(name)]
        return np.ndarray(shape, dtype, blocks[k], offset)[i].copy()


class BufferPool:
    """A pool of blocks of one size in bytes, each of which is reused when all arrays in it have been deleted.

    The operating system maps a fresh block page by page, when it is first written. In a compiled loop this can cost a
    sixth of the time of a run of thousands of steps.

    Each block is handed out as a buffer object over its memory. Every array over the buffer, and every view of such
    an array, keeps the buffer alive. The memory returns to the pool when the buffer is deleted.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._free: list[bytearray] = []
        self._kind = _buffer_type(size, self._free)

    def block(self) -> np.ndarray:
        """Return a block; its contents are undefined."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = bytearray(self.size)
        buffer = self._kind.from_buffer(memory)
        buffer.memory = memory
        return np.frombuffer(memoryview(buffer), dtype=np.uint8)


def _buffer_type(size: int, free: list[bytearray]) -> Any:
    """Return a buffer type of a size in bytes whose instances return their memory to the pool when deleted."""

    class PooledBuffer(ctypes.c_char * size):  # type: ignore[misc]  # the size is known at run time
        memory: bytearray

        def __del__(
            self, limit: int = _MAX_FREE_BLOCKS
        ) -> None:  # globals may be gone while Python shuts down
            if len(free) < limit:
                free.append(self.memory)

    return PooledBuffer
