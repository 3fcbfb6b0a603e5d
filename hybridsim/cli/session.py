"""One run of the program: which files it has written, and whether it has been asked to stop."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from hybridsim.cli.output import complain

_SOON = 0.05  # seconds until an interruption that was lost is repeated


class Session:
    """What a command has to know about the program that runs it."""

    def __init__(self) -> None:
        self.written: list[Path] = []
        self.interrupted = False
        self.interrupted_code = 128 + signal.SIGINT  # as shells report it
        self._gently = False

    def wrote(self, path: Path) -> None:
        """Record a finished file and say so."""
        self.written.append(path)
        complain(f"wrote {path}")

    def kept(self) -> str:
        """What there is after an interruption, in words."""
        return "kept " + ", ".join(map(str, self.written)) if self.written else "nothing was written"

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take notice of Ctrl-C and of being asked to end, unless whoever started the program had that ignored.

        As a shell has Ctrl-C for `&`.
        """
        usual: dict[signal.Signals, Any] = {
            signal.SIGINT: signal.default_int_handler,
            signal.SIGTERM: signal.SIG_DFL,
        }
        is_main = threading.current_thread() is threading.main_thread()
        ours = [
            number for number, handler in usual.items() if is_main and signal.getsignal(number) is handler
        ]
        for number in ours:
            signal.signal(number, self._interrupt)
        unraisable, over = sys.unraisablehook, threading.Event()

        def repeat() -> None:
            if not over.is_set():
                _thread.interrupt_main(signal.Signals(self.interrupted_code - 128))

        def raise_again(lost: sys.UnraisableHookArgs) -> None:
            # What is raised where the compiler calls back goes no further, so it is raised once more after that.
            if isinstance(lost.exc_value, KeyboardInterrupt) and ours and not over.is_set():
                again = threading.Timer(_SOON, repeat)
                again.daemon = True
                again.start()
            else:
                unraisable(lost)

        sys.unraisablehook = raise_again
        try:
            yield
        finally:
            over.set()
            sys.unraisablehook = unraisable
            for number in ours:
                signal.signal(number, usual[number])

    @contextmanager
    def stopping_gently(self) -> Iterator[None]:
        """Where Ctrl-C waits for `stop_if_asked`, so that it hits no compiled code and no result is lost.

        An exception that is raised in the middle of a compiled call or of the compiler comes out as an error of
        these. A second Ctrl-C does not wait.
        """
        self._gently = True
        try:
            yield
        finally:
            self._gently = False

    def stop_if_asked(self) -> None:
        """Raise KeyboardInterrupt if a signal is waiting, or was taken by somebody for an error of another kind."""
        if self.interrupted:
            raise KeyboardInterrupt

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        first, self.interrupted = not self.interrupted, True
        self.interrupted_code = 128 + number
        if first and self._gently:
            complain("stopping at the next step; Ctrl-C once more stops at once")
        else:
            raise KeyboardInterrupt
