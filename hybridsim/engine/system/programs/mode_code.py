"""This module prepares and compiles machine code for one combination of modes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.native.llvm_text import TooLong
from hybridsim.engine.native.model_functions import compile_series, is_stored
from hybridsim.engine.series.emit_bounds import ConstantSources
from hybridsim.engine.series.emit_series import ModeTape
from hybridsim.engine.series.operations import EXP, LESS, MUL, SELECT, SINHCOSH, SQRT, TANGENT
from hybridsim.engine.series.optimise import PAIRED, arguments_of
from hybridsim.engine.series.vanishing_kinds import (
    EXPONENTIAL,
    HYPERBOLIC,
    KINDS,
    MAX_POWER,
    ROOT,
    register_of,
)
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_KIND = {EXP: EXPONENTIAL, SINHCOSH: HYPERBOLIC, TANGENT: HYPERBOLIC, SQRT: ROOT}
KNOWN = 32  # misses after which machine code is read from disk (2 ms); each miss costs about 1 us
WORTH = 2000  # misses after which compiling (0.1 s) is likely to pay
NEVER = -(2**62)  # count of misses if code exists, or cannot be made


def mode_tape(system: System, z: np.ndarray) -> ModeTape:
    """Return the instruction tape of one combination of modes with its active guards."""
    tape, optimised = system.code.data["tape"], system.optimised_tape(z)
    return ModeTape(
        rows=_rows(optimised.rows),
        high=tuple(system.high_rows(z)),
        time=tape["time"],
        states=tuple(tape["states"]),
        rates=tuple(optimised.derivatives.tolist()),
        guards=tuple(optimised.guards[np.flatnonzero(system.active(z))].tolist()),
        fading=tuple(register_of(number) for number in fading(system, z)),
        holding=frozenset(_holding(system, z)),
    )


def _holding(system: System, z: np.ndarray) -> Iterator[int]:
    """Yield the registers of the condition "held states are computed from constraints", which is always true here."""
    tape = system.code.data["tape"]
    zeros = [register for register, value, _ in tape["constants"] if value == 0.0]
    pins = [register for register, source in tape["parameters"] if source == system.layout.pin_at]
    rows = system.optimised_tape(z).constant_rows
    for _, a, b, _, out in rows[rows[:, 0] == LESS].tolist():
        if a in zeros and b in pins:
            yield out


def computed_rates(system: System, z: np.ndarray) -> list[bool]:
    """Return a mask of the states whose rates an instruction computes; other rates are constant, held or copied."""
    tape, sure = system.optimised_tape(z), frozenset(_holding(system, z))
    rows = tape.rows
    chosen = {out: b for _, a, b, _, out in rows[rows[:, 0] == SELECT].tolist() if a in sure}
    results = {*rows[:, 4].tolist(), *(rows[np.isin(rows[:, 0], PAIRED), 4] + 1).tolist()}
    found = []
    for register in tape.derivatives.tolist():
        while register in chosen:
            register = chosen[register]
        found.append(register in results)
    return found


def fading(system: System, z: np.ndarray) -> list[int]:
    """Return codes for functions that may be below rounding in a Taylor series, such as exponentials.

    See `hybridsim.engine.roots.vanishing_terms`.
    """
    tape = system.optimised_tape(z)
    if not np.isin(tape.rows[:, 0], list(_KIND)).any():
        return []
    rows = _rows(tape.rows)
    found: dict[tuple[int, int], int] = {}
    for op, a, b, _, out in rows:
        if _may_fade(op, b):
            power = 1 if op == SQRT else _highest_power(rows, out, 2 if op in PAIRED else 1)
            found[a, _KIND[op]] = max(found.get((a, _KIND[op]), 1), power)
    return [KINDS * (MAX_POWER * a + power - 1) + kind for (a, kind), power in found.items()]


def _highest_power(rows: Iterable[tuple[int, ...]], first: int, count: int) -> int:
    """Return the highest power of some registers that occurs in products."""
    powers = dict.fromkeys(range(first, first + count), 1)
    for row in rows:
        op, out = row[0], row[4]
        if out in powers:
            continue
        known = [powers.get(a, 0) for a in arguments_of(row)]
        power = sum(known) if op == MUL else max(known, default=0)
        for k in range(2 if op in PAIRED else 1):
            powers[out + k] = min(power, MAX_POWER)
    return max(powers.values())


def most_fading(system: System) -> int:
    """Return an upper bound of the number of functions that may fall below rounding in one combination of modes."""
    parts = system.code.data["tape"]["parts"]
    return sum(_may_fade(op, b) for _, branches in parts for rows in branches for op, _, b, *_ in rows)


def _may_fade(op: int, b: int) -> bool:
    return op in _KIND and (op != TANGENT or b != 0)


def constant_rows(system: System, z: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Return the instructions of a tape that are executed only once per segment."""
    return _rows(system.optimised_tape(z).constant_rows)


def constant_sources(system: System) -> ConstantSources:
    """Return the sources of the constants of the instruction tapes of a system."""
    tape = system.code.data["tape"]
    return ConstantSources(
        {register: (value, error) for register, value, error in tape["constants"]},
        dict(tape["parameters"]),
        frozenset(system.registers.inputs.phases.tolist()),
    )


def code_path(system: System, kind: str, z: np.ndarray) -> Path | None:
    """Return the path of stored code without the file extension, or None if there is no cache."""
    file = getattr(system.code.module, "__file__", None)
    if file is None:
        return None
    path = Path(file)
    return path.with_name(f"{path.stem}.{kind}.{hashlib.sha256(z.tobytes()).hexdigest()[:12]}")


def _rows(rows: np.ndarray) -> tuple[tuple[int, ...], ...]:
    return tuple(map(tuple, rows.tolist()))


class ModeCompiler:
    """Compiles functions of one kind for combinations of modes.

    Parameters
    ----------
    kind : name of the files in which the code is stored.
    functions : names of the functions, which end with _0 in a module.
    text : returns the source of a module for a tape and its modes, or None if it cannot be written.
    """

    def __init__(
        self,
        system: System,
        kind: str,
        functions: tuple[str, ...],
        text: Callable[[ModeTape, np.ndarray], Callable[[], str] | None],
    ) -> None:
        self.system, self.kind, self.functions, self._text = system, kind, functions, text
        self._lock = SharedLock()
        self._engines: list[Any] = []  # references that keep the code alive
        self._absent: set[int] = set()  # modes whose code is not on disk

    def prepare(self, modes: np.ndarray, lacked: np.ndarray, put: Callable[[int, list[int]], None]) -> None:
        """Compile code for modes in which many steps were taken, and pass the addresses to `put`."""
        counts = lacked.tolist()
        if not ENABLED or max(counts, default=0) < KNOWN:
            return
        for k, count in enumerate(counts):
            if count < (WORTH if k in self._absent else KNOWN):
                continue
            place = code_path(self.system, self.kind, modes[k])
            if count < WORTH and not is_stored(place):
                self._absent.add(k)
                continue
            with self._lock:
                if lacked[k] >= KNOWN:  # otherwise another thread was first
                    lacked[k] = NEVER
                    self._make(modes[k], place, partial(put, k))

    def _make(self, z: np.ndarray, place: Path | None, put: Callable[[list[int]], None]) -> None:
        text = self._text(mode_tape(self.system, z), z)
        if text is not None:
            with suppress(TooLong):  # too long to compile; the interpreter stays in use
                addresses, engine = compile_series(place, [f"{name}_0" for name in self.functions], text)
                self._engines.append(engine)
                put(addresses)
