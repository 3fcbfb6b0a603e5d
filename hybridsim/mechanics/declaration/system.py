"""This module declares a mechanical system: matrices, harmonic forcing, contacts with direction and friction law."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from hybridsim.arguments import as_real, is_row, real_array
from hybridsim.errors import UsageError
from hybridsim.expr import Expression
from hybridsim.expr.evaluate import resolve
from hybridsim.mechanics.declaration.direction import finite, weights
from hybridsim.mechanics.declaration.impact import MechanicalImpact
from hybridsim.mechanics.declaration.mass import require_positive_definite
from hybridsim.model import Model
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.library import load_law
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared, as_tuple
from hybridsim.model.parts.frozen_map import FrozenMap

Part = TypeVar("Part")


@dataclass(frozen=True)
class Harmonic:
    """A force or base speed sin*sin(omega t) + cos*cos(omega t), with an accurate phase at all times.

    Parameters
    ----------
    omega : float
        Angular frequency, rad per unit of t.
    sin, cos : float, optional
        Amplitudes of the two parts.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Harmonic(2.0, sin=0.5)
    Harmonic(omega=2.0, sin=0.5, cos=0.0)
    """

    omega: float
    sin: float = 0.0
    cos: float = 0.0

    def __post_init__(self) -> None:
        for what in ("omega", "sin", "cos"):
            value = as_real(raw := getattr(self, what))
            if value is None or not math.isfinite(value):
                raise UsageError(f"Harmonic: `{what}` cannot be {raw!r}", remedy="use a finite number")
            object.__setattr__(self, what, value)


@dataclass(frozen=True)
class MechanicalContact(Declared):
    """A dry contact of a `MechanicalSystem`: its force f acts as - direction f and opposes the relative velocity.

    ::

        v_rel = direction . q' - base

    Parameters
    ----------
    name : str
        The name of the friction force.
    direction : array or mapping of int to float
        The weights w (n,), or a mapping from numbers of coordinates to weights.
    normal : float
        Normal load, >= 0.
    law : FrictionLaw or str
        A set-valued `FrictionLaw` (``slip`` and ``stick``) without tables, or the name of a packaged one.
    arguments : mapping of str to float, optional
        Values of the law's parameters.
    base : float or Harmonic, optional
        Speed of the base on which the system slides: a number, or a `Harmonic`.
    place : Place, optional
        The place of the declaration, for error messages.

    Examples
    --------
    >>> MechanicalContact("f", {0: 1.0}, normal=10, law="coulomb", arguments={"mu": 0.3}).values()["mu"]
    0.3
    """

    name: str
    direction: Any
    normal: float
    law: FrictionLaw
    arguments: Mapping[str, Expression] = field(default_factory=FrozenMap)
    base: float | Harmonic = 0.0
    weights: int = field(init=False, default=0, repr=False, compare=False)  # number of weights given in a row

    def __post_init__(self) -> None:
        self._texts("name")
        self._maps("arguments")
        law: object = self.law
        if isinstance(law, str):
            object.__setattr__(self, "law", load_law(law))
        elif not isinstance(law, FrictionLaw):
            raise self._fault(f"`law` cannot be {law!r}", "use hs.FrictionLaw(...), or the name of a law")
        if not self.law.is_set_valued or self.law.tables:
            unsupported = "tables" if self.law.tables else "a direct force instead of slip and stick"
            raise self._fault(
                f"the law '{self.law.name}' has {unsupported}",
                "use a law with slip and stick forces, or write the system as an hs.Model with hs.Contact",
            )
        object.__setattr__(self, "normal", finite(self, "normal", self.normal))
        if not self.normal >= 0.0:
            raise self._fault(f"`normal` cannot be {self.normal!r}", "use a load >= 0")
        if not isinstance(self.base, Harmonic):
            object.__setattr__(self, "base", finite(self, "base", self.base))
        pairs, count = weights(self, self.direction)
        object.__setattr__(self, "weights", count)
        object.__setattr__(self, "direction", pairs)

    def values(self) -> dict[str, float]:
        """Return the values of the parameters of the friction law, including default values.

        Raises
        ------
        ModelError
            For a parameter that the law does not have, or one without a value.
        """
        checked = Contact(self.name, "v", self.normal, self.law, self.arguments).values()  # type: ignore[arg-type]  # made an expression
        known = {name: value for name, value in checked.items() if name != "N"}
        return resolve(known)


class MechanicalSystem:
    """A linear structure with dry contacts, as data for compiled kernels.

    ::

        M q'' + C q' + K q = forcing(t) - sum_i w_i f_i + sum_j d_j p_j,      f_i = law_i(w_i . q' - base_i)

    After an event, stick and slip of all contacts that act on each other are decided jointly, as one
    complementarity problem of their accelerations (or of higher derivatives if the accelerations are zero).

    Parameters
    ----------
    M, C, K : array, sparse array or None
        Shape (n, n), dense or of scipy.sparse, or (n,) for a diagonal; M is positive definite. C or K may be
        None.
    forcing : sequence or mapping of int to float, Harmonic or tuple of these, optional
        For each coordinate a number, a `Harmonic`, or a tuple of these; or a mapping from coordinates to
        these; or None.
    contacts : iterable of MechanicalContact, optional
        `MechanicalContact` objects.
    impacts : iterable of MechanicalImpact, optional
        Unilateral contacts with directions d_j; a system with impacts is run by ``moreau``.
    q0, v0 : array, optional
        Initial positions and velocities (n,), zero if not given.
    names : sequence of str, optional
        Names of the coordinates, by default q1, q2, ...; their velocities are v1, v2, ... or ``v_`` and the name.
    name, title, source : str, optional
        As in a `Model`.

    Raises
    ------
    UsageError
        For inconsistent shapes, a mass matrix that is not positive definite, or duplicate names.

    Notes
    -----
    It is meant for a few to thousands of contacts. The ordinary `Model` supports more laws, states and
    inputs, and decides by trying all combinations of modes; `to_model` converts a small system to one.

    Examples
    --------
    >>> f = MechanicalContact("f", [1.0], normal=1, law="coulomb", arguments={"mu": 0.5}, base=0.2)
    >>> MechanicalSystem(M=[1.0], C=None, K=[1.0], forcing=None, contacts=[f]).n
    1
    """

    def __init__(
        self,
        M: Any,
        C: Any,
        K: Any,
        forcing: Any = None,
        contacts: Iterable[MechanicalContact] = (),
        *,
        impacts: Iterable[MechanicalImpact] = (),
        q0: Any = None,
        v0: Any = None,
        names: Sequence[str] | None = None,
        name: str = "mechanical",
        title: str = "",
        source: str = "",
    ) -> None:
        for argument, text in (("name", name), ("title", title), ("source", source)):
            if not isinstance(text, str):
                raise UsageError(f"MechanicalSystem: `{argument}` cannot be {text!r}", remedy="use a string")
        self.name, self.title, self.source = name, title, source
        self.M = _matrix(M, "M", None)
        require_positive_definite(self.M, name)
        self.n = self.M.shape[0]
        self.C, self.K = _matrix(C, "C", self.n), _matrix(K, "K", self.n)
        self.contacts = self._parts(contacts, "contacts", MechanicalContact)
        self.impacts = self._parts(impacts, "impacts", MechanicalImpact)
        self.forcing = self._forces(forcing)
        self.q0, self.v0 = self._start(q0, "q0"), self._start(v0, "v0")
        self.names = tuple(f"q{i + 1}" for i in range(self.n)) if names is None else as_tuple(names)
        if not all(isinstance(x, str) for x in self.names):
            raise UsageError(f"{name}: `names` cannot be {names!r}", remedy=f"use {self.n} strings")
        self.velocities = tuple(f"v{i + 1}" if names is None else f"v_{x}" for i, x in enumerate(self.names))
        self._check()

    def _parts(self, declared: Any, argument: str, kind: type[Part]) -> tuple[Part, ...]:
        """Return the contacts or the impacts as a tuple, after checking their types."""
        parts = as_tuple(declared)
        for part in parts:
            if not isinstance(part, kind):
                raise UsageError(
                    f"{self.name}: {argument} contain {part!r}", remedy=f"use hs.{kind.__name__}(...) objects"
                )
        return parts

    def _forces(self, forcing: Any) -> dict[int, tuple[float | Harmonic, ...]]:
        if forcing is None:
            return {}
        if not isinstance(forcing, Mapping):
            if not is_row(forcing):
                raise UsageError(
                    f"{self.name}: `forcing` cannot be {forcing!r}",
                    remedy="use one entry for each coordinate, or a mapping from coordinates to entries",
                )
            forcing = tuple(forcing)
        if not isinstance(forcing, Mapping) and len(forcing) != self.n:
            raise UsageError(
                f"{self.name}: `forcing` has {len(forcing)} entries for {self.n} coordinates",
                remedy="use one entry for each coordinate, or a mapping from coordinates to entries",
            )
        pairs = dict(forcing if isinstance(forcing, Mapping) else enumerate(forcing))
        found: dict[int, tuple[float | Harmonic, ...]] = {}
        for i, entry in pairs.items():
            if not (isinstance(i, int | np.integer) and 0 <= i < self.n):
                raise UsageError(
                    f"{self.name}: `forcing` has the coordinate {i!r}, but there are {self.n} coordinates",
                    remedy="number the coordinates from 0",
                )
            terms = entry if isinstance(entry, tuple | list) else (entry,)
            for term in terms:
                if not isinstance(term, Harmonic) and not math.isfinite(
                    math.nan if (n := as_real(term)) is None else n
                ):
                    raise UsageError(
                        f"{self.name}: `forcing` of coordinate {i} contains {term!r}",
                        remedy="use numbers and hs.Harmonic(omega, ...); write other forcing in an hs.Model",
                    )
            nonzero = tuple(t if isinstance(t, Harmonic) else float(t) for t in terms if t != 0.0)
            if nonzero:
                found[int(i)] = nonzero
        return found

    def _start(self, start: Any, name: str) -> np.ndarray:
        remedy = f"use {self.n} finite numbers"
        values = np.zeros(self.n) if start is None else real_array(start, f"{self.name}: `{name}`", remedy)
        if values.shape != (self.n,):
            raise UsageError(f"{self.name}: `{name}` cannot be {start!r}", remedy=remedy)
        return values

    def _check(self) -> None:
        if len(self.names) != self.n:
            raise UsageError(
                f"{self.name}: there are {len(self.names)} names for {self.n} coordinates",
                remedy="use a name for each coordinate",
            )
        every = [*self.names, *self.velocities, *(c.name for c in self.all_contacts)]
        twice = sorted({x for x in every if every.count(x) > 1}) if len(set(every)) < len(every) else []
        if twice:
            raise UsageError(f"{self.name}: the name {twice[0]!r} is used twice", remedy="use each name once")
        for contact in self.all_contacts:
            kind = "contact" if isinstance(contact, MechanicalContact) else "impact"
            if contact.weights not in (0, self.n):
                raise UsageError(
                    f"{kind} {contact.name}: its direction has {contact.weights} weights for {self.n} coordinates",
                    remedy="use one weight for each coordinate, or a mapping from coordinates to weights",
                )
            for i, _ in contact.direction:
                if not 0 <= i < self.n:
                    raise UsageError(
                        f"{kind} {contact.name}: its direction has coordinate {i}, but there are {self.n} coordinates",
                        remedy="number the coordinates from 0",
                    )

    @property
    def all_contacts(self) -> tuple[MechanicalContact | MechanicalImpact, ...]:
        """All contacts of the system, followed by its impacts."""
        return (*self.contacts, *self.impacts)

    def with_(self, **changes: Any) -> MechanicalSystem:
        """Return a copy with some arguments of the constructor changed."""
        own: dict[str, Any] = {
            key: getattr(self, key)
            for key in (
                "M",
                "C",
                "K",
                "forcing",
                "contacts",
                "impacts",
                "q0",
                "v0",
                "name",
                "title",
                "source",
            )
        }
        own["names"] = None if self.velocities[0] == "v1" else self.names
        return MechanicalSystem(**{**own, **changes})

    def to_model(self) -> Model:
        """Return the same system as an ordinary `Model`, for other integrators or for comparison."""
        from hybridsim.mechanics.declaration.as_model import as_model

        return as_model(self)

    def __repr__(self) -> str:
        return f"<MechanicalSystem {self.name}: {self.n} coordinates, {len(self.contacts)} contacts" + (
            f", {len(self.impacts)} impacts>" if self.impacts else ">"
        )


def _matrix(entries: Any, name: str, n: int | None) -> Any:
    """Return a square matrix as scipy.sparse.csr_array; a single row of numbers becomes a diagonal matrix."""
    from scipy import sparse

    if entries is None and n is not None:
        return sparse.csr_array((n, n))
    if sparse.issparse(entries):
        real_array(entries.data, name, "use finite real numbers")
        matrix = sparse.csr_array(entries, dtype=float)
    else:
        dense = real_array(entries, name, "use finite real numbers, (n, n), or (n,) for a diagonal")
        if dense.ndim not in (1, 2):
            raise UsageError(
                f"{name} has {dense.ndim} dimensions", remedy="use shape (n, n), or (n,) for a diagonal"
            )
        matrix = sparse.csr_array(sparse.diags_array(dense) if dense.ndim == 1 else dense)
    if not matrix.shape[0]:
        raise UsageError(f"{name} is empty", remedy="use at least one coordinate")
    if matrix.shape[0] != matrix.shape[1] or (n is not None and matrix.shape[0] != n):
        raise UsageError(f"{name} has shape {matrix.shape}", remedy=f"use shape ({n or 'n'}, {n or 'n'})")
    return matrix
