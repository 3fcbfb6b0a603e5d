"""This module writes data into an HTML page: arrays as base64, and JSON without characters of HTML."""

from __future__ import annotations

import json
from base64 import b64encode
from typing import Any

import numpy as np

# The characters that could end the element around the JSON, as escapes of JSON.
_ESCAPES = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}


def array(values: Any, kind: str) -> dict[str, str]:
    """Return an array as text for the HTML page; `kind` is its NumPy type without the byte order, such as "f8"."""
    data = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"kind": kind, "bytes": b64encode(data.tobytes()).decode("ascii")}


def numbers(values: Any) -> dict[str, str]:
    """Return an array of numbers in single precision, or in double precision for very large or small numbers."""
    data = np.asarray(values, dtype=float)
    sizes = np.abs(data[np.isfinite(data) & (data != 0.0)])
    limits = np.finfo(np.float32)
    is_single = not sizes.size or (sizes.min() >= limits.tiny and sizes.max() <= limits.max)
    return array(data, "f4" if is_single else "f8")


def indices(values: Any) -> dict[str, str]:
    """Return an array of indices in the smallest unsigned type."""
    found = np.asarray(values, dtype=np.int64)
    most = int(found.max()) if found.size else 0
    return array(found, "u1" if most < 1 << 8 else "u2" if most < 1 << 16 else "u4")


def json_in_html(value: Any) -> str:
    """Return a value as JSON that cannot end the HTML element in which it is written."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for character, escape in _ESCAPES.items():
        text = text.replace(character, escape)
    return text
