"""The deprecated path of the integrator interface; use `hybridsim.integrators.contract`."""

from __future__ import annotations

import warnings
from typing import Any

from hybridsim.integrators import contract


def __getattr__(name: str) -> Any:
    if name.startswith("_") or not hasattr(contract, name):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(
        "hybridsim.integrators.base is deprecated; version 0.2 removes it. Import from "
        "hybridsim.integrators.contract",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(contract, name)
