"""Decide whether the modes of a system are linear, and return their rates and guards as linear forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from itertools import product

import numpy as np

from hybridsim.engine.linear.form import MOST_PRODUCTS, Atoms, DividesByZero, LinearReader, NotLinear, Read
from hybridsim.engine.linear.terms import Form, Monomial, Product
from hybridsim.engine.series.optimise import PAIRED, arguments_of
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.model.parts.component import MonitorCorner
from hybridsim.model.toml.automata import SINGLE

_MAX_CACHED = 64  # most cached answers per structure, one for each set of parameter values


@per_structure
def _guards_of_monitors(system: System) -> frozenset[int]:
    """Return the guards that represent monitors; they may be polynomials of the states."""
    components = zip(system.model.all_components(), system.automata, strict=True)
    return frozenset(
        int(g) for c, a in components if isinstance(c, MonitorCorner) for guards in a.guards for g in guards
    )


class LinearMode:
    """Linear forms of the rates and active guards in one combination of modes.

    Guards that represent monitors may be polynomials. reader: the linear forms of all registers in these modes.
    """

    def __init__(self, system: System, reader: LinearReader, z: np.ndarray) -> None:
        tape = system.code.data["tape"]
        rates, of_monitors = zip(system.names, tape["derivatives"], strict=True), _guards_of_monitors(system)
        self.rates = [_named(reader.form, register, f"the rate of {name}") for name, register in rates]
        self.guards: dict[int, Form] = {}
        for g in map(int, np.flatnonzero(system.active(z))):
            read = reader.polynomial if g in of_monitors else reader.form
            self.guards[g] = _named(read, tape["guards"][g], system.guard_title(g, z))

    def monomials(self) -> set[Monomial]:
        """Return the functions of time that occur in the linear forms."""
        forms = [*self.rates, *self.guards.values()]
        found = {key for form in forms for key in form if isinstance(key, tuple)}
        return found.union(product.monomial for product in self.products())

    def products(self) -> set[Product]:
        """Return the products of states that occur in the guards."""
        return {key for form in self.guards.values() for key in form if isinstance(key, Product)}


def _reader(system: System, atoms: Atoms, z: np.ndarray, p: Sequence[float] | None) -> LinearReader:
    """Return the linear forms of all registers in one combination of modes."""
    tape, layout = system.code.data["tape"], system.layout
    varying = range(layout.discrete_at, layout.size)
    parameters = [(r, s) for r, s in tape["parameters"] if s != layout.pin_at]
    constants = [(r, v) for r, v, _ in tape["constants"]]
    constants += [(r, 1.0) for r, s in tape["parameters"] if s == layout.pin_at]
    keeps_products = bool(_guards_of_monitors(system))
    reader = LinearReader(
        atoms, tape["time"], tape["states"], constants, parameters, varying, p, keeps_products
    )
    reader.read(system.mode_rows(z))
    return reader


def _are_same(one: Read | NotLinear | None, other: Read | NotLinear | None) -> bool:
    """Return whether two registers have the same linear form; unknown coefficients (NaN) count as equal."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_are_same(w, other[k]) for k, w in one.items())
    is_unknown = one != one and other != other  # true for NaN only
    return is_unknown or one == other


class _Changes:
    """Computes the linear forms in other modes from those in the first modes; only changed registers are computed."""

    def __init__(self, system: System, p: Sequence[float] | None) -> None:
        self.system = system
        self._first = _reader(system, Atoms(), np.zeros(len(system.automata), dtype=np.int64), p)
        self._parts = [
            (component, [(rows, {r for row in rows for r in arguments_of(row)}) for rows in branches])
            for component, branches in system.code.data["tape"]["parts"]
        ]

    def mode(self, z: np.ndarray) -> LinearMode:
        """Return the linear forms in the modes `z`, or raise NotLinear."""
        reader, changed, modes = copy(self._first), set[int](), z.tolist()
        reader.forms = dict(reader.forms)
        for component, branches in self._parts:
            mode = 0 if component < 0 else modes[component]
            rows, read = branches[mode]
            if mode or not read.isdisjoint(changed):
                reader.read(rows)
                results = {out + k for op, *_, out in rows for k in range(2 if op in PAIRED else 1)}
                first, here = self._first.forms, reader.forms
                changed |= {r for r in results if not _are_same(here.get(r), first.get(r))}
        return LinearMode(self.system, reader, z)


def _named(read: Callable[[int], Form], register: int, title: str) -> Form:
    try:
        return read(register)
    except NotLinear as reason:
        raise type(reason)(f"{title} has {reason}") from None


class NoMode:
    """The placeholder for a combination of modes that has no motion because its rates are NaN."""

    def __init__(self, system: System) -> None:
        self.rates: list[Form] = [{(): math.nan} for _ in system.names]
        self.guards: dict[int, Form] = {}

    def monomials(self) -> set[Monomial]:
        """Return an empty set, because a mode without motion needs no functions of time."""
        return set()

    def products(self) -> set[Product]:
        """Return an empty set, because a mode without motion has no guards."""
        return set()


def modes_of(
    system: System, atoms: Atoms, met: np.ndarray, p: Sequence[float] | None, first: int = 0
) -> list[LinearMode | NoMode]:
    """Return the linear forms of each combination of modes, or the reason why a combination is not linear.

    Some of the vectors may only be neighbours of those that the run entered. first: number of vectors to
    skip.
    """
    found: list[LinearMode | NoMode] = []
    for z in met[first:]:
        try:
            found.append(LinearMode(system, _reader(system, atoms, z, p), z))
        except DividesByZero:
            if len(met) == 1:
                raise
            found.append(NoMode(system))
    return found


def single_changes(system: System) -> np.ndarray:
    """Return the combination of the first mode of each component, and all combinations that differ in one component."""
    first = np.zeros(len(system.automata), dtype=np.int64)
    vectors = [first]
    for c, automaton in enumerate(system.automata):
        for m in range(1, len(automaton.modes)):
            vectors.append(first.copy())
            vectors[-1][c] = m
    return np.array(vectors)


@per_structure
def is_always_linear(system: System) -> bool:
    """Return whether a model is linear in each of its modes for any values of its parameters."""
    return _first_reason(system, None) is None


@per_structure
def holds_constants(system: System) -> bool:
    """Return whether each surface fixes one state at a constant value while the surface is held.

    On another surface the held state follows other states or time, and is not one of the modal coordinates.
    """
    reader = _reader(system, Atoms(), np.zeros(len(system.automata), dtype=np.int64), None)
    for register in system.code.data["tape"]["surfaces"]:
        try:
            form = reader.form(register)
        except NotLinear:
            return False
        states = [key for key in form if isinstance(key, int)]
        if len(states) != 1 or form.keys() - {*states, ()}:
            return False
    return True


def what_is_not_linear(system: System) -> str | None:
    """Return the reason why a model is not linear in each of its modes, or None if it is linear.

    Each mode of each component is checked once; other combinations of modes are checked when they are
    entered. Most models are linear at all values of their parameters or at none; the others are checked for
    each set of values.
    """
    if is_always_linear(system):
        return None
    return _first_reason(system, tuple(system.values.values()))


def _reason_at(system: System, p: tuple[float, ...] | None) -> str | None:
    vectors, of_mode = {"": np.zeros(len(system.automata), dtype=np.int64)}, {}
    for c, automaton in enumerate(system.automata):
        for m, mode in enumerate(automaton.modes):
            name = f"mode {mode}" if automaton.name == SINGLE else f"{automaton.name}.{mode}"
            z = vectors[f"in {name} "] = vectors[""].copy()
            z[c], of_mode[f"in {name} "] = m, (c, m)
    for cluster in system.clusters:  # components that hold together are solved jointly
        names = " and ".join(system.automata[c].name for c in cluster)
        hold = "hold together" if len(cluster) > 1 else "holds"
        z = vectors[f"while {names} {hold} "] = vectors[""].copy()
        z[list(cluster)] = [max(system.automata[c].hold, 0) for c in cluster]
    reasons: dict[str, str] = {}
    changes, products = _Changes(system, p), set[Product]()
    for place, z in reversed(vectors.items()):
        try:
            products |= changes.mode(z).products()
        except DividesByZero:
            continue  # no such motion
        except NotLinear as reason:
            reasons[place] = str(reason)
    if not reasons:
        return (
            f"monitors have more than {MOST_PRODUCTS} products of states"
            if len(products) > MOST_PRODUCTS
            else None
        )
    # the mode with which no vector is linear; the other modes may not be the cause
    to_blame = (
        place
        for place, (c, m) in of_mode.items()
        if all(other in reasons for other, z in vectors.items() if z[c] == m)
    )
    place = next(to_blame, next(iter(reasons)))
    return (
        reasons[place] if " in mode " in reasons[place] else f"{place}{reasons[place]}"
    )  # a guard's title contains the mode


_first_reason = per_structure(_reason_at, most=_MAX_CACHED)


def is_linear_beside_corners(system: System) -> bool:
    """Return whether each mode is linear in each branch of abs, min, max and sign, for the given parameter values."""
    return _is_linear_beside_corners(system, None) or _is_linear_beside_corners(
        system, tuple(system.values.values())
    )


def _linear_beside_corners_at(system: System, p: tuple[float, ...] | None) -> bool:
    counts = [len(automaton.modes) for automaton in system.automata]
    corners = [c for c, automaton in enumerate(system.automata) if automaton.is_corner]
    changes = _Changes(system, p)
    for k, c in product(corners, range(len(counts))):
        for side, mode in product(range(1, counts[k]), range(1, counts[c])):
            z = np.zeros(len(counts), dtype=np.int64)
            z[k], z[c] = side, mode
            try:
                changes.mode(z)
            except DividesByZero:
                continue  # no such motion
            except NotLinear:
                return False
    return True


_is_linear_beside_corners = per_structure(_linear_beside_corners_at, most=_MAX_CACHED)


def refuse_nonlinear(system: System) -> None:
    """Raise an error for a model with a mode that is not linear."""
    reason = what_is_not_linear(system)
    if reason is not None:
        raise UsageError(
            f"exact cannot run {system.model.name}: a closed form needs modes that are linear in the states, "
            f"but {reason}",
            remedy="use dop853" if system.has_corners else "use taylor or dop853",
        )
