"""The former module of `Step` and `Flow`, now in `hybridsim.integrators.contract`; deprecated."""

from __future__ import annotations

import warnings
from typing import Any

from hybridsim.engine.record import counters, segments
from hybridsim.engine.run import stepping
from hybridsim.engine.system import failures, tolerances


def __getattr__(name: str) -> Any:
    for module in (stepping, failures, tolerances, counters, segments):
        if not name.startswith("_") and hasattr(module, name):
            warnings.warn(
                f"hybridsim.engine.stepping is deprecated; version 0.2 removes it. Import {name} from "
                "hybridsim.integrators.contract",
                DeprecationWarning,
                stacklevel=2,
            )
            return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
