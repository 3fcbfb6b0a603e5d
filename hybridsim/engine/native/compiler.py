"""This module sets the options of the compiler for kernels, and measures the compile time.

Without the compiler (``HYBRIDSIM_JIT=0``) all kernels run as plain Python.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from hybridsim.engine.native.inner_parts import find_part, is_complete
from hybridsim.engine.native.notices import announce_engine, announce_part

ENABLED = os.environ.get("HYBRIDSIM_JIT", "1") != "0"
if ENABLED:
    import numba

    ENABLED = not numba.config.DISABLE_JIT and is_complete()  # NUMBA_DISABLE_JIT=1 turns all compilation off

_NOTICED = 1.0  # seconds of compilation after which a message is printed


def announce_compilation() -> None:
    """Print on stderr, once for each cache, that the engine is being compiled."""
    if ENABLED:
        announce_engine()


if ENABLED:
    from llvmlite import binding

    cpu_target = find_part(
        "numba.core.registry", "cpu_target", "kernels are compiled with numba's own settings, and run slower"
    )
    event = find_part("numba.core", "event", "compiling takes longer, and its time is not measured")
    compiler_lock = find_part(
        "numba.core", "compiler_lock", "a process forked while another thread compiles may wait indefinitely"
    )
    _Listener: Any = getattr(event, "Listener", object)
    _lock: Any = getattr(compiler_lock, "global_compiler_lock", None) or threading.RLock()

    class _Spent(threading.local):
        """The compile time of a thread: current depth, start of the current compilation, earlier seconds."""

        depth, since, spent = 0, 0.0, 0.0

    class _Compiling(_Listener):
        """Measures the seconds that each thread spends on compiling, and sets the optimisation level.

        Compilation holds numba's lock, so the global settings can be changed meanwhile.
        """

        def __init__(self) -> None:
            self.of = _Spent()
            self.others: list[Any] = []  # settings to restore, one entry per nested compilation

        def on_start(self, event: Any) -> None:
            """Record that a kernel, or a kernel that it calls, starts to compile."""
            of = self.of
            if event.kind == _COMPILING:  # not in the cache
                compiled = event.data["dispatcher"].py_func.__module__ or ""
                so_far = of.spent + (time.perf_counter() - of.since if of.depth else 0.0)
                self.others.append(_settings())
                if compiled.startswith("hybridsim."):
                    _set(_ours())
                    if so_far > _NOTICED:
                        announce_part(compiled)
                return
            if of.depth == 0:
                of.since = time.perf_counter()
            of.depth += 1

        def on_end(self, event: Any) -> None:
            """Record that a kernel is compiled."""
            of = self.of
            if event.kind == _COMPILING:
                _set(self.others.pop())
                return
            if of.depth == 0:
                return
            of.depth -= 1
            if of.depth == 0:
                of.spent += time.perf_counter() - of.since

    _LEVEL = 2  # optimisation level of LLVM

    def _settings() -> tuple[Any, Any]:
        """Return LLVM's optimisation level and target machine, or None if numba does not provide them."""
        return numba.config.OPT, getattr(_code_generator(), "_tm", None)

    def _code_generator() -> Any:
        return None if cpu_target is None else cpu_target.target_context.codegen()

    def _set(settings: tuple[Any, Any]) -> None:
        numba.config.OPT, machine = settings
        if machine is not None:
            _code_generator()._tm = machine

    @cache
    def _plain_machine() -> Any:
        """Return LLVM's target machine with a generic cost model, or None if numba does not provide it."""
        features = getattr(_code_generator(), "_tm_features", None)
        if features is None or _settings()[1] is None:
            return None
        cpu = "x86-64" if binding.get_default_triple().startswith("x86_64") else "generic"
        return binding.Target.from_default_triple().create_target_machine(
            cpu=cpu, features=features, jit=True
        )

    def _ours() -> tuple[Any, Any]:
        """Return hybridsim's compiler settings for kernels.

        At level 2 the engine compiles in seven eighths of the time of numba's default, level 3, and runs as
        fast. For some machines (AMD's Zen 4 and 5) LLVM unrolls loops of unknown length a dozen times. Our
        loops have two or three turns, and `exact` takes a fifth longer with such unrolling.
        """
        return min(numba.config.OPT, type(numba.config.OPT)(_LEVEL)), _plain_machine()

    _COMPILING, _LOCKED = "numba:compile", "numba:compiler_lock"  # compilation happens while the lock is held
    _compiling = _Compiling()
    for _kind in (_COMPILING, _LOCKED) if event else ():
        event.register(_kind, _compiling)

    def _free_in_child() -> None:
        """Release numba's lock in a child process that was forked while another thread was compiling."""
        if hasattr(_lock, "_lock"):
            _lock._lock = threading.RLock()

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_free_in_child)

    def seconds_compiling() -> float:
        """Return the seconds that this thread has spent on compiling or loading kernels."""
        return _compiling.of.spent

    @contextmanager
    def with_our_settings() -> Iterator[None]:
        """Hold the lock of the compiler, and use hybridsim's settings meanwhile."""
        with _lock:
            others = _settings()
            _set(_ours())
            try:
                yield
            finally:
                _set(others)

else:

    def seconds_compiling() -> float:
        """Return zero, because nothing is compiled."""
        return 0.0
