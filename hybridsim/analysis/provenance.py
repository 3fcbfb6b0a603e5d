"""This module records where a result comes from: versions, machine, and a hash of the model."""

from __future__ import annotations

import hashlib
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from hybridsim import __version__
from hybridsim.analysis.structures.swept import model_to_sweep
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model

_PACKAGES = ("numpy", "scipy", "numba", "scikit-sundae", "sympy", "mpmath")


def provenance(model: Model | MechanicalSystem) -> dict[str, Any]:
    """Return versions, machine, model, parameters and initial values of a result as plain values for JSON.

    The hash covers the model as text with the parameters and initial values of this run. It is None for a
    model of Python functions or a `MechanicalSystem`, which have no text.
    """
    read = model_to_sweep(model, None)
    return {
        "hybridsim": __version__,
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        **{name: _version(name) for name in _PACKAGES},
        "system": platform.system(),
        "processor": platform.machine(),
        "cpus": os.cpu_count(),
        "model": read.name,
        "parameters": dict(read.parameter_values()),
        "start": dict(read.start_values()),
        "model_sha256": None if read.flow else hashlib.sha256(read.to_toml().encode()).hexdigest(),
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
