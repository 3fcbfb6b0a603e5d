"""Impulses of unilateral contacts by enumeration: who pushes, and whether friction slides or stops in the blow."""

from __future__ import annotations

import itertools
from typing import Any

from .forms import lowered, parts_of, rate_of, var
from .series import solved
from .values import Stop

PLASTIC = 1e-6  # speeds below which a rebound is too small to matter: what follows is at rest


def effects(judge: Any, force: str) -> dict[str, Any]:
    """What a unit impulse of one force adds to each state."""
    none = dict.fromkeys([*judge.m.impacts, *judge.m.contacts, *judge.m.relays], 0)
    rates = dict(judge.rates)
    return {
        k: judge.value(e, none | {force: 1}) - judge.value(e, none)
        for k, e in rates.items()
        if any(p.op == "var" and p.args[0] == force for p in parts_of(e))
    }


def along(judge: Any, e: Any, change: dict[str, Any]) -> Any:
    """The directional derivative of an expression."""
    rates = {k: var("!" + k) for k in change}
    whole = rate_of(lowered(e), rates)
    return judge.value(whole, {"!" + k: v for k, v in change.items()}) - judge.value(whole)


def blow(judge: Any) -> bool:
    """Apply the impulses of this instant; False where nothing is struck."""
    m, tol = judge.m, judge.tol
    touching = [
        p for p, i in m.impacts.items() if abs(judge.value(i.gap)) <= 1e3 * tol or judge.value(i.gap) < 0
    ]
    speed = {p: judge.gap_rate(p) for p in touching}
    if not any(u < -tol for u in speed.values()):
        return False
    back = {}
    for p in touching:
        e = judge.value(m.impacts[p].restitution)
        back[p] = 0 if e < 1 and speed[p] > -PLASTIC else -e * min(speed[p], 0)
    rate = {p: rate_of(lowered(m.impacts[p].gap), judge.rates) for p in touching}
    loaded = {
        f: [p for p in touching if any(n.op == "var" and n.args[0] == p for n in parts_of(c.normal))]
        for f, c in m.contacts.items()
    }
    rubbing = [f for f, by in loaded.items() if by]
    push = {name: effects(judge, name) for name in touching + rubbing}
    gain = {(p, q): along(judge, rate[p], push[q]) for p in touching for q in push}
    turn = {(f, q): along(judge, m.contacts[f].velocity, push[q]) for f in rubbing for q in push}
    if any(back.values()) and any(gain[p, f] or turn[f, p] for p in touching for f in rubbing):
        raise Stop("unclear: friction and restitution in one blow")
    found: list[dict[str, Any]] = []
    for struck in itertools.product((False, True), repeat=len(touching)):
        pushing = [p for p, on in zip(touching, struck) if on]
        for ways in itertools.product(("stop", "+", "-"), repeat=len(rubbing)):
            answer = impulses(judge, pushing, dict(zip(rubbing, ways)), loaded, gain, turn, speed, back)
            if answer is None:
                continue
            new = dict(judge.x)
            for name, size in answer.items():
                for k, effect in push[name].items():
                    new[k] = new[k] + size * effect
            if not any(all(abs(new[k] - o[k]) <= 1e-7 * (1 + abs(o[k])) for k in new) for o in found):
                found.append(new)
    if len(found) != 1:
        raise Stop(
            "unclear: blows with several outcomes" if found else "inconsistent: no impulse is admissible"
        )
    judge.x = found[0]
    return True


def impulses(judge, pushing, ways, loaded, gain, turn, speed, back):  # type: ignore[no-untyped-def]  # any numbers
    """The impulses of one combination; None where it is not admissible."""
    tol = judge.tol
    coefficient = {f: judge.value(judge.m.contacts[f].mu_s) for f in ways}
    velocity = {f: judge.value(judge.m.contacts[f].velocity) for f in ways}
    unknown = pushing + list(ways)
    matrix, right = [], []
    for p in pushing:
        matrix.append([gain[p, q] for q in unknown])
        right.append(back[p] - speed[p])
    for f, way in ways.items():
        if way == "stop":
            matrix.append([turn[f, q] for q in unknown])
            right.append(-velocity[f])
        else:
            sign = 1 if way == "+" else -1
            matrix.append([1 if q == f else -sign * coefficient[f] if q in loaded[f] else 0 for q in unknown])
            right.append(0)
    answer = solved(matrix, right) if unknown else []
    if answer is None:
        return None
    size = dict(zip(unknown, answer))
    after = {p: speed[p] + sum(gain[p, q] * s for q, s in size.items()) for p in speed}
    if any(size[p] < -tol for p in pushing) or any(after[p] < back[p] - tol for p in speed):
        return None
    for f, way in ways.items():
        load = sum(size.get(p, 0) for p in loaded[f])
        v = velocity[f] + sum(turn[f, q] * s for q, s in size.items())
        if way == "stop" and abs(size[f]) > coefficient[f] * load + tol:
            return None
        if way != "stop" and (1 if way == "+" else -1) * v < -tol:
            return None
    return size
