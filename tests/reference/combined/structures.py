"""Random mechanical systems of one or two masses as data, beside the judge's motion of the same."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import hybridsim as hs

from .compare import ALLOWED, judged
from .forms import TIME, Abstract, Contact, node, sin, var

DURATION = 4.0
AGAIN = (
    0.5  # seconds by which a run may take longer than the same run made again, beyond twenty times as long
)
SLOWER = 20.0


def drawn(number: int, are_bases_moving: bool = False) -> tuple[hs.MechanicalSystem, Abstract]:
    """A system in both forms; its numbers have one digit, so that forces meet their limits exactly at times."""
    rng, of_bases = random.Random(number * 29 + 1), random.Random(number * 31 + 7)
    n = rng.choice([1, 1, 2])
    model, contacts, forcing = Abstract(duration=DURATION), [], {}
    rest = rng.random() < 0.5
    q0 = [0 if rest else rng.randint(-5, 5) for _ in range(n)]
    v0 = [0 if rest else rng.randint(-10, 10) for _ in range(n)]
    springs = [rng.choice([0, 0, rng.randint(1, 30)]) for _ in range(n)]
    masses = [rng.choice([1, 1, 2]) for _ in range(n)]
    rates = []
    for i in range(n):
        force, size = node(0), Fraction(rng.randint(-9, 9), 10)
        kind = rng.choice(["constant", "constant", "sine", "none"])
        if kind == "constant":
            force, forcing[i] = node(size), float(size)
        elif kind == "sine":
            omega = Fraction(rng.randint(5, 40), 10)
            force, forcing[i] = size * sin(omega * TIME), hs.Harmonic(float(omega), sin=float(size))
        rates.append(force - Fraction(springs[i], 10) * var(f"q{i}"))
    for i in range(n):
        mu, normal, name = Fraction(rng.randint(1, 5), 10), rng.randint(1, 3), f"f{i}"
        low = mu * Fraction(rng.randint(5, 9), 10)
        weights = {i: 1, i - 1: -1} if i and rng.random() < 0.5 else {i: 1}
        is_static = rng.random() < 0.3 and not (are_bases_moving and n > 1)
        law, given = "coulomb", {"mu": float(mu)}
        if is_static:
            law, given = "static-kinetic", {"mu_s": float(mu), "mu_k": float(low)}
        size, omega = Fraction(of_bases.randint(-12, 12), 10), Fraction(of_bases.randint(5, 60), 10)
        base, velocity = 0.0, node(0)
        if are_bases_moving:
            base, velocity = hs.Harmonic(float(omega), sin=float(size)), -size * sin(omega * TIME)
        contacts.append(
            hs.MechanicalContact(name, {k: float(w) for k, w in weights.items()}, normal, law, given, base)
        )
        for k, w in weights.items():
            velocity, rates[k] = velocity + w * var(f"v{k}"), rates[k] - w * var(name)
        model.contacts[name] = Contact(velocity, node(normal), node(mu), node(low) if is_static else None)
    for i in range(n):
        model.states[f"q{i}"] = node(Fraction(q0[i], 10)), var(f"v{i}")
        model.states[f"v{i}"] = node(Fraction(v0[i], 10)), rates[i] / masses[i]
    system = hs.MechanicalSystem(
        [float(m) for m in masses],
        None,
        [k / 10 for k in springs],
        forcing or None,
        contacts,
        q0=[q / 10 for q in q0],
        v0=[v / 10 for v in v0],
    )
    return system, model


def moving_bases(number: int) -> Iterator[dict[str, Any]]:
    """One system whose contacts are on oscillating bases.

    With two masses no static friction is above the kinetic one, so that every event has one outcome.
    """
    return mechanical_systems(number, are_bases_moving=True)


def mechanical_systems(number: int, are_bases_moving: bool = False) -> Iterator[dict[str, Any]]:
    """One system by its compiled kernels."""
    system, model = drawn(number, are_bases_moving)
    truth = motion, times, certain = judged(model, {})
    if certain < DURATION and truth[0].status != "finished":
        return
    sol = hs.simulate(system, (0, DURATION), limits={"steps": 20_000})
    if sol.status != "finished":
        yield {"kind": "stopped", "status": sol.status, "detail": sol.message[:300]}
        return
    names = [f"{k}{i}" for k in "qv" for i in range(system.n)]
    for t in times:
        right, ours = motion.at(t, list(model.states)), dict(zip(names, sol(t).tolist()))
        for k, value in right.items():
            if not abs(ours[k] - value) <= ALLOWED * max(1, abs(value)):
                yield {"kind": "differs", "detail": f"{k}({t:.6g}) right {value:.10g} got {ours[k]:.10g}"}
                return


def repeated_runs(number: int) -> Iterator[dict[str, Any]]:
    """What a run gives, and how long it says that it took, does not depend on whether it was made before."""
    system, _ = drawn(number)
    first, again = (hs.simulate(system, (0, DURATION)) for _ in range(2))
    if first.y.tobytes() != again.y.tobytes():
        yield {"kind": "differs", "detail": "the same run gives other states"}
    once, twice = first.stats["kernel_time"], again.stats["kernel_time"]
    if once > SLOWER * twice + AGAIN:
        yield {"kind": "differs", "detail": f"the run took {once:.3g} s, and made again {twice:.3g} s"}
