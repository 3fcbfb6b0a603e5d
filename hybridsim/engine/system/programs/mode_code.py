"""What machine code of one vector of modes is written from, and where it is kept on disk."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.series.emit_bounds import Given
from hybridsim.engine.series.emit_series import ModeTape
from hybridsim.engine.series.optimise import PAIRED, arguments_of
from hybridsim.engine.series.tape import EXP, LESS, MUL, SELECT, SINHCOSH, SQRT, TANGENT
from hybridsim.engine.series.vanishing_kinds import (
    EXPONENTIAL,
    HYPERBOLIC,
    KINDS,
    MOST_POWER,
    ROOT,
    register_of,
)

if TYPE_CHECKING:
    from hybridsim.engine.system.system import System

_KIND = {EXP: EXPONENTIAL, SINHCOSH: HYPERBOLIC, TANGENT: HYPERBOLIC, SQRT: ROOT}
KNOWN = 32  # times without it that make it worth reading machine code (2 ms): each costs a microsecond
WORTH = 2000  # times after which there are likely to be as many more as pay for compiling (0.1 s)
NEVER = -(2**62)  # in place of these times: there is code, or there will be none


def mode_tape(system: System, z: np.ndarray) -> ModeTape:
    """The tape of a vector of modes, with its active guards."""
    tape, lean = system.code.data["tape"], system.lean_tape(z)
    return ModeTape(
        rows=_rows(lean.rows),
        high=tuple(system.high_rows(z)),
        time=tape["time"],
        states=tuple(tape["states"]),
        rates=tuple(lean.derivatives.tolist()),
        guards=tuple(lean.guards[np.flatnonzero(system.active(z))].tolist()),
        fading=tuple(register_of(number) for number in fading(system, z)),
        holding=frozenset(_holding(system, z)),
    )


def _holding(system: System, z: np.ndarray) -> Iterator[int]:
    """The registers of pin > 0: so it is but where states are looked at as they are, outside of a mode."""
    tape = system.code.data["tape"]
    zeros = [register for register, value, _ in tape["constants"] if value == 0.0]
    pins = [register for register, source in tape["parameters"] if source == system.layout.pin_at]
    for op, a, b, _, out in constant_rows(system, z):
        if op == LESS and a in zeros and b in pins:
            yield out


def computed_rates(system: System, z: np.ndarray) -> list[bool]:
    """Whether the rate of a state is worked out as time goes on: it is no constant, no other state, and not held."""
    tape, sure = system.lean_tape(z), frozenset(_holding(system, z))
    rows = _rows(tape.rows)
    chosen = {out: b for op, a, b, _, out in rows if op == SELECT and a in sure}
    results = {out + k for op, _, _, _, out in rows for k in range(2 if op in PAIRED else 1)}
    found = []
    for register in tape.derivatives.tolist():
        while register in chosen:
            register = chosen[register]
        found.append(register in results)
    return found


def fading(system: System, z: np.ndarray) -> list[int]:
    """Arguments of what may fade, as numbers of register, power and kind.

    See `hybridsim.engine.roots.vanishing_terms`.
    """
    rows = _rows(system.lean_tape(z).rows)
    found: dict[tuple[int, int], int] = {}
    for op, a, b, _, out in rows:
        if _may_fade(op, b):
            power = 1 if op == SQRT else _highest_power(rows, out, 2 if op in PAIRED else 1)
            found[a, _KIND[op]] = max(found.get((a, _KIND[op]), 1), power)
    return [KINDS * (MOST_POWER * a + power - 1) + kind for (a, kind), power in found.items()]


def _highest_power(rows: Iterable[tuple[int, ...]], first: int, count: int) -> int:
    """To which power so many registers from the first on are raised by products, at most; by quotients the larger."""
    powers = dict.fromkeys(range(first, first + count), 1)
    for row in rows:
        op, out = row[0], row[4]
        if out in powers:
            continue
        known = [powers.get(a, 0) for a in arguments_of(row)]
        power = sum(known) if op == MUL else max(known, default=0)
        for k in range(2 if op in PAIRED else 1):
            powers[out + k] = min(power, MOST_POWER)
    return max(powers.values())


def most_fading(system: System) -> int:
    """How many these are at most, whatever the modes."""
    parts = system.code.data["tape"]["parts"]
    return sum(_may_fade(op, b) for _, branches in parts for rows in branches for op, _, b, *_ in rows)


def _may_fade(op: int, b: int) -> bool:
    return op in _KIND and (op != TANGENT or b != 0)


def constant_rows(system: System, z: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """The rows of it that are run once a segment."""
    return _rows(system.lean_tape(z).constant_rows)


def given(system: System) -> Given:
    """Where the constants of a system's tapes come from."""
    tape = system.code.data["tape"]
    return Given(
        {register: (value, error) for register, value, error in tape["constants"]},
        dict(tape["parameters"]),
        frozenset(system.registers.inputs.phases.tolist()),
    )


def kept(system: System, kind: str, z: np.ndarray) -> Path | None:
    """Where code of a kind is kept, if it is; the name of the machine comes behind it."""
    file = getattr(system.code.module, "__file__", None)
    if file is None:
        return None
    path = Path(file)
    return path.with_name(f"{path.stem}.{kind}.{hashlib.sha256(z.tobytes()).hexdigest()[:12]}")


def _rows(rows: np.ndarray) -> tuple[tuple[int, ...], ...]:
    return tuple(map(tuple, rows.tolist()))
