"""No outcome depends on how fast the machine is: examples have no deadline, and advice stops nothing by the clock."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator
from importlib import import_module
from itertools import count

import pytest
from hypothesis import HealthCheck, settings

# A first call may compile a kernel, and the machine may have other work; a profile that is asked for stays.
settings.register_profile("noisy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
if settings.get_current_profile_name() == "default":
    settings.load_profile("noisy")

MODULES = (
    100  # a collection of everything after so many modules of tests, for objects that were not permanent
)
_MODULES = count(1)


def pytest_collection_finish() -> None:
    """Collect garbage less often: by default it would take a sixth of the processor time, as in `hybridsim.cli`."""
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="module", autouse=True)
def frozen_objects() -> None:
    """Exempt what former tests left behind from collections, since most of it is permanent.

    A full collection of these libraries, tests and compiled kernels would take seconds.
    """
    if next(_MODULES) % MODULES == 0:
        gc.unfreeze()
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def no_limit_by_the_clock() -> Iterator[None]:
    """An advice stops a rung that takes much longer than the full model; here each takes as long as it takes."""
    advise = import_module("hybridsim.analysis.advise.advise")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("_LEAST", "_LEAST_AT_A_POINT", "_BUDGET"):
            patch.setattr(advise, name, math.inf)
        yield
