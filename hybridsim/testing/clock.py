"""Limits on the processor time of a run. Unlike wall time, processor time is not affected by other processes."""

from __future__ import annotations

import _weakrefset
import gc
import signal
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from hybridsim.engine.record.limits import LimitReached

# limit of the elapsed time in units of the processor time, for runs that wait
BACKSTOP = 10.0
_LATER = 1e-3  # seconds


class Endless(Exception):
    """Raised if a run exceeds its time limit."""


@contextmanager
def bounded_work(seconds: float) -> Iterator[None]:
    """Raise Endless when a block exceeds its time limit (in the main thread, where timer signals exist).

    Timer signals of the process count the processor time of all threads. The elapsed time is limited too.
    """
    if not hasattr(signal, "SIGPROF") or threading.current_thread() is not threading.main_thread():
        yield
        return
    bounds = (
        (signal.SIGPROF, signal.ITIMER_PROF, seconds, "processor time"),
        (signal.SIGALRM, signal.ITIMER_REAL, BACKSTOP * seconds, "waiting"),
    )
    before = {number: signal.getsignal(number) for number, *_ in bounds}
    for number, timer, bound, what in bounds:
        signal.signal(number, _giving_up(f"no end after {bound:g} s of {what}"))
        signal.setitimer(timer, bound)
    try:
        yield
    finally:
        for number, timer, *_ in bounds:
            signal.setitimer(timer, 0.0)
            signal.signal(number, before[number])


def _giving_up(message: str) -> Callable[[int, FrameType | None], None]:
    def give_up(number: int, frame: FrameType | None) -> None:
        if _is_passed_over(frame):  # try again a little later
            signal.setitimer(signal.ITIMER_REAL if number == signal.SIGALRM else signal.ITIMER_PROF, _LATER)
            return
        raise Endless(message)

    return give_up


def _is_passed_over(frame: FrameType | None) -> bool:
    """Return whether Python would ignore an exception that is raised in a frame, as it does in finalisers."""
    codes = [getattr(function, "__code__", None) for function in gc.callbacks]
    files = (weakref.__file__, _weakrefset.__file__)
    while frame is not None:
        code = frame.f_code
        if code in codes or code.co_filename in files or code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


class ProcessorTime:
    """A `progress` function that ends the run with status "limit" after a given processor time.

    It counts the processor time of the running thread from its first step, so compiling is not included.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._began: float | None = None

    def __call__(self, fraction: float) -> None:
        now = time.thread_time()
        if self._began is None:
            self._began = now
        elif now - self._began >= self.seconds:
            raise LimitReached(
                f"{now - self._began:.3g} s of processor time were used, but only {self.seconds:g} s are allowed"
            )
