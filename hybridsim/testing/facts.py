"""Published and recomputed results with which the scenes are compared."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
CASES: dict[str, Any] = {case["id"]: case for case in json.loads((HERE / "cases.json").read_text("utf-8"))}
TRUTHS: dict[str, Any] = json.loads((HERE / "truths.json").read_text("utf-8"))

Events = tuple[tuple[float, str], ...]
States = tuple[tuple[float, tuple[float | None, ...]], ...]


def recomputed(name: str, rename: Mapping[str, str] | None = None) -> tuple[Events, States]:
    """Return the events and states of a case in truths.json as a `Truth`; components can be renamed."""
    truth, other = TRUTHS[name], rename or {}
    events = tuple((float(t), f"{other.get(c, c)}:{mode}") for t, c, mode in truth["events"])
    return events, tuple((float(row[0]), tuple(row[1:])) for row in truth["states"])
