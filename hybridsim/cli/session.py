"""This module contains the state of one run of the program: written files, and requests to stop."""

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

_SOON = 0.05  # seconds until a lost interruption is repeated


class Session:
    """The state that a command shares with the function that calls the command."""

    def __init__(self) -> None:
        self.written: list[Path] = []
        self.interrupted = False
        self.interrupted_code = 128 + signal.SIGINT  # as shells report it
        self._gently = False

    def wrote(self, path: Path) -> None:
        """Record a finished file and report it."""
        self.written.append(path)
        complain(f"wrote {path}")

    def summary_of_written(self) -> str:
        """Return a text that lists the files written before an interruption."""
        return "kept " + ", ".join(map(str, self.written)) if self.written else "nothing was written"

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Handle Ctrl-C and SIGTERM during a block, but not signals that the parent process ignores."""
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
            # Python discards an exception raised inside a callback of the compiler, so raise it again later
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
        """Delay Ctrl-C until the next `stop_if_asked`, so that it does not interrupt compiled code.

        An exception raised inside a compiled call or inside the compiler would surface as an unrelated error. A second
        Ctrl-C interrupts immediately.
        """
        self._gently = True
        try:
            yield
        finally:
            self._gently = False

    def stop_if_asked(self) -> None:
        """Raise KeyboardInterrupt if a signal was received, even if another exception came later."""
        if self.interrupted:
            raise KeyboardInterrupt

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        first, self.interrupted = not self.interrupted, True
        self.interrupted_code = 128 + number
        if first and self._gently:
            complain("stopping at the next step; press Ctrl-C again to stop immediately")
        else:
            raise KeyboardInterrupt
