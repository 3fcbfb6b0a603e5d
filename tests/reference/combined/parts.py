"""The parts that random models are made of, how often each is drawn, and whole structures of them."""

from __future__ import annotations

from collections.abc import Callable

from .automata import (
    automaton,
    clock,
    doses,
    kick,
    monitor,
    monitor_at_reset,
    rival_guards,
    sampled,
    single_guard,
    stranger,
    thermostat,
    tick_on_guard,
    twins,
    two_clocks,
)
from .builder import Builder
from .gaps import bouncing, closed_gap, loaded_contact, planar, two_discs, walls
from .rubbing import contact, elastic_floor, relay, resting, stack, watched_body

PARTS: list[tuple[int, Callable[[Builder], object]]] = [
    (6, automaton),
    (6, single_guard),
    (2, thermostat),
    (2, rival_guards),
    (4, sampled),
    (2, twins),
    (2, doses),
    (4, tick_on_guard),
    (2, two_clocks),
    (2, monitor_at_reset),
    (4, monitor),
    (4, clock),
    (4, kick),
    (10, contact),
    (5, resting),
    (2, elastic_floor),
    (4, bouncing),
    (4, closed_gap),
    (4, loaded_contact),
    (4, planar),
    (1, two_discs),
    (4, relay),
    (4, stranger),
    (4, stack),
    (3, walls),
    (4, watched_body),
]
ONCE = {"two_discs"}
LATE = ("monitor", "clock", "kick", "stranger")  # these look at what is there


def structure(seed: int, count: int | None = None) -> Builder:
    """The structure of a seed."""
    b = Builder(seed)
    weights, parts = zip(*PARTS)
    used: set[str] = set()
    drawn = b.rng.choices(parts, weights, k=count or b.rng.choice([1, 1, 2, 2, 3]))
    for part in sorted(drawn, key=lambda part: part.__name__ in LATE):
        if part.__name__ in ONCE and part.__name__ in used:
            continue
        used.add(part.__name__)
        b.tag(f"part: {part.__name__}")
        part(b)
    return with_a_parameter(b)


def with_a_parameter(b: Builder) -> Builder:
    """The same with one number at least that the draws differ in."""
    numbers = [n for n in b.m.numbers.values() if n.formula is None]
    if numbers and all(n.value is not None for n in numbers):
        numbers[0].written, numbers[0].value = "parameter", None
        b.tag("number: parameter")
    return b


def alone(name: str, seed: int) -> Builder:
    """One part by itself."""
    b = Builder(seed)
    b.tag(f"part: {name}")
    next(part for _, part in PARTS if part.__name__ == name)(b)
    return with_a_parameter(b)
