"""What a stopwatch leaves out, and that a time budget ends."""

from __future__ import annotations

import time
from typing import Any

import pytest

from hybridsim.analysis.time_budget import OutOfTime, Stopwatch, TimeBudget
from hybridsim.engine.native import compiler, kernels, notices


def _twice(x: float) -> float:
    return 2.0 * x


@pytest.mark.skipif(not kernels.ENABLED, reason="the compiler is switched off")
def test_a_stopwatch_stands_still_while_a_kernel_is_compiled() -> None:
    before, began, watch = compiler.seconds_compiling(), time.perf_counter(), Stopwatch()
    assert kernels.kernel(_twice)(1.0) == 2.0
    seconds, spent = watch.seconds, time.perf_counter() - began
    compiled = compiler.seconds_compiling() - before
    assert 0.0 < compiled < spent
    assert seconds <= spent - compiled


def test_an_allowance_is_looked_at_until_it_is_over() -> None:
    looks: list[None] = []
    TimeBudget(1e9, lambda: looks.append(None))(0.5)
    assert len(looks) == 1
    with pytest.raises(OutOfTime, match="not finished after"):
        TimeBudget(-1.0)()


@pytest.mark.skipif(not kernels.ENABLED, reason="the compiler is switched off")
def test_compiling_that_takes_a_while_is_said_once(
    capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr(notices, "_announced", set())
    monkeypatch.setattr(compiler, "_NOTICED", 0.0)
    numba = pytest.importorskip("numba")  # the compiler that is listened to
    for module in ("somebody.else", "hybridsim.engine.mine", "hybridsim.engine.mine"):

        def doubled(x: float) -> float:
            return 2.0 * x

        doubled.__module__ = module
        numba.njit(doubled)(1.0)  # not cached: it is compiled each time
    (line,) = capsys.readouterr().err.splitlines()
    before, _, after = line.partition(" (once, 10 to 30 s); cached in /")
    assert before.startswith("hybridsim: compiling another part of the engine, hybridsim/") and after
