"""Compiling kernels leaves numba's own settings, which are everybody's, as they were."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from hybridsim.engine.native import compiler, kernel_cache, kernels

pytestmark = pytest.mark.skipif(not kernels.ENABLED, reason="nothing is compiled")


def settings() -> tuple[Any, Any]:
    """Level of LLVM's passes, and the machine whose costs they go by."""
    found = compiler._settings()
    assert None not in found  # this version of numba tells both
    return found


@pytest.fixture
def met(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, Any]]:
    """The settings under which LLVM's passes were chosen."""
    from numba.core.registry import cpu_target

    found: list[tuple[Any, Any]] = []
    codegen = type(cpu_target.target_context.codegen())
    choose: Callable[..., Any] = codegen._pass_builder

    def noted(self: Any, **options: Any) -> Any:
        found.append(settings())
        return choose(self, **options)

    monkeypatch.setattr(codegen, "_pass_builder", noted)
    return found


def one(given: Any) -> int:
    return 1


def faulty(given: Any) -> int:
    return given.nothing_of_the_kind


def test_a_kernel_has_settings_of_its_own(
    met: list[tuple[Any, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_cache, "kernel_folder", lambda: tmp_path)  # where nothing is kept yet
    before = settings()
    assert compiler._ours() != before
    assert kernels.kernel_address(one, np.zeros(1)) and set(met) == {compiler._ours()}
    assert settings() == before
    met.clear()
    kernel = numba.njit(lambda given: 2)
    kernel.py_func.__module__ = "hybridsim.engine.of_a_test"  # ours are known by it
    assert kernel(np.zeros(1)) == 2 and set(met) == {compiler._ours()}
    assert settings() == before
    met.clear()
    assert numba.njit(lambda given: 3)(np.zeros(1)) == 3 and set(met) == {before}


def test_they_go_where_compiling_fails() -> None:
    before = settings()
    with pytest.raises(numba.TypingError):
        kernels.kernel_address(faulty, np.zeros(1))
    assert settings() == before
    kernel = numba.njit(faulty)
    kernel.py_func.__module__ = "hybridsim.engine.of_a_test"
    with pytest.raises(numba.TypingError):
        kernel(np.zeros(1))
    assert settings() == before
