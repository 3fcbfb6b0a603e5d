"""Random models with friction by time stepping, beside the judge: the error is small, and falls with the step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import hybridsim as hs

from .builder import Builder, number_set
from .compare import hold, judged
from .forms import TIME, Contact, Node, node, sin, var
from .gaps import bouncing, loaded_contact
from .render import Renderer, Style
from .rubbing import contact, relay, resting, stack

STEPS = 200
FINER = 8
LEAST = 1e-3  # error of the finer run, relative to the motion, from which it must be smaller than that of the other
FALLS = 2.0  # times that it is smaller, at the least


def leaning(b: Builder) -> None:
    """Two bodies with friction, one of which is pressed on by the friction force of the other."""
    v, u, f, g = (b.name(stem) for stem in ("v", "v", "f", "f"))
    for name, friction_force in ((v, f), (u, g)):
        force = b.num("0.5", 2) * sin(b.num(1, 5) * TIME) if b.chance(0.7) else b.force()
        b.m.states[name] = node(0) if b.chance(0.4) else b.num(-2, 2), force - var(friction_force)
    load, low, more = b.num(1, 2), b.num("0.2", "0.5"), b.num("0.1", "0.4")
    b.m.contacts[f] = Contact(var(v), load, low)
    pressed: Node = b.num(2, 3) + b.either(b.num("0.3", 1)) * var(f)
    b.m.contacts[g] = Contact(var(u), pressed, low + more)


PARTS = (leaning, contact, resting, stack, relay, bouncing, loaded_contact)


def friction(number: int) -> Builder:
    """A structure with friction, relays and gaps."""
    b = Builder(number * 37 + 2)
    for part in b.rng.choices(PARTS, (3, 3, 1, 2, 1, 1, 1), k=b.rng.choice([1, 1, 2])):
        part(b)
    return b


def time_stepping(number: int) -> Iterator[dict[str, Any]]:
    """One model by `moreau` with two steps, and by a method that locates events."""
    b = friction(number)
    numbers = number_set(b.m, number, 0)
    motion, times, certain = truth = judged(b.m, numbers)
    if certain < 1e-3:
        return
    renderer = Renderer(b.m, Style(number))
    try:
        compiled = hs.Model.from_toml(renderer.toml(numbers))
    except hs.ModelError:
        return
    v = hold(
        b.m, compiled.with_(**renderer.values(numbers)), renderer, b.rng.choice(["taylor", "dop853"]), truth
    )
    if v.kind in ("differs", "chose", "went on", "refused", "crash"):
        yield {"kind": v.kind, "integrator": v.integrator, "detail": v.detail}
        return
    names, values = list(b.m.states), renderer.values(numbers)
    sizes = {k: max([1.0, *(abs(motion.at(t, names)[k]) for t in times)]) for k in names}
    errors = []
    for steps in (STEPS, FINER * STEPS):
        try:
            sol = hs.simulate(
                compiled,
                (0, b.m.duration),
                params=values,
                integrator="moreau",
                step=b.m.duration / steps,
            )
        except hs.HybridsimError:
            return  # refused by name
        if sol.status != "finished":
            return
        right = {t: motion.at(t, names) for t in times}
        off = [abs(float(sol.output(k, t)) - right[t][k]) / sizes[k] for t in times for k in names]
        errors.append(sorted(off)[len(off) * 3 // 4] if off else 0.0)  # not the instants next to events
    if errors[1] > LEAST and errors[1] > errors[0] / FALLS:
        detail = f"error {errors[0]:.2g} with {STEPS} steps, {errors[1]:.2g} with {FINER * STEPS}"
        yield {"kind": "differs", "integrator": "moreau", "detail": detail}
