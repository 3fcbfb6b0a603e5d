"""This module converts a mechanical system to an ordinary model, as an independent way of simulation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from hybridsim.expr import parse
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalSystem
from hybridsim.model import Contact, Impact, Model, Parameter, State
from hybridsim.model.free_name import free_name

_Term = tuple[float, str]  # a factor and a name


def as_model(system: MechanicalSystem) -> Model:
    """Return a model with explicit accelerations, and one contact for each contact of the system.

    An angular frequency becomes a parameter, so that its angle stays accurate over any time.
    """
    n, inverse = system.n, np.linalg.inv(system.M.toarray())
    K, C = inverse @ system.K.toarray(), inverse @ system.C.toarray()
    B, D = (
        np.array([[sum(inverse[i, j] * w for j, w in c.direction) for c in of] for i in range(n)])
        for of in (system.contacts, system.impacts)
    )
    rates = sorted(
        {t.omega for terms in system.forcing.values() for t in terms if isinstance(t, Harmonic)}
        | {c.base.omega for c in system.contacts if isinstance(c.base, Harmonic)}
    )
    taken = {*system.names, *system.velocities, *(contact.name for contact in system.all_contacts)}
    omega = {rate: free_name(taken, f"omega_{i + 1}") for i, rate in enumerate(rates)}
    forces = {j: _grouped(_signal(terms, omega)) for j, terms in system.forcing.items()}
    states = []
    for i, (x, v) in enumerate(zip(system.names, system.velocities, strict=True)):
        terms = [(inverse[i, j] * w, signal) for j, force in forces.items() for w, signal in force]
        terms += [(-K[i, j], system.names[j]) for j in range(n)]
        terms += [(-C[i, j], system.velocities[j]) for j in range(n)]
        terms += [(-B[i, c], contact.name) for c, contact in enumerate(system.contacts)]
        terms += [(D[i, c], impact.name) for c, impact in enumerate(system.impacts)]
        start, speed = parse(float(system.q0[i])), parse(float(system.v0[i]))
        states += [State(x, start, parse(v)), State(v, speed, parse(_sum(terms)))]
    contacts = [
        Contact(c.name, parse(_velocity(system, c, omega)), parse(c.normal), c.law, c.arguments)
        for c in system.contacts
    ]
    return Model(
        name=system.name,
        title=system.title,
        source=system.source,
        states=tuple(states),
        parameters=tuple(Parameter(name, parse(rate)) for rate, name in omega.items()),
        contacts=tuple(contacts),
        impacts=tuple(
            Impact(
                i.name,
                parse(_sum([*_combination(i.direction, system.names), (i.gap, "")])),
                parse(i.restitution),
            )
            for i in system.impacts
        ),
    )


def _sum(terms: Iterable[_Term]) -> str:
    """Return a sum as text; a term without a name is a number, and a term with the factor 0 is left out."""
    text = ""
    for factor, name in terms:
        if factor == 0.0:
            continue
        number = repr(abs(float(factor))).removesuffix(".0")
        term = "*".join(part for part in (number, name) if part and (part != "1" or not name))
        if text:
            text += f" {'-' if factor < 0.0 else '+'} {term}"
        else:
            text = f"-{term}" if factor < 0.0 else term
    return text or "0"


def _grouped(terms: list[_Term]) -> list[_Term]:
    """Return a sum as one term, in brackets if it has several terms."""
    return terms if len(terms) < 2 else [(1.0, f"({_sum(terms)})")]


def _signal(parts: Any, omega: dict[float, str]) -> list[_Term]:
    terms: list[_Term] = []
    for part in parts:
        if isinstance(part, Harmonic):
            angle = f"{omega[part.omega]}*t"
            terms += [(part.sin, f"sin({angle})"), (part.cos, f"cos({angle})")]
        else:
            terms.append((float(part), ""))
    return [term for term in terms if term[0] != 0.0]


def _velocity(system: MechanicalSystem, contact: Any, omega: dict[float, str]) -> str:
    base = _grouped(_signal((contact.base,), omega))
    return _sum([*_combination(contact.direction, system.velocities), *((-w, name) for w, name in base)])


def _combination(direction: Any, names: tuple[str, ...]) -> list[_Term]:
    return [(weight, names[i]) for i, weight in direction]
