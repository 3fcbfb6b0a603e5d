"""The motion of an abstract model by definition: series in each configuration, modes by enumeration, plainly."""

from __future__ import annotations

from typing import Any

from .blows import blow
from .configurations import Configurations
from .roots import GRAZE, first_negative, horner, lead
from .series import Slots, series
from .values import Motion, Stop

MOST_EVENTS = 400


class Judge(Configurations):
    """A run of one abstract model with one set of numbers."""

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
                self.look_for_borders(watch, c)
                if self.monitors(watch, c):
                    continue
                return
            self.transitions(fired)
        raise Stop("cascade")

    def look_for_borders(self, watch: list[tuple[str, str, str, int]], c: Slots) -> None:
        """Note where static friction above kinetic holds a load that is and stays just at its limit.

        In decimals this is certain; in doubles, the numbers themselves decide by how they are rounded.
        """
        for kind, f, _, slot in watch:
            contact = self.m.contacts.get(f)
            if kind == "limit" and contact and contact.mu_k and all(abs(v) <= self.tol for v in c[slot]):
                self.motion.borders.append(float(self.time))

    def note(self, owner: str, what: str) -> None:
        self.motion.events.append((float(self.time), owner, what))
        self.motion.jumps.append(float(self.time))
        if len(self.motion.events) > MOST_EVENTS:
            raise Stop("unclear: too many events")

    def transitions(self, fired: list[tuple[str, str]]) -> None:
        """All transitions of a round, each from the values before."""
        changes: list[tuple[str, Any, bool]] = []
        went: dict[str, str] = {}
        before = dict(self.modes)
        for a, g in fired:
            if a in went:  # of guards that are negative already the order of declaration decides
                guards = self.m.automata[a].modes[before[a]].guards
                if any(self.value(guards[name].expr) >= -self.tol for owner, name in fired if owner == a):
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
            if sign == old:
                continue
            self.signs[w] = sign
            if not old or (monitor.direction, old) in (
                ("up", 1),
                ("down", -1),
            ):  # it leaves the side that it had
                continue
            if abs(self.before.get(w, 0)) > 1e-6:
                self.doubt(f"monitor {w} is jumped across")
            self.note(w, "up" if old < 0 else "down")
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
                if self.is_due():
                    self.resolve_before()
                self.scheduled()
            self.resolve()
        except Stop as stop:
            status, _, self.motion.message = str(stop).partition(": ")
            self.motion.status = status
        self.motion.end = float(self.time)
        return self.motion

    def is_due(self) -> bool:
        """Whether a schedule fires now; where signals alone change, zeros are judged on what begins there."""
        firings = (at for s in self.m.schedules.values() for at in self.firings(s))
        return any(abs(at - self.time) <= self.tol for at in firings)

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
                if float(row[k]):
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
        elif any(
            abs(horner(row, first)) <= GRAZE * max(map(abs, row)) > self.tol for _, row, sign in slots if sign
        ):
            self.motion.near.append(float(self.time))
