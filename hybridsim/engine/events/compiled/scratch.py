"""Scratch arrays of compiled loops for one event: the event, work arrays, and model functions."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.choice.verdict import NO_SIDE
from hybridsim.engine.native.kernels import ENABLED, inline_always, inlined
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.simd.products import vector_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.modes_index import find_modes

# Largest number of components at their surfaces at once; more have too many candidates for compiled loops.
MAX_JOINT_COMPONENTS = 3
FIRED, DISCRETE, DISCRETE_AT, ROW, LACKS_TAPE = range(5)  # indices of `EventScratch.int_slots`
AT, AT_ERROR, SPREAD = range(3)  # indices of `EventScratch.float_slots`
RESOLVE, EVENT_LOOP, SERIES, KNOWN_TIME, IMPACT = range(5)  # indices of `EventScratch.entry_points`
NOBODY = -1  # no guard fired


class Functions(NamedTuple):
    """The addresses of the functions of a model; unused functions are never called."""

    flow: Any
    project: Any
    jumps: Any
    choose: Any
    reset: Any
    impulses: Any
    restitutions: Any
    surfaces: Any
    gap_slopes: Any


class LocatedEvent(NamedTuple):
    """A located event: its time, states and modes, with error bounds."""

    s: float  # local time
    s_error: float  # its error bound
    x: np.ndarray  # states (n,)
    x_error: np.ndarray  # their error bounds (n,)
    p: np.ndarray  # run-time vector
    z: np.ndarray  # modes (C,)


class EventScratch(NamedTuple):
    """Work arrays for resolving one event.

    The last ones, from `candidates` on, have a row for each joint candidate.
    """

    functions: np.ndarray  # addresses (9,): `Functions`
    entry_points: np.ndarray  # addresses (5,) of kernels at RESOLVE, EVENT_LOOP, SERIES, KNOWN_TIME, IMPACT
    int_slots: np.ndarray  # integers at FIRED, DISCRETE, DISCRETE_AT, ROW, LACKS_TAPE
    missing: np.ndarray  # modes (C,) that have no instruction tape yet, if LACKS_TAPE is 1
    # numbers at AT, AT_ERROR, SPREAD (bounds by which simultaneous guards may be from zero)
    float_slots: np.ndarray
    y: np.ndarray  # states (n,) at the event
    y_error: np.ndarray  # their error bounds (n,)
    slopes: np.ndarray  # rates (n,) at the event, then error bounds of x_after
    x_after: np.ndarray  # states (n,) after the event
    size: np.ndarray  # size (1,) of the point x_after of linear modes
    p_after: np.ndarray  # run-time vector after the event
    V: np.ndarray  # Taylor coefficients (registers, 4)
    E: np.ndarray  # their error bounds (registers, 4)
    factors: np.ndarray  # functions of time of linear modes, with errors
    w: np.ndarray  # monomials of these functions at the event
    w_error: np.ndarray  # their error bounds
    sizes: np.ndarray  # sizes (n,) of the states
    w_sizes: np.ndarray  # sizes of the monomials
    product: np.ndarray  # Taylor coefficients (2, 4) of a product of states, and their error bounds
    before: np.ndarray  # this and the next six, as well as the last three: see `JudgedEvent`
    now: np.ndarray
    is_zero: np.ndarray
    on_surface: np.ndarray
    released_to: np.ndarray
    judged: np.ndarray
    decreed: np.ndarray
    jumps: np.ndarray
    out: np.ndarray
    everything: np.ndarray
    members: np.ndarray
    current: np.ndarray
    holds: np.ndarray
    keeps: np.ndarray
    trial: np.ndarray
    asked: np.ndarray
    candidates: np.ndarray
    ranks: np.ndarray
    all_sides: np.ndarray
    all_orders: np.ndarray
    all_floors: np.ndarray


@inlined
def called_by(work: Any) -> Any:
    """Return the addresses of the model's functions, read from the array in a work space."""
    f = work.functions
    return Functions(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8])


@inline_always
def located(state: Any, work: Any) -> LocatedEvent:
    """Return the event in a work space; `state` is the state at the start of the segment."""
    return LocatedEvent(
        work.float_slots[AT], work.float_slots[AT_ERROR], work.y, work.y_error, state.p, state.z
    )


@inlined
def row_of(tapes: Any, z: Any, work: Any) -> int:
    """Return the row of a combination of modes in the instruction tapes.

    If there is none, note that they are missing, and return -1. The caller must then decide nothing: the host adds
    the tape and calls again.
    """
    k = find_modes(tapes, z)
    if k < 0:
        work.int_slots[LACKS_TAPE] = 1
        put(z, work.missing)
    return k


@inlined
def note_or_restore(counts: Any, is_rejected: bool, work: Any) -> None:
    """Save the counters in the second half of their array, or restore them if the segment was rejected.

    Restore it if the segment is rejected because its event needs modes without an instruction tape. The segment is then
    followed again.
    """
    half = counts.shape[0] // 2
    for i in range(half):
        if not is_rejected:
            counts[half + i] = counts[i]
        elif work.int_slots[LACKS_TAPE] != 0:
            counts[i] = counts[half + i]


def work_space(system: Any, atoms: int = 0, monomials: int = 0) -> EventScratch:
    """Return work arrays for the events of a system; linear modes need additional arrays."""
    guards, count = system.guard_count, len(system.automata)
    registers = system.registers.count
    together = min(MAX_JOINT_COMPONENTS, len(system.surface_of))
    joint = 3**together

    def numbers(*shape: int) -> np.ndarray:
        return np.zeros(shape, dtype=np.int64)

    def flags(size: int) -> np.ndarray:
        return np.zeros(size, dtype=np.bool_)

    work: EventScratch = packed(
        EventScratch(
            functions=np.array(functions_of(system), dtype=np.int64 if ENABLED else object),
            entry_points=numbers(5),
            int_slots=np.array(
                [-1, len(system.model.discrete), system.layout.discrete_at, -1, 0], dtype=np.int64
            ),
            missing=numbers(count),
            float_slots=np.zeros(3),
            **{name: vector_of(system.n) for name in ("y", "y_error", "slopes", "x_after")},
            size=np.zeros(1),
            p_after=np.empty(system.layout.size),
            V=np.empty((registers, ORDER + 1)),
            E=np.empty((registers, ORDER + 1)),
            factors=_atoms(atoms),
            w=vector_of(monomials),
            w_error=vector_of(monomials),
            sizes=vector_of(system.n),
            w_sizes=vector_of(monomials),
            product=np.zeros((2, ORDER + 1)),
            before=numbers(count),
            now=numbers(count),
            is_zero=flags(guards),
            on_surface=flags(count),
            released_to=np.full(count, NO_SIDE, dtype=np.int64),
            judged=np.empty((2, guards, ORDER + 1)),
            decreed=numbers(guards),
            jumps=np.zeros(2 * max(len(system.surface_of), 1)),
            out=np.zeros(max(system.n + len(system.model.discrete), size_for_impacts(system), 1)),
            everything=np.arange(count, dtype=np.int64),
            members=numbers(together),
            current=numbers(together),
            holds=numbers(together),
            keeps=flags(together),
            trial=numbers(count),
            asked=numbers(count + 3),
            candidates=numbers(joint, together),
            ranks=numbers(joint),
            all_sides=numbers(joint, guards),
            all_orders=numbers(joint, guards),
            all_floors=np.zeros((joint, guards)),
        )
    )
    return work


def size_for_impacts(system: Any) -> int:
    """Return the size of the outputs of `impulses` and `gap_slopes` together, or 0 without unilateral contacts."""
    surfaces = len(system.surface_of)
    return surfaces * (3 * system.n + 2 * surfaces) if system.is_unilateral.any() else 0


def _atoms(count: int) -> np.ndarray:
    """Return an array for the values and errors of `count` functions of time, and of the constant 1."""
    factors = np.zeros((2 * count + 1, 2))
    factors[-1, 0] = 1.0
    return factors


@per_structure
def functions_of(system: Any) -> Functions:
    """Return the addresses of the functions that a compiled loop calls."""
    has_surface = any(a.has_surface for a in system.automata)
    has_choice = any(not a.has_surface for a in system.automata)
    has_impact = bool(system.is_unilateral.any())
    has_curved_gap = bool(system.is_unilateral[list(system.projected)].any())
    none: Any = system.address("flow")  # never called
    return Functions(
        system.address("flow"),
        system.address("project") if has_surface else none,
        system.address("jumps") if has_surface else none,
        system.address("choose") if has_choice else none,
        system.address("reset") if has_choice or system.model.schedules else none,
        *(system.address(name) if has_impact else none for name in ("impulses", "restitutions")),
        *(system.address(name) if has_curved_gap else none for name in ("surfaces", "gap_slopes")),
    )
