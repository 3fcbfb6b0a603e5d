"""This module reads published and recomputed results, with which the test cases are compared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
CASES: dict[str, Any] = {case["id"]: case for case in json.loads((HERE / "cases.json").read_text("utf-8"))}
TRUTHS: dict[str, Any] = json.loads((HERE / "truths.json").read_text("utf-8"))

Events = tuple[tuple[float, str], ...]
States = tuple[tuple[float, tuple[float | None, ...]], ...]


def recomputed(name: str) -> tuple[Events, States]:
    """Return the events and states of a case in truths.json, for a `Truth`."""
    truth = TRUTHS[name]
    events = tuple((float(t), f"{component}:{mode}") for t, component, mode in truth["events"])
    return events, tuple((float(row[0]), tuple(row[1:])) for row in truth["states"])
