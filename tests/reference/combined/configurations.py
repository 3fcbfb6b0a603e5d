"""All configurations of a model that are admissible just after an instant, by enumeration."""

from __future__ import annotations

import itertools
import math
from typing import Any

from .forms import ZERO, Node, lowered, node, rate_of, replaced, var
from .roots import lead
from .series import Slots, Surroundings, Tape, series
from .values import Stop, Values

LOOK = 6  # derivatives that are looked at where something is zero


class Configurations(Values):
    """What may hold at an instant."""

    def tape(self, config: dict[str, str]) -> tuple[Tape, list[tuple[str, str, str, int]]]:
        """The operations in a configuration, and what must stay at or above zero in it: kind, owner, name, slot."""
        key = (tuple(config.items()), tuple(self.modes.items()))
        if key in self.tapes:
            return self.tapes[key]
        m = self.m
        sets: dict[str, Node] = {}
        rates = dict(self.rates)
        for name, mode in self.modes.items():
            sets |= {k: lowered(e) for k, e in m.automata[name].modes[mode].sets.items()}
            rates |= {k: lowered(e) for k, e in m.automata[name].modes[mode].rates.items()}
        unknowns = [c for c, mode in config.items() if mode in ("stick", "closed", "sliding")]
        names: dict[str, Node] = dict(sets)
        for p in m.impacts:
            names[p] = var(p) if config[p] == "closed" else ZERO
        for r in m.relays:
            names[r] = {"above": node(1), "below": node(-1), "sliding": var(r)}[config[r]]
        loads = {}
        for f, c in m.contacts.items():  # a load may contain the friction forces of contacts before it
            loads[f] = replaced(lowered(c.normal), names)
            force = replaced(lowered(c.mu_k or c.mu_s), names) * loads[f]
            names[f] = {"slip+": force, "slip-": -force, "stick": var(f), "open": ZERO}[config[f]]
        rates = {k: replaced(e, names) for k, e in rates.items()}
        must: list[tuple[str, str, str, Node]] = []
        holding: dict[str, Node] = {}
        for f, c in m.contacts.items():
            v, mode = replaced(lowered(c.velocity), names), config[f]
            if mode == "stick":
                limit = replaced(lowered(c.mu_s), names) * loads[f]
                must += [("limit", f, "+", limit - var(f)), ("limit", f, "-", limit + var(f))]
                holding[f] = rate_of(v, rates)
            elif mode != "open":
                must.append(("speed", f, mode, v if mode == "slip+" else -v))
            must.append(("load", f, mode, -loads[f] if mode == "open" else loads[f]))
        for p, i in m.impacts.items():
            gap = replaced(lowered(i.gap), names)
            must.append(("gap", p, config[p], var(p) if config[p] == "closed" else gap))
            holding[p] = rate_of(rate_of(gap, rates), rates)
        for r, e in m.relays.items():
            s = replaced(lowered(e), names)
            if config[r] == "sliding":
                must += [("relay", r, "+", node(1) - var(r)), ("relay", r, "-", node(1) + var(r))]
                holding[r] = rate_of(s, rates)
            else:
                must.append(("relay", r, config[r], s if config[r] == "above" else -s))
        for a, mode in self.modes.items():
            for g, guard in m.automata[a].modes[mode].guards.items():
                must.append(("guard", a, g, replaced(lowered(guard.expr), names)))
        for w, monitor in m.monitors.items():
            must.append(("monitor", w, "", replaced(lowered(monitor.expr), names)))
        tape = Tape(self.names, unknowns)
        watch = [(kind, owner, name, tape.add(e)) for kind, owner, name, e in must]
        tape.constraints = [tape.add(holding[u]) for u in unknowns]
        tape.rates = [(tape.state_slot[k], tape.add(rates[k])) for k in self.names]
        for op, _, data in tape.ops:
            if op == "const":
                self.values[data[0]] = self.maths.number(data[0])
        self.tapes[key] = tape, watch
        return tape, watch

    def options(self) -> dict[str, list[str]]:
        """The modes that each component without memory may have now."""
        out: dict[str, list[str]] = {}
        for f, c in self.m.contacts.items():
            v = self.value(c.velocity)
            out[f] = (
                ["slip+"] if v > self.tol else ["slip-"] if v < -self.tol else ["stick", "slip+", "slip-"]
            )
            if c.opens:
                out[f] = out[f] + ["open"]
        for p, i in self.m.impacts.items():
            free = self.value(i.gap) > self.tol or self.gap_rate(p) > self.tol
            out[p] = ["open"] if free else ["closed", "open"]
        for r, e in self.m.relays.items():
            s = self.value(e)
            out[r] = (
                ["above"] if s > self.tol else ["below"] if s < -self.tol else ["sliding", "above", "below"]
            )
        return out

    def gap_rate(self, p: str) -> Any:
        return self.value(rate_of(lowered(self.m.impacts[p].gap), self.rates))

    def sides_of(self, tape: Tape) -> list[dict[Node, bool]]:
        """The sides that all corners may have now: one where the argument is not zero, both where it is."""
        each = []
        for test in tape.switches:
            value = self.value(test)
            each.append([True] if value > self.tol else [False] if value < -self.tol else [True, False])
        count = math.prod(len(e) for e in each)
        if count > 256:
            raise Stop("unclear: too many corners at once")
        return [dict(zip(tape.switches, combination)) for combination in itertools.product(*each)]

    def surroundings(self, sides: dict[Node, bool]) -> Surroundings:
        return Surroundings(self.values | self.discrete, self.time, sides, self, self.maths)

    def candidates(self) -> list[tuple[dict[str, str], dict[Node, bool], Slots]]:
        """All configurations that are admissible just after now, with different motions."""
        options = self.options()
        if math.prod(len(o) for o in options.values()) > 300:
            raise Stop("unclear: too many configurations")
        found = []
        for combination in itertools.product(*options.values()):
            config = dict(zip(options, combination))
            tape, watch = self.tape(config)
            for sides in self.sides_of(tape):
                c = series(tape, [self.x[k] for k in self.names], self.surroundings(sides), LOOK)
                if c is None:
                    continue
                if all(
                    lead(c[s], self.tol) in (0, 1 if sides[e] else -1) for e, s in tape.switches.items()
                ) and all(
                    lead(c[slot], self.tol) >= 0
                    for kind, _, _, slot in watch
                    if kind not in ("guard", "monitor")
                ):
                    found.append((config, sides, c))
                    break
        return self.distinct(found)

    def firm_together(self) -> list[str]:
        """The contacts that were below their limits, and are if all of these hold: they have no cause to let go."""
        modes = {name: options[0] for name, options in self.options().items()}
        held = modes | {f: "stick" for f in self.firm if "stick" in self.options()[f]}
        tape, watch = self.tape(held)
        c = series(tape, [self.x[k] for k in self.names], self.surroundings(self.sides_of(tape)[0]), LOOK)
        limits = {(f, n): slot for kind, f, n, slot in watch if kind == "limit"}
        firm = [f for f in sorted(self.firm) if held[f] == "stick"]
        return [] if c is None else [f for f in firm if all(c[limits[f, n]][0] > self.tol for n in "+-")]

    def distinct(self, found: list[Any]) -> list[Any]:
        """Admissible candidates without those that rest on less priority or are the same motion."""
        together = [c for c in found if all(c[0][f] == "stick" for f in self.firm)]
        for f in self.firm_together() if len(found) > 1 and not together else ():
            held = [c for c in found if c[0][f] == "stick"]
            found = held or found
        found = together or found
        configs = [c[0] for c in found]

        def outranked(config: dict[str, str]) -> bool:
            return any(
                config[f] in ("slip+", "slip-") and config | {f: "stick"} in configs for f in self.m.contacts
            )

        kept: list[Any] = []
        for candidate in found:
            if outranked(candidate[0]):
                continue
            if not any(self.same(candidate[2], other[2]) for other in kept):
                kept.append(candidate)
        return kept

    def same(self, a: Slots, b: Slots) -> bool:
        return all(
            abs(p - q) <= 1e-7 * (1 + abs(p)) for k in range(len(self.names)) for p, q in zip(a[k], b[k])
        )
