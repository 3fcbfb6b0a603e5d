"""What bounds a run is its own work: neither what waits for others nor what is compiled before it counts."""

from __future__ import annotations

import signal
import time
from dataclasses import replace
from pathlib import Path

import pytest

from hybridsim.engine.record.limits import LimitReached
from hybridsim.engine.system import modules
from hybridsim.testing import SCENES, Truth, clock, measuring
from hybridsim.testing.clock import Endless, ProcessorTime, bounded_work

needs_signals = pytest.mark.skipif(not hasattr(signal, "SIGPROF"), reason="the platform has no such signals")


def work(seconds: float) -> None:
    """Take so much processor time."""
    began = time.thread_time()
    while time.thread_time() - began < seconds:
        pass


@needs_signals
def test_waiting_is_no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a machine that is busy with something else; the work itself is bounded."""
    monkeypatch.setattr(clock, "BACKSTOP", 1000.0)  # this machine may be as busy
    with bounded_work(0.3):
        time.sleep(0.4)
    with pytest.raises(Endless, match=r"0\.3 s of processor time"), bounded_work(0.3):
        work(30.0)


@needs_signals
def test_waiting_without_end_is_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit of the work is far away, because other threads of the process may work meanwhile."""
    monkeypatch.setattr(clock, "BACKSTOP", 0.01)
    began = time.monotonic()
    with pytest.raises(Endless, match="waiting"), bounded_work(10.0):
        time.sleep(30.0)
    assert time.monotonic() - began > 0.1


@needs_signals
def test_what_was_there_before_is_there_again() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGPROF, signal.SIGALRM)]
    with bounded_work(1.0):
        pass
    assert [signal.getsignal(number) for number in (signal.SIGPROF, signal.SIGALRM)] == before
    assert signal.getitimer(signal.ITIMER_PROF)[0] == signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def test_a_run_is_stopped_by_its_own_work_alone() -> None:
    watch = ProcessorTime(0.05)
    work(0.1)  # before its first step
    watch(0.0)
    time.sleep(0.2)
    watch(0.1)
    work(0.06)
    with pytest.raises(LimitReached, match=r"0\.05 s are allowed"):
        watch(0.2)


def test_a_run_that_is_stopped_so_says_limit() -> None:
    (scene,) = (one for one in SCENES if one.name == "FREE-1")
    assert measuring.run(scene, "scipy-rk45", processor_seconds=1e-9).status == "limit"


def test_a_model_that_nobody_has_seen_is_compiled_before_its_clock_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "new.toml"
    path.write_text('[states]\nx = { start = 1, der = "-x*sin(3*x + 0.8147)" }\n', encoding="utf-8")
    scene = replace(
        SCENES[0], name="new", file=str(path), truth=Truth(), params={}, start={}, span=(0.0, 0.1)
    )
    usual, compiled = modules.Compiled.address, []

    def noting(self: modules.Compiled, name: str) -> object:
        compiled.extend([] if name in self._compiled else [name])
        return usual(self, name)

    monkeypatch.setattr(modules.Compiled, "address", noting)
    measuring.prepare(scene, "dop853")
    assert "flow" in compiled
    compiled.clear()
    assert measuring.run(scene, "dop853").stats["steps"] > 0
    assert compiled == []
