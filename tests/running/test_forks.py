"""Children that are forked beside running threads run models: no lock is held by a thread that is not there."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system import system_cache

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
PATIENCE = 600.0


def ends_well(work: Callable[[], bool]) -> bool:
    """Whether a forked child does this, and comes to its end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # from Python 3.12 on: what is tried here
        child = os.fork()
    if child == 0:
        try:
            os._exit(0 if work() else 1)
        finally:
            os._exit(2)
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) == 0
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


@contextmanager
def a_thread_in(begin: Callable[[threading.Event, threading.Event], None]) -> Iterator[None]:
    """Another thread is in the middle of something: it says so by the first event, and ends by the second."""
    is_in, may_end = threading.Event(), threading.Event()
    thread = threading.Thread(target=begin, args=(is_in, may_end))
    thread.start()
    try:
        assert is_in.wait(PATIENCE)
        yield
    finally:
        may_end.set()
        thread.join()


def swing(name: str) -> bool:
    """A run of a model that nobody has run."""
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der="-x")]
    return hs.simulate(hs.Model(name, states=states), (0, 1), integrator="taylor").success


def test_a_property_that_is_worked_out_meanwhile() -> None:
    """In Python 3.11 a cached property has one lock for all instances of its class."""
    assert swing("before")

    def begin(is_in: threading.Event, may_end: threading.Event) -> None:
        class Slow:
            @property
            def t1(self) -> float:
                is_in.set()
                may_end.wait(PATIENCE)
                return 1.0

            t0 = 0.0

        vars(Task)["forward"].__get__(Slow(), Slow)

    with a_thread_in(begin):
        assert ends_well(lambda: swing("meanwhile"))


def test_a_lock_that_is_held_meanwhile() -> None:
    """The systems that were run last are kept under a lock."""
    assert swing("earlier")

    def begin(is_in: threading.Event, may_end: threading.Event) -> None:
        with system_cache._lock:
            is_in.set()
            may_end.wait(PATIENCE)

    with a_thread_in(begin):
        assert ends_well(lambda: swing("under-a-lock"))


def test_a_compiler_that_is_at_work_meanwhile() -> None:
    """numba compiles for one thread at a time."""
    compiler_lock: Any = pytest.importorskip("numba.core.compiler_lock")
    from hybridsim.engine.native.kernels import ENABLED

    if not ENABLED:
        pytest.skip("nothing is compiled")
    import numba

    def begin(is_in: threading.Event, may_end: threading.Event) -> None:
        with compiler_lock.global_compiler_lock:
            is_in.set()
            may_end.wait(PATIENCE)

    def compiles() -> bool:
        return int(numba.njit(lambda x: x + 1)(1)) == 2

    with a_thread_in(begin):
        assert ends_well(compiles)
