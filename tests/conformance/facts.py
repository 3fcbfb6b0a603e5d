"""The published and recomputed facts that the scenes are held against."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
CASES: dict[str, Any] = {case["id"]: case for case in json.loads((HERE / "cases.json").read_text())}
TRUTHS: dict[str, Any] = json.loads((HERE / "truths.json").read_text())
