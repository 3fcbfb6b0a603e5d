"""This module converts a mechanical system to an ordinary model, as an independent way of simulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.expr import parse
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalSystem
from hybridsim.model import Contact, Impact, Model, Parameter, State
from hybridsim.model.free_name import free_name


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
    forces = {j: _signal(terms, omega) for j, terms in system.forcing.items()}
    states = []
    for i, (x, v) in enumerate(zip(system.names, system.velocities, strict=True)):
        terms = [_term(inverse[i, j], f"({force})") for j, force in forces.items()]
        terms += [_term(-K[i, j], system.names[j]) for j in range(n)]
        terms += [_term(-C[i, j], system.velocities[j]) for j in range(n)]
        terms += [_term(-B[i, c], contact.name) for c, contact in enumerate(system.contacts)]
        terms += [_term(D[i, c], impact.name) for c, impact in enumerate(system.impacts)]
        start, speed = parse(float(system.q0[i])), parse(float(system.v0[i]))
        states += [State(x, start, parse(v)), State(v, speed, parse("".join(terms) or 0))]
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
                parse(_combination(i.direction, system.names) + _term(i.gap, "1.0")),
                parse(i.restitution),
            )
            for i in system.impacts
        ),
    )


def _term(factor: float, name: str) -> str:
    return f" + ({float(factor)!r})*{name}" if factor != 0.0 else ""


def _signal(terms: Any, omega: dict[float, str]) -> str:
    parts = []
    for term in terms:
        if isinstance(term, Harmonic):
            parts += [
                _term(term.sin, f"sin({omega[term.omega]}*t)"),
                _term(term.cos, f"cos({omega[term.omega]}*t)"),
            ]
        else:
            parts.append(f" + ({float(term)!r})")
    return "".join(parts) or "0"


def _velocity(system: MechanicalSystem, contact: Any, omega: dict[float, str]) -> str:
    weights = _combination(contact.direction, system.velocities)
    if contact.base == 0.0:
        return weights
    return f"{weights} - ({_signal((contact.base,), omega)})"


def _combination(direction: Any, names: tuple[str, ...]) -> str:
    return "".join(
        f" + {names[i]}" if w == 1.0 else f" - {names[i]}" if w == -1.0 else _term(w, names[i])
        for i, w in direction
    )
