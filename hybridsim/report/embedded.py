"""This module writes data into an HTML page: arrays as base64, and JSON without characters of HTML."""

from __future__ import annotations

import json
from base64 import b64encode
from typing import Any

import numpy as np

# The characters that could end the element around the JSON, as escapes of JSON.
_ESCAPES = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}


def array(values: Any, kind: str) -> dict[str, str]:
    """Return an array for the page; `kind` is the type of NumPy without the byte order, such as "f8"."""
    data = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"kind": kind, "bytes": b64encode(data.tobytes()).decode("ascii")}


def indices(values: Any) -> dict[str, str]:
    """Return an array of indices in the smallest unsigned type."""
    found = np.asarray(values, dtype=np.int64)
    most = int(found.max()) if found.size else 0
    return array(found, "u1" if most < 1 << 8 else "u2" if most < 1 << 16 else "u4")


def json_in_html(value: Any) -> str:
    """Return a value as JSON that cannot end the element of HTML around it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for character, escape in _ESCAPES.items():
        text = text.replace(character, escape)
    return text
