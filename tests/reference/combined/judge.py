"""The motion of an abstract model by definition: series in each configuration, modes by enumeration, plainly."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .blows import blow
from .forms import ZERO, Abstract, Node, lowered, node, parts_of, rate_of, replaced, var
from .roots import first_negative, horner, lead
from .series import Slots, Surroundings, Tape, series

ORDER = 18
LOOK = 6  # derivatives that are looked at where something is zero
MOST_EVENTS = 400


class Stop(Exception):
    """The motion ends here, or is not known beyond."""


class Doubles:
    """Arithmetic in doubles."""

    tol, order, last = 1e-9, ORDER, 1e-16
    sin, cos, sqrt = staticmethod(math.sin), staticmethod(math.cos), staticmethod(math.sqrt)

    @staticmethod
    def number(value: Fraction) -> Any:
        return value.numerator / value.denominator


class Digits:
    """Arithmetic in 40 digits."""

    tol, order, last = 1e-24, 36, 1e-36

    def __init__(self) -> None:
        import mpmath

        self.mp = mpmath.mp
        self.mp.dps = 40
        self.sin, self.cos, self.sqrt = mpmath.sin, mpmath.cos, mpmath.sqrt

    def number(self, value: Fraction) -> Any:
        return self.mp.mpf(value.numerator) / value.denominator


@dataclass
class Motion:
    """What the judge found."""

    status: str = "finished"
    message: str = ""
    end: float = 0.0
    pieces: list[tuple[Any, Any, list[list[Any]], dict[str, Any]]] = field(default_factory=list)
    events: list[tuple[float, str, str]] = field(default_factory=list)
    jumps: list[float] = field(default_factory=list)  # all instants at which something happened
    touches: list[tuple[float, str]] = field(default_factory=list)
    unclear: list[tuple[float, str]] = field(default_factory=list)

    def at(self, time: float, names: list[str]) -> dict[str, float]:
        """States and discrete states at a time."""
        for t, h, rows, discrete in reversed(self.pieces):
            if t <= time:
                values = {n: float(horner(row, time - t)) for n, row in zip(names, rows)}
                return {**values, **{k: float(v) for k, v in discrete.items()}}
        raise ValueError(time)


class Judge:
    """A run of one abstract model with one set of numbers."""

    def __init__(self, model: Abstract, numbers: dict[str, Fraction], maths: Any = None, nudge: float = 0.0):
        self.m, self.maths = model, maths or Doubles()
        self.tol = self.maths.tol
        self.names = list(model.states)
        self.values: dict[Any, Any] = {k: self.maths.number(v) for k, v in numbers.items()}
        self.rates = {k: lowered(rate) for k, (_, rate) in model.states.items()}
        self.time: Any = self.maths.number(Fraction(0))
        self.x = {k: self.value(start) for k, (start, _) in model.states.items()}
        if nudge:
            self.x = {k: v + nudge * (1 + 0.3 * i) for i, (k, v) in enumerate(self.x.items())}
        self.discrete = {k: self.value(start) for k, start in model.discrete.items()}
        self.modes = {k: a.initial for k, a in model.automata.items()}
        self.config: dict[str, str] = {}
        self.tapes: dict[Any, tuple[Tape, list[tuple[str, str, str, int]]]] = {}
        self.signs: dict[str, int] = {}
        self.motion = Motion()
        self.before: dict[str, Any] = {}
        self.knots: dict[str, list[list[Any]]] = {}
        self.firm: set[str] = set()  # contacts that stick and are not at their limit

    # -- values ----------------------------------------------------------------------------------------------------

    def value(self, e: Node, forces: dict[str, Any] | None = None) -> Any:
        """The value of an expression now; forces that are not given are zero."""
        op, a = e.op, e.args
        if op == "const":
            return self.maths.number(a[0])
        if op == "num":
            return self.values[a[0]]
        if op == "var":
            return self.of_name(a[0], forces)
        if op == "t":
            return self.time
        if op == "window":
            return self.value(a[1] if self.holds(a[0]) else a[2], forces)
        if op in ("table", "slope"):
            return self.table(a[0])[op == "slope"]
        first = self.value(a[0], forces)
        if op == "neg":
            return -first
        if op == "abs":
            return abs(first)
        if op in ("sin", "cos", "sqrt"):
            return getattr(self.maths, op)(first)
        if op == "if":
            return self.value(a[1] if first > 0 else a[2], forces)
        second = self.value(a[1], forces)
        if op == "div":
            return first / second
        return {
            "add": lambda: first + second,
            "sub": lambda: first - second,
            "mul": lambda: first * second,
            "max": lambda: max(first, second),
            "min": lambda: min(first, second),
        }[op]()

    def of_name(self, name: str, forces: dict[str, Any] | None) -> Any:
        if forces and name in forces:
            return forces[name]
        for known in (self.x, self.discrete):
            if name in known:
                return known[name]
        for a, mode in self.modes.items():
            sets = self.m.automata[a].modes[mode].sets
            if name in sets:
                return self.value(sets[name], forces)
        return 0

    def holds(self, c: tuple[Any, ...]) -> bool:
        """Whether a condition on time holds just after now."""
        if c[0] == "and":
            return self.holds(c[1]) and self.holds(c[2])
        if c[0] == "or":
            return self.holds(c[1]) or self.holds(c[2])
        if c[0] == "not":
            return not self.holds(c[1])
        at = self.value(c[1])
        if c[0] == "after":
            return self.time >= at - self.tol
        if c[0] == "before":
            return self.time < at - self.tol
        width = self.value(c[2])
        return at - width - self.tol <= self.time < at + width - self.tol

    def table(self, name: str) -> tuple[Any, Any]:
        """Value and slope of a table just after now."""
        if name not in self.knots:
            self.knots[name] = [[self.value(e) for e in row] for row in self.m.tables[name]]
        times, values = self.knots[name]
        for i in range(len(times) - 2, -1, -1):
            if times[i + 1] > times[i] and self.time >= times[i] - self.tol:
                slope = (values[i + 1] - values[i]) / (times[i + 1] - times[i])
                return values[i] + slope * (self.time - times[i]), slope
        raise Stop("unclear: before the table")

    # -- known times -----------------------------------------------------------------------------------------------

    def known_times(self) -> list[Any]:
        """All times at which something jumps in plain time, or a schedule fires."""
        end = self.m.duration
        times: list[Any] = []
        for test in self.all_tests():
            kind, *rest = test
            at = self.value(rest[0])
            width = self.value(rest[1]) if kind == "near" else 0
            times += [at - width, at + width]
        for knots, _ in self.m.tables.values():
            times += [self.value(e) for e in knots]
        for s in self.m.schedules.values():
            times += self.firings(s)
        out: list[Any] = []
        for t in sorted(times):
            if self.tol < t < end - self.tol and (not out or t - out[-1] > self.tol):
                out.append(t)
        return out + [self.maths.number(Fraction(end))]

    def firings(self, s: Any) -> list[Any]:
        if s.period is None:
            return [self.value(e) for e in s.times]
        first, period = self.value(s.times[0]), self.value(s.period)
        return [first + k * period for k in range(int((self.m.duration - first) / period + 2))]

    def all_tests(self) -> list[tuple[Any, ...]]:
        """The single conditions on time in all expressions."""

        def single(c: tuple[Any, ...]) -> list[tuple[Any, ...]]:
            return single(c[1]) + (single(c[2]) if len(c) > 2 else []) if c[0] in ("and", "or", "not") else [c]

        m = self.m
        whole = [e for s in m.states.values() for e in s] + list(m.relays.values())
        for c in m.contacts.values():
            whole += [c.velocity, c.normal, c.mu_s] + ([c.mu_k] if c.mu_k else [])
        whole += [i.gap for i in m.impacts.values()] + [w.expr for w in m.monitors.values()]
        for a in m.automata.values():
            for mode in a.modes.values():
                whole += [g.expr for g in mode.guards.values()] + list(mode.rates.values()) + list(mode.sets.values())
        return [t for e in whole for p in parts_of(e) if p.op == "window" for t in single(p.args[0])]

    # -- configurations --------------------------------------------------------------------------------------------

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
        for f, c in m.contacts.items():
            loads[f] = replaced(lowered(c.normal), names)
        for f, c in m.contacts.items():
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
            out[f] = ["slip+"] if v > self.tol else ["slip-"] if v < -self.tol else ["stick", "slip+", "slip-"]
            if c.opens:
                out[f] = out[f] + ["open"]
        for p, i in self.m.impacts.items():
            free = self.value(i.gap) > self.tol or self.gap_rate(p) > self.tol
            out[p] = ["open"] if free else ["closed", "open"]
        for r, e in self.m.relays.items():
            s = self.value(e)
            out[r] = ["above"] if s > self.tol else ["below"] if s < -self.tol else ["sliding", "above", "below"]
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
                if all(lead(c[s], self.tol) in (0, 1 if sides[e] else -1) for e, s in tape.switches.items()) and all(
                    lead(c[slot], self.tol) >= 0 for kind, _, _, slot in watch if kind not in ("guard", "monitor")
                ):
                    found.append((config, sides, c))
                    break
        return self.distinct(found)

    def distinct(self, found: list[Any]) -> list[Any]:
        """Admissible candidates without those that rest on less priority or are the same motion."""
        for f in self.firm:
            held = [c for c in found if c[0][f] == "stick"]
            found = held or found
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

    # -- instants --------------------------------------------------------------------------------------------------

    def resolve(self) -> None:
        """Impulses, modes and transitions of this instant, until nothing changes."""
        for _ in range(60):
            if self.m.impacts and blow(self):
                self.note("impact", "blow")
                continue
            found = self.candidates()
            if not found:
                raise Stop("inconsistent: nothing is admissible")
            if len(found) > 1:
                raise Stop("nonunique: " + "; ".join(str(list(c[0].values())) for c in found))
            config, sides, c = found[0]
            _, watch = self.tape(config)
            fired = [(a, g) for kind, a, g, slot in watch if kind == "guard" and lead(c[slot], self.tol) < 0]
            if not fired:
                for name, mode in config.items():
                    if self.config.get(name, mode) != mode:
                        self.note(name, mode)
                self.config, self.sides = config, sides
                if self.monitors(watch, c):
                    continue
                return
            self.transitions(fired)
        raise Stop("cascade")

    def note(self, owner: str, what: str) -> None:
        self.motion.events.append((float(self.time), owner, what))
        self.motion.jumps.append(float(self.time))
        if len(self.motion.events) > MOST_EVENTS:
            raise Stop("unclear: too many events")

    def transitions(self, fired: list[tuple[str, str]]) -> None:
        """All transitions of a round, each from the values before."""
        changes: list[tuple[str, Any, bool]] = []
        went: dict[str, str] = {}
        for a, g in fired:
            if a in went:
                self.doubt("two guards of one mode at once")
                continue
            for choice in self.m.automata[a].modes[self.modes[a]].guards[g].choices:
                if choice.when is not None:
                    value = self.value(choice.when)
                    if abs(value) <= self.tol:
                        self.doubt("a condition at its border")
                    if value <= 0:
                        continue
                went[a] = choice.to
                changes += [(k, self.value(e), False) for k, e in choice.reset.items()]
                changes += [(k, self.value(e), True) for k, e in choice.adds.items()]
                self.note(a, f"{g} -> {choice.to}")
                break
        self.modes |= went
        self.change(changes)

    def change(self, changes: list[tuple[str, Any, bool]]) -> None:
        """Set and add; what sets one variable twice must agree."""
        sums: dict[str, Any] = {}
        values: dict[str, Any] = {}
        for name, value, adds in changes:
            if adds:
                sums[name] = sums.get(name, 0) + value
            elif name in values and abs(values[name] - value) > self.tol:
                raise Stop("inconsistent: two resets of one variable disagree")
            else:
                values[name] = value
        for name in sums:
            if name in values:
                raise Stop("inconsistent: a variable is set and added to at once")
            values[name] = self.of_name(name, None) + sums[name]
        for name, value in values.items():
            (self.x if name in self.x else self.discrete)[name] = value

    def monitors(self, watch: list[tuple[str, str, str, int]], c: Slots) -> bool:
        """Record the monitors whose side has changed; whether one of them reset something."""
        changes = []
        for kind, w, _, slot in watch:
            if kind != "monitor":
                continue
            sign, old, monitor = lead(c[slot], self.tol), self.signs.get(w, 0), self.m.monitors[w]
            if not sign or sign == old:
                continue
            self.signs[w] = sign
            if not old or (monitor.direction, sign) in (("up", -1), ("down", 1)):
                continue
            if abs(self.before.get(w, 0)) > 1e-6:
                self.doubt(f"monitor {w} is jumped across")
            self.note(w, "up" if sign > 0 else "down")
            if monitor.action == "terminate":
                raise Stop("terminated")
            changes += [(k, self.value(e), False) for k, e in monitor.reset.items()]
        self.change(changes)
        return bool(changes)

    def doubt(self, why: str) -> None:
        self.motion.unclear.append((float(self.time), why))

    def scheduled(self) -> None:
        """The resets of schedules that fire now."""
        changes = []
        for name, s in self.m.schedules.items():
            for at in self.firings(s):
                if abs(at - self.time) <= self.tol:
                    self.note(name, "fires")
                    changes += [(k, self.value(e), False) for k, e in s.reset.items()]
                    changes += [(k, self.value(e), True) for k, e in s.adds.items()]
        self.change(changes)

    # -- the run ---------------------------------------------------------------------------------------------------

    def run(self) -> Motion:
        """The motion to the end of the model's duration, or as far as it is known."""
        try:
            self.scheduled()
            times = self.known_times()
            for at in times:
                self.resolve()
                while self.time < at:
                    self.step(at)
                    if self.time < at:
                        self.resolve()
                self.motion.jumps.append(float(at))
                self.resolve_before()
                self.scheduled()
            self.resolve()
        except Stop as stop:
            status, _, self.motion.message = str(stop).partition(": ")
            self.motion.status = status
        self.motion.end = float(self.time)
        return self.motion

    def resolve_before(self) -> None:
        """What is zero at a known time without its jump happens with the signals as they were."""
        at = self.time
        self.time = at - 2 * self.tol
        try:
            moved = self.time
            self.resolve()
            assert self.time is moved
        finally:
            self.time = at

    def step(self, at: Any) -> None:
        """Follow the motion to the next zero of anything, the end of its series, or ``at``."""
        tape, watch = self.tape(self.config)
        c = series(tape, [self.x[k] for k in self.names], self.surroundings(self.sides), self.maths.order)
        if c is None:
            raise Stop("unclear: the forces are not determined")
        slots = [(s, c[s], 1 if self.sides[e] else -1) for e, s in tape.switches.items()]
        slots += [(slot, c[slot], 1) for kind, _, _, slot in watch if kind != "monitor"]
        slots += [(slot, c[slot], self.signs.get(w, 0)) for kind, w, _, slot in watch if kind == "monitor"]
        h = at - self.time
        n = self.maths.order
        for row in [c[k] for k in range(len(self.names))] + [row for _, row, _ in slots]:
            size = max(1.0, max(abs(float(v)) for v in row[:3]))
            for k in (n, n - 1):
                if row[k]:
                    h = min(h, (self.maths.last * size / abs(float(row[k]))) ** (1 / k))
        first, hit = h, False
        for _, row, sign in slots:
            if not sign:
                continue
            s, touch = first_negative(row if sign > 0 else [-v for v in row], h, self.tol)
            if touch is not None and touch <= first:
                self.motion.touches.append((float(self.time) + touch, "touch"))
            if s is not None and s <= first:
                first, hit = s, True
        self.motion.pieces.append(
            (self.time, first, [c[k] for k in range(len(self.names))], dict(self.discrete))
        )
        self.x = {k: horner(c[i], first) for i, k in enumerate(self.names)}
        self.before = {w: horner(c[slot], first) for kind, w, _, slot in watch if kind == "monitor"}
        limits = {(f, n): horner(c[slot], first) for kind, f, n, slot in watch if kind == "limit"}
        self.firm = {f for f, _ in limits if all(limits[f, n] > 1e-7 for n in "+-")}
        self.time = at if not hit and first >= at - self.time else self.time + first
        if hit:
            self.motion.jumps.append(float(self.time))
