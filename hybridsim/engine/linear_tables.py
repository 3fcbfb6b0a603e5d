"""Linear modes as arrays for compiled loops: functions of time, series of guards, block diagonal flows."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.jets import ORDER, UNIT
from hybridsim.engine.linear_form import Atoms, Form, LinearReader, Monomial, NotLinear
from hybridsim.engine.modal import Modal, modal
from hybridsim.engine.packs import packed
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.errors import UsageError

TERMS = 16  # of the series that bounds a guard from below
FARTHEST = 8.0  # in units of the fastest rate: the bound by so few terms ends before
_KEPT = 64  # tables of a structure, one for each set of parameter values
_ROUNDINGS = (
    8.0  # of a coefficient when it is read off the tape: a chain of that many operations is a long one
)


class LinearTables(NamedTuple):
    """One row for each vector of modes, in the order of the shelf; y = (states, monomials) has n + M entries.

    kinds, rates, offsets (A,), term_start (A + 1,), sources, weights: the atoms. factor_start (M + 1,), factors: the
    monomials, 2*atom + part. phases (2,): the sources in p that are angles known to rounding only.
    series (K, G, n + M, 4): Taylor coefficients of the guards; roundings likewise: bounds of their rounding errors for
    y of size 1. counts (K,), values (K, J), upper (K, J, J), ends (K, J): the flow in modal coordinates; basis (K, n,
    J), inverse (K, J, n + M): what leads there and back. terms (K, G, J, 2, TERMS): Taylor coefficients of the guards
    in modal coordinates, factors of their real and imaginary parts; sizes, rests (K, G, J): bounds of the guard and of
    the first coefficient left out; farthest, grown (K, G): how far ahead the latter holds, but for a factor. slopes (K,
    n, n + M): rates of the states. waves (K, G): the modal coordinate that turns without damping, where a guard sees
    one such and else constants; -1 otherwise.
    """

    kinds: np.ndarray
    rates: np.ndarray
    offsets: np.ndarray
    term_start: np.ndarray
    sources: np.ndarray
    weights: np.ndarray
    factor_start: np.ndarray
    factors: np.ndarray
    phases: np.ndarray
    series: np.ndarray
    roundings: np.ndarray
    counts: np.ndarray
    values: np.ndarray
    upper: np.ndarray
    ends: np.ndarray
    basis: np.ndarray
    inverse: np.ndarray
    terms: np.ndarray
    sizes: np.ndarray
    rests: np.ndarray
    farthest: np.ndarray
    grown: np.ndarray
    slopes: np.ndarray
    waves: np.ndarray


class LinearMode:
    """Forms of the rates and active guards of one vector of modes; raises NotLinear with what is in the way."""

    def __init__(self, system: System, atoms: Atoms, z: np.ndarray, p: np.ndarray) -> None:
        tape, layout = system.code.data["tape"], system.layout
        varying = range(layout.discrete_at, layout.size)
        parameters = [(r, s) for r, s in tape["parameters"] if s != layout.pin_at]
        constants = [(r, v) for r, v, _ in tape["constants"]]
        constants += [(r, 1.0) for r, s in tape["parameters"] if s == layout.pin_at]
        reader = LinearReader(atoms, tape["time"], tape["states"], constants, parameters, varying, p)
        reader.read(system.mode_rows(z))
        self.rates: list[Form] = []
        for name, register in zip(system.names, tape["derivatives"], strict=True):
            self.rates.append(_named(reader, register, f"the rate of {name}"))
        self.guards: dict[int, Form] = {}
        for g in map(int, np.flatnonzero(system.active(z))):
            self.guards[g] = _named(reader, tape["guards"][g], system.guard_title(g, z))

    def monomials(self) -> set[Monomial]:
        """The functions of time in it."""
        forms = [*self.rates, *self.guards.values()]
        return {key for form in forms for key in form if isinstance(key, tuple)}


def _named(reader: LinearReader, register: int, title: str) -> Form:
    try:
        return reader.form(register)
    except NotLinear as reason:
        raise NotLinear(f"{title} has {reason}") from None


def no_tables() -> LinearTables:
    """Tables of a loop whose modes are not linear: empty."""
    i, f, c = np.int64, np.float64, np.complex128
    tables: LinearTables = packed(LinearTables(
        np.zeros(0, i), np.zeros(0), np.zeros(0), np.zeros(1, i), np.zeros(0, i), np.zeros(0), np.zeros(1, i),
        np.zeros(0, i), np.zeros(2, i), np.zeros((0, 0, 0, 0), f), np.zeros((0, 0, 0, 0), f), np.zeros(0, i),
        np.zeros((0, 0), c), np.zeros((0, 0, 0), c), np.zeros((0, 0), i), np.zeros((0, 0, 0), c),
        np.zeros((0, 0, 0), c), np.zeros((0, 0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0)),
        np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0), i),
    ))  # fmt: skip
    return tables


def linear_tables(system: System, met: list[np.ndarray], p: np.ndarray, horizon: float) -> LinearTables:
    """Tables of the vectors of modes met so far, at the parameters in p, for segments of about that length."""
    atoms = Atoms()
    modes = [LinearMode(system, atoms, z, p) for z in met]
    monomials = atoms.closure({(), *(m for mode in modes for m in mode.monomials())})
    n, size = system.n, system.n + len(monomials)
    place: dict[Any, int] = {i: i for i in range(n)} | {m: n + k for k, m in enumerate(monomials)}
    motion = np.zeros((size, size))  # of the monomials, the same in all modes
    for monomial in monomials:
        for key, weight in atoms.derivative(monomial).items():
            motion[place[monomial], place[key]] = weight
    matrices = []
    for mode in modes:
        A = motion.copy()
        for i, form in enumerate(mode.rates):
            for key, weight in form.items():
                A[i, place[key]] = weight
        matrices.append(A)
    flows = [modal(A, horizon) for A in matrices]
    widest = max((len(f.values) for f in flows), default=0)
    count, guards = len(met), system.guard_count
    series, roundings = (np.zeros((count, guards, size, ORDER + 1)) for _ in range(2))
    terms = np.zeros((count, guards, widest, 2, TERMS))
    sizes, rests = np.zeros((count, guards, widest)), np.zeros((count, guards, widest))
    farthest, grown = np.full((count, guards), np.inf), np.ones((count, guards))
    waves = np.full((count, guards), -1, dtype=np.int64)
    for k, (mode, A, flow) in enumerate(zip(modes, matrices, flows, strict=True)):
        for g, form in mode.guards.items():
            row = np.zeros(size)
            for key, weight in form.items():
                row[place[key]] = weight
            _guard_series(row, A, series[k, g], roundings[k, g])
            J = len(flow.values)
            gamma = row @ flow.full_basis
            _modal_terms(gamma, flow, terms[k, g, :J])
            sizes[k, g, :J], rests[k, g, :J] = _bounds(gamma, flow)
            waves[k, g] = _wave(gamma, flow)
            seen = rests[k, g, :J] > 0.0
            fastest, growth = max(flow.speeds[seen], default=0.0), max(flow.growth[seen], default=0.0)
            if fastest > 0.0:
                farthest[k, g] = FARTHEST / fastest
            if growth > 0.0:
                farthest[k, g], grown[k, g] = min(farthest[k, g], math.log(2.0) / growth), 2.0
    tables: LinearTables = packed(
        LinearTables(
            **_atom_arrays(atoms, monomials),
            phases=np.array([system.layout.phases_at, system.layout.signals_at], dtype=np.int64),
            series=series,
            roundings=roundings,
            counts=np.array([len(f.values) for f in flows], dtype=np.int64),
            values=_stack([f.values for f in flows], (widest,), complex),
            upper=_stack([f.upper for f in flows], (widest, widest), complex),
            ends=_stack([f.ends for f in flows], (widest,), np.int64),
            basis=_stack([f.full_basis[:n] for f in flows], (n, widest), complex),
            inverse=_stack([f.inverse for f in flows], (widest, size), complex),
            terms=terms,
            sizes=sizes,
            rests=rests,
            farthest=farthest,
            grown=grown,
            slopes=np.array([A[:n] for A in matrices]).reshape(count, n, size),
            waves=waves,
        )
    )
    return tables


def _guard_series(row: np.ndarray, A: np.ndarray, series: np.ndarray, roundings: np.ndarray) -> None:
    """Rows of the Taylor coefficients of row @ y along y' = A y, and what rounding makes of each entry."""
    size, bound = len(row), np.abs(row)
    for k in range(ORDER + 1):
        series[:, k] = row
        roundings[:, k] = (size + (k + 1) * (_ROUNDINGS + size)) * UNIT * bound
        row, bound = row @ A / (k + 1), bound @ np.abs(A) / (k + 1)


def _modal_terms(gamma: np.ndarray, flow: Modal, terms: np.ndarray) -> None:
    """Taylor coefficients of Re(gamma c) along c' = B c: factors of the real and the imaginary parts of c."""
    B = np.diag(flow.values) + flow.upper
    for m in range(TERMS):
        terms[:, 0, m], terms[:, 1, m] = gamma.real, gamma.imag
        gamma = gamma @ B / (m + 1)


def _bounds(gamma: np.ndarray, flow: Modal) -> tuple[np.ndarray, np.ndarray]:
    """Factors of |c| in bounds of Re(gamma c) and of its coefficient TERMS: |gamma| and |gamma| |B**TERMS|/TERMS!.

    Block by block: what a guard does not see now it may see later, of another coordinate of the block.
    """
    sizes, rests, first = np.empty(len(gamma)), np.empty(len(gamma)), 0
    while first < len(gamma):
        here = slice(first, int(flow.ends[first]))
        block = np.diag(flow.values[here]) + flow.upper[here, here]
        sizes[here] = np.linalg.norm(gamma[here])
        power = np.linalg.norm(np.linalg.matrix_power(block, TERMS), 2)
        rests[here] = sizes[here] * power / math.factorial(TERMS)
        first = here.stop
    return sizes, rests


def _wave(gamma: np.ndarray, flow: Modal) -> int:
    """The coordinate that turns, where Re(gamma c) is a constant and one undamped wave; else -1."""
    seen = np.flatnonzero(gamma)
    turning = seen[flow.values[seen] != 0.0]
    if len(turning) != 1 or flow.upper[seen].any():  # what others drive is no wave
        return -1
    value = flow.values[turning[0]]
    return int(turning[0]) if value.real == 0.0 and value.imag > 0.0 else -1


def _atom_arrays(atoms: Atoms, monomials: list[Monomial]) -> dict[str, np.ndarray]:
    known = atoms.known
    terms = np.cumsum([0, *(len(a.terms) for a in known)])
    factors = np.cumsum([0, *(len(m) for m in monomials)])
    return {
        "kinds": np.array([a.kind for a in known], dtype=np.int64),
        "rates": np.array([a.rate for a in known]),
        "offsets": np.array([a.offset for a in known]),
        "term_start": terms.astype(np.int64),
        "sources": np.array([source for a in known for source, _ in a.terms], dtype=np.int64),
        "weights": np.array([weight for a in known for _, weight in a.terms], dtype=float),
        "factor_start": factors.astype(np.int64),
        "factors": np.array([2 * a + part for m in monomials for a, part in m], dtype=np.int64),
    }


def _stack(parts: list[np.ndarray], shape: tuple[int, ...], kind: Any) -> np.ndarray:
    """Arrays of different sizes in one, filled up with zeros."""
    out = np.zeros((len(parts), *shape), dtype=kind)
    for k, part in enumerate(parts):
        out[k][tuple(slice(0, m) for m in part.shape)] = part
    return out


def tables_of(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float
) -> tuple[LinearTables, deque[Any]]:
    """Tables of these vectors of modes (K, components), and scratch arrays for them to be handed on.

    Both are made once for each set of parameter values and each order of magnitude of the horizon: how long a segment
    may be at most.
    """
    horizon = 16.0 ** math.ceil(math.log(horizon, 16.0)) if horizon > 0.0 else math.inf
    kept: dict[bytes, tuple[LinearTables, deque[Any]]] = system.code.shared("linear", dict)
    key = p[: system.layout.parameters].tobytes() + modes.tobytes() + np.float64(horizon).tobytes()
    found = kept.get(key)
    if found is None:
        if len(kept) >= _KEPT:
            kept.pop(next(iter(kept)), None)
        found = kept[key] = (linear_tables(system, list(modes), p, horizon), deque())
    return found


def what_is_not_linear(system: System) -> str | None:
    """What keeps a model from being linear in each of its modes, in words; None where nothing does.

    Each mode of each component is looked at; other combinations of modes are when they are entered.
    """
    known: dict[bytes, str | None] = system.code.shared("what is not linear", dict)
    p = system.vector(Instant(0.0), np.zeros(system.layout.discrete))
    key = p[: system.layout.parameters].tobytes()
    if key not in known:
        if len(known) >= _KEPT:
            known.clear()
        known[key] = _first_reason(system, p)
    return known[key]


def _first_reason(system: System, p: np.ndarray) -> str | None:
    vectors = {"": np.zeros(len(system.automata), dtype=np.int64)}
    for c, automaton in enumerate(system.automata):
        for m, mode in enumerate(automaton.modes):
            z = vectors[f"in {automaton.name}.{mode} "] = vectors[""].copy()
            z[c] = m
    for place, z in reversed(vectors.items()):
        try:
            LinearMode(system, Atoms(), z, p)
        except NotLinear as reason:
            return f"{place}{reason}"
    return None


def refuse_nonlinear(system: System) -> None:
    """Refuse a model of which some mode is not linear."""
    reason = what_is_not_linear(system)
    if reason is not None:
        raise UsageError(
            f"exact cannot run {system.model.name}: a closed form takes modes that are linear in the states, "
            f"and {reason}",
            remedy="choose taylor or dop853",
        )
