"""Makes a disagreement small: parts of the model are taken away for as long as the disagreement stays."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

from .forms import ZERO, Abstract, Node, parts_of, replaced

Holds = Callable[[Abstract], bool]  # whether a model still shows the disagreement


def expressions(m: Abstract) -> Iterator[tuple[Any, Any, Node]]:
    """Where expressions stand: a container, a key or attribute, the expression."""
    for name, (start, rate) in m.states.items():
        yield m.states, (name, 0), start
        yield m.states, (name, 1), rate
    for table in (m.discrete, m.relays):
        for name, e in table.items():
            yield table, name, e
    for thing in [*m.contacts.values(), *m.impacts.values(), *m.monitors.values()]:
        for key, e in vars(thing).items():
            if isinstance(e, Node):
                yield thing, "." + key, e
    for a in m.automata.values():
        for mode in a.modes.values():
            for table in (mode.rates, mode.sets):
                for name, e in table.items():
                    yield table, name, e
            for guard in mode.guards.values():
                yield guard, ".expr", guard.expr
                for choice in guard.choices:
                    if choice.when is not None:
                        yield choice, ".when", choice.when
                    for name, e in choice.reset.items():
                        yield choice.reset, name, e
    for schedule in m.schedules.values():
        for name, e in schedule.reset.items():
            yield schedule.reset, name, e


def put(container: Any, key: Any, e: Node) -> None:
    """Set an expression where it stands."""
    if isinstance(key, tuple):
        pair = list(container[key[0]])
        pair[key[1]] = e
        container[key[0]] = tuple(pair)
    elif isinstance(key, str) and key.startswith("."):
        setattr(container, key[1:], e)
    else:
        container[key] = e


def without(m: Abstract, table: str, name: str) -> Abstract:
    """The model without one of its components, variables or resets of it."""
    out = copy.deepcopy(m)
    del getattr(out, table)[name]
    for container, key, e in list(expressions(out)):
        put(container, key, replaced(e, {name: ZERO}))
    for resets in all_resets(out):
        resets.pop(name, None)
    return out


def all_resets(m: Abstract) -> Iterator[dict[str, Node]]:
    for a in m.automata.values():
        for mode in a.modes.values():
            yield mode.rates
            for guard in mode.guards.values():
                for choice in guard.choices:
                    yield choice.reset
                    yield choice.adds
    for s in m.schedules.values():
        yield s.reset
        yield s.adds
    for w in m.monitors.values():
        yield w.reset


def removals(m: Abstract) -> Iterator[Abstract]:
    """The model with one thing less."""
    for table in ("automata", "schedules", "monitors", "contacts", "impacts", "relays", "states", "discrete"):
        for name in list(getattr(m, table)):
            yield without(m, table, name)
    count = sum(1 for _ in all_resets(m))
    for i in range(count):
        for name in list(list(all_resets(m))[i]):
            out = copy.deepcopy(m)
            del list(all_resets(out))[i][name]
            yield out


def simpler(m: Abstract) -> Iterator[Abstract]:
    """The model with one expression made simpler."""
    places = list(expressions(m))
    for i, (_, _, e) in enumerate(places):
        for part in dict.fromkeys(parts_of(e)):
            smaller = [a for a in part.args if isinstance(a, Node)]
            if part.op in ("var", "t", "table"):
                smaller.append(ZERO)
            for other in smaller:
                if other == part:
                    continue
                out = copy.deepcopy(m)
                container, key, _ = list(expressions(out))[i]
                put(container, key, exchanged(e, part, other))
                yield out


def exchanged(e: Node, part: Node, other: Node) -> Node:
    """An expression with one of its parts exchanged."""
    if e == part:
        return other
    args = tuple(exchanged(a, part, other) if isinstance(a, Node) else a for a in e.args)
    return Node(e.op, args)


def shrunk(m: Abstract, holds: Holds, tries: int = 300) -> Abstract:
    """The smallest model found that still shows the disagreement."""
    for steps in (removals, simpler, removals):
        progress = True
        while progress and tries > 0:
            progress = False
            for smaller in steps(m):
                tries -= 1
                if tries <= 0:
                    break
                if holds(smaller):
                    m, progress = smaller, True
                    break
    return m


def used_numbers(m: Abstract) -> set[str]:
    """The numbers that a model still has in an expression."""
    whole: list[Any] = [e for _, _, e in expressions(m)]
    for s in m.schedules.values():
        whole += [*s.times, *s.adds.values()] + ([s.period] if s.period else [])
    for a in m.automata.values():
        for mode in a.modes.values():
            whole += [e for g in mode.guards.values() for c in g.choices for e in c.adds.values()]
    for times, values in m.tables.values():
        whole += times + values
    return {p.args[0] for e in whole for p in parts_of(e) if p.op == "num"}


def literal(m: Abstract, numbers: dict[str, Fraction]) -> Abstract:
    """The model with its numbers as literals."""
    out = pruned(m)
    for key, number in out.numbers.items():
        number.value, number.written = numbers[key], "literal"
    return out


def pruned(m: Abstract) -> Abstract:
    """The model without the numbers and tables that nothing uses."""
    out = copy.deepcopy(m)
    used = used_numbers(m)
    out.numbers = {k: n for k, n in out.numbers.items() if k in used}
    uses = {p.args[0] for _, _, e in expressions(out) for p in parts_of(e) if p.op in ("table", "slope")}
    out.tables = {k: t for k, t in out.tables.items() if k in uses}
    return out
