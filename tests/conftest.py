"""No outcome depends on how fast the machine is: examples have no deadline, and advice stops nothing by the clock."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator
from importlib import import_module

import pytest
from hypothesis import HealthCheck, settings

# A first call may compile a kernel, and the machine may have other work; a profile that is asked for stays.
settings.register_profile("noisy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
if settings.get_current_profile_name() == "default":
    settings.load_profile("noisy")


def pytest_collection_finish() -> None:
    """Exempt the collected tests and the libraries from garbage collections, and collect less often.

    These objects are permanent, and collections that scanned them would take a sixth of the processor time.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def no_limit_by_the_clock() -> Iterator[None]:
    """An advice stops a rung that takes much longer than the full model; here each takes as long as it takes."""
    advise = import_module("hybridsim.analysis.advise.advise")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("_LEAST", "_LEAST_AT_A_POINT", "_BUDGET"):
            patch.setattr(advise, name, math.inf)
        yield
