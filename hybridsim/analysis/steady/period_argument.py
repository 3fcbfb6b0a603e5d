"""This module checks the period of the forcing that a call of `steady_state` contains."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.arguments import cannot_be, number
from hybridsim.errors import UsageError

_COMMENSURATE = 1e-9  # relative difference from a whole multiple


def require_multiple(period: Any, own: float | None, name: str) -> float:
    """Return a period as a number, after checking that it is a multiple of the forcing's own period, if known."""
    found = number(period, "period")
    if not (found > 0.0 and math.isfinite(found)):
        raise cannot_be("period", found, "use a time above zero")
    if own is not None and abs(found / own - max(round(found / own), 1)) > _COMMENSURATE * found / own:
        raise UsageError(
            f"`period` is {found!r}, but {name} is forced with the period {own!r}",
            remedy="remove `period`, or use a whole multiple of the forcing period",
        )
    return found
