"""What compiled loops hold of an event: as it was located, room to settle it in, the model's functions it needs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, inlined, merged
from hybridsim.engine.native.simd_products import vector_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import ORDER

MOST = 3  # components at their surfaces at once: more make too many candidates to try in passing
FIRED, DISCRETE, DISCRETE_AT, ROW = range(4)  # of `Work.whole`
AT, AT_ERROR, SPREAD = range(3)  # of `Work.real`
SETTLE, LEAP, SERIES = range(3)  # of `Work.reached`
NOBODY = -1  # in place of the guard that fired


class Functions(NamedTuple):
    """Addresses of a model's functions; 0 for those that it does not need."""

    flow: Any
    project: Any
    jumps: Any
    choose: Any
    reset: Any


class Before(NamedTuple):
    """An event as it was located: local time and its error, state, its error bounds, run-time vector, modes."""

    s: float
    s_error: float
    x: np.ndarray
    x_error: np.ndarray
    p: np.ndarray
    z: np.ndarray


class Work(NamedTuple):
    """Room for one event: series with bounds (registers, 4), judged (2, guards, 4): those of guards and their bounds,
    what holds after it, candidates.

    functions (5,): those of `Functions`. reached (3,): addresses of kernels: the one that settles it, that of a leap,
    and the interpreter of the series of guards. whole, real: what the places named FIRED, AT and so on say; SPREAD: how
    many of their bounds guards that are zero at one instant may be from zero, by the rounding of steps. y, y_error
    (n,): the state at the event, slopes (n,) of the flow there. x_after, z_after, p_after: what follows it; bounds of
    x_after take the place of the slopes. factors, w, w_error: functions of time of linear modes, which are to hold at
    the event when it is settled; sizes, w_sizes: of states and of these. sides, orders, floors (G,): of the guards just
    after it. The last ones have a row for each joint candidate.
    """

    functions: np.ndarray
    reached: np.ndarray
    whole: np.ndarray
    real: np.ndarray
    y: np.ndarray
    y_error: np.ndarray
    slopes: np.ndarray
    x_after: np.ndarray
    z_after: np.ndarray
    p_after: np.ndarray
    V: np.ndarray
    E: np.ndarray
    factors: np.ndarray
    w: np.ndarray
    w_error: np.ndarray
    sizes: np.ndarray
    w_sizes: np.ndarray
    judged: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray
    on_surface: np.ndarray
    jumps: np.ndarray
    out: np.ndarray
    everything: np.ndarray
    members: np.ndarray
    current: np.ndarray
    holds: np.ndarray
    trial: np.ndarray
    asked: np.ndarray
    candidates: np.ndarray
    ranks: np.ndarray
    verdicts: np.ndarray
    smooth: np.ndarray
    all_sides: np.ndarray
    all_orders: np.ndarray
    all_floors: np.ndarray


@inlined
def called_by(work: Any) -> Any:
    """The functions that the loop calls which a work space is for."""
    f = work.functions
    return Functions(f[0], f[1], f[2], f[3], f[4])


@merged
def located(state: Any, work: Any) -> Before:
    """The event in a work space; state: at the beginning of the segment that it ends."""
    return Before(work.real[AT], work.real[AT_ERROR], work.y, work.y_error, state.p, state.z)


def work_space(system: Any, atoms: int = 0, monomials: int = 0) -> Work:
    """Room for the events of one system; for linear modes also for their functions of time."""
    guards, count = system.guard_count, len(system.automata)
    registers = system.registers.count
    together = min(MOST, len(system.surface_of))
    joint = 3**together

    def numbers(*shape: int) -> np.ndarray:
        return np.zeros(shape, dtype=np.int64)

    def flags(size: int) -> np.ndarray:
        return np.zeros(size, dtype=np.bool_)

    work: Work = packed(
        Work(
            functions=np.array(functions_of(system), dtype=np.int64 if ENABLED else object),
            reached=numbers(3),
            whole=np.array([-1, len(system.model.discrete), system.layout.discrete_at, -1], dtype=np.int64),
            real=np.zeros(3),
            **{name: vector_of(system.n) for name in ("y", "y_error", "slopes", "x_after")},
            z_after=numbers(count),
            p_after=np.empty(system.layout.size),
            V=np.empty((registers, ORDER + 1)),
            E=np.empty((registers, ORDER + 1)),
            factors=_atoms(atoms),
            w=vector_of(monomials),
            w_error=vector_of(monomials),
            sizes=vector_of(system.n),
            w_sizes=vector_of(monomials),
            judged=np.empty((2, guards, ORDER + 1)),
            sides=np.ones(guards, dtype=np.int64),
            orders=numbers(guards),
            floors=np.zeros(guards),
            on_surface=flags(count),
            jumps=np.zeros(2 * max(len(system.surface_of), 1)),
            out=np.zeros(max(system.n + len(system.model.discrete), 1)),
            everything=np.arange(count, dtype=np.int64),
            members=numbers(together),
            current=numbers(together),
            holds=numbers(together),
            trial=numbers(count),
            asked=numbers(count + 3),
            candidates=numbers(joint, together),
            ranks=numbers(joint),
            verdicts=numbers(joint),
            smooth=flags(joint),
            all_sides=numbers(joint, guards),
            all_orders=numbers(joint, guards),
            all_floors=np.zeros((joint, guards)),
        )
    )
    return work


def _atoms(count: int) -> np.ndarray:
    """Room for the values of so many atoms and their errors, and one, which has none."""
    factors = np.zeros((2 * count + 1, 2))
    factors[-1, 0] = 1.0
    return factors


def functions_of(system: Any) -> Functions:
    """The functions that a compiled loop calls."""
    return system.code.shared("loop functions", lambda: _functions(system))


def _functions(system: Any) -> Functions:
    has_surface = any(a.has_surface for a in system.automata)
    has_choice = any(not a.has_surface for a in system.automata)
    none: Any = system.address("flow")  # never called
    return Functions(
        system.address("flow"),
        system.address("project") if has_surface else none,
        system.address("jumps") if has_surface else none,
        system.address("choose") if has_choice else none,
        system.address("reset") if has_choice else none,
    )
