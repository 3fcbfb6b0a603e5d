"""This module reads untrusted files of arrays with memory and time bounded by the size of the file.

The file is a zip of uncompressed NumPy arrays (`numpy.savez`). A compressed member could expand without bound, and an
array header could claim terabytes. Both are refused before any memory is allocated.
"""

from __future__ import annotations

import math
import os
import stat
import tokenize
import zipfile
from io import BytesIO
from typing import IO

import numpy as np
from numpy.lib import format as npy

from hybridsim.errors import UsageError

_KINDS = "fiucbU"  # numbers and text; Python objects and records are refused
_NAMES_IN_UTF8 = 0x800  # the only flag that a member may have
_FAULTS = (
    ValueError, TypeError, KeyError, SyntaxError, EOFError, OverflowError, RecursionError, NotImplementedError,
    zipfile.BadZipFile, tokenize.TokenError,
)  # fmt: skip


def open_regular(name: str, remedy: str) -> IO[bytes]:
    """Open a regular file for reading; devices and pipes are rejected, because they may never end.

    Raises
    ------
    UsageError
        If the file cannot be read; the message gives the reason.
    """
    try:
        if not stat.S_ISREG(os.stat(name).st_mode):
            raise UsageError(f"{name} cannot be read: it is not a regular file", remedy=remedy)
        return open(name, "rb")
    except (OSError, ValueError) as fault:
        if isinstance(fault, UsageError):
            raise
        reason = getattr(fault, "strerror", None) or fault
        raise UsageError(f"{name} cannot be read: {reason}", remedy=remedy) from fault


def read_arrays(file: IO[bytes]) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name.

    Raises
    ------
    ValueError
        If the file is not an archive of plain arrays.
    """
    try:
        if not zipfile.is_zipfile(file):
            raise ValueError("the file is not an archive of arrays")
        size = file.seek(0, os.SEEK_END)
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            _check_members(members, size)
            named = ((member.filename.removesuffix(".npy"), member) for member in members)
            return {name: _array(archive.read(member), name) for name, member in named}
    except _FAULTS as fault:
        raise ValueError(str(fault)) from fault


def _check_members(members: list[zipfile.ZipInfo], size: int) -> None:
    """Reject archive members that `numpy.savez` would not write, or that do not fit into the file size."""
    names = {member.filename for member in members}
    if len(names) != len(members) or len({name.removesuffix(".npy") for name in names}) != len(names):
        raise ValueError("two arrays in the file have the same name")
    for member in members:
        is_plain = member.compress_type == zipfile.ZIP_STORED and member.file_size == member.compress_size
        if not is_plain or member.flag_bits & ~_NAMES_IN_UTF8:
            raise ValueError(
                f"the array '{member.filename}' is compressed or encrypted, or has unsupported zip flags"
            )
    if sum(member.file_size for member in members) > size:
        raise ValueError("the arrays are larger than the file")


def _array(content: bytes, name: str) -> np.ndarray:
    """Return one array after checking that its shape fits the number of its bytes."""
    head = BytesIO(content)
    version = npy.read_magic(head)
    if version == (1, 0):
        shape, is_fortran, dtype = npy.read_array_header_1_0(head)
    elif version == (2, 0):
        shape, is_fortran, dtype = npy.read_array_header_2_0(head)
    else:
        raise ValueError(f"the array '{name}' is of version {version}")
    if dtype.hasobject or dtype.kind not in _KINDS or not dtype.isnative:
        raise ValueError(f"the array '{name}' cannot be read as numbers")
    start = head.tell()
    is_shape = len(shape) <= 5 and all(type(n) is int and 0 <= n <= len(content) for n in shape)
    if not is_shape or math.prod(shape) * dtype.itemsize != len(content) - start:
        raise ValueError(f"the array '{name}' has a shape that does not match its content")
    found = np.ndarray(shape, dtype, bytearray(content[start:]), order="F" if is_fortran else "C")
    return np.ascontiguousarray(found).reshape(shape)
