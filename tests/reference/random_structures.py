"""Random masses with springs, forcing, friction, relays, stops, automata and monitors: as model files and as plans.

A structure is a model file whose numbers are parameters, so that all its draws share one compiled model. A draw is
values of these and an initial state, and the same as a `Plan` of time stepping, which is written down here a second
time from the numbers and not taken from the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from reference.stepped_structures import (
    BILINEAR,
    FRICTION,
    HYSTERESIS,
    KICK,
    RELAY,
    SATURATION,
    STOP,
    THERMOSTAT,
    Plan,
)

Values = dict[str, float]
LAWS = ("coulomb", "static-kinetic", "stribeck", "asymmetric", "viscous")
MACHINES = {
    BILINEAR: "bilinear",
    HYSTERESIS: "hysteresis",
    KICK: "kick",
    SATURATION: "saturation",
    THERMOSTAT: "thermostat",
}
END = 10.0  # of a run: some one to ten periods


@dataclass(frozen=True)
class Draw:
    """Values of the parameters, an initial state, and both as a plan."""

    params: Values
    start: dict[str, float]
    plan: Plan

    @property
    def positions(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of the masses at the start."""
        m = len(self.plan.mass)
        return np.array([self.start[f"x{i}"] for i in range(m)]), np.array(
            [self.start[f"v{i}"] for i in range(m)]
        )


@dataclass
class Element:
    """Friction, a relay or a stop: the positions that it is about, the names of its numbers, its law."""

    kind: int
    name: str
    row: np.ndarray
    law: str = ""
    has: tuple[str, ...] = ()
    masses: tuple[int, ...] = ()


@dataclass
class Structure:
    """What a random model has; `toml` is its file."""

    number: int
    masses: int
    uniform: dict[str, tuple[float, float]] = field(default_factory=dict)  # range of each parameter
    follow: list[Callable[[Values], None]] = field(default_factory=list)  # values that depend on others
    # masses (-1: ground) and the spring's name
    springs: list[tuple[int, int, str]] = field(default_factory=list)
    dampers: list[tuple[int, int, str]] = field(default_factory=list)
    forces: dict[int, list[str]] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    machines: list[tuple[int, str, int, int]] = field(default_factory=list)  # kind, name, acting on, seen
    terms: list[list[str]] = field(default_factory=list)  # of each mass's force
    tables: list[str] = field(default_factory=list)
    features: set[str] = field(default_factory=set)
    end_at: tuple[int, str] | None = None  # mass and parameter of a monitor that ends the run

    def number_of(self, name: str, low: float, high: float) -> str:
        """A parameter drawn evenly from a range."""
        self.uniform[name] = (low, high)
        return name

    @property
    def toml(self) -> str:
        """The model file."""
        usual = {name: 0.5 * sum(span) for name, span in self.uniform.items()}
        for then in self.follow:
            then(usual)
        out = [f'schema = 1\nname = "random-{self.number}"\n\n[parameters]']
        out += [f"{name} = {value!r}" for name, value in usual.items()]
        out.append("\n[states]")
        for i in range(self.masses):
            out.append(f'x{i} = {{ start = 0, der = "v{i}" }}')
            out.append(f'v{i} = {{ start = 0, der = "({" ".join(self.terms[i])})/m{i}" }}')
        for kind, name, _, seen in self.machines:
            if kind == THERMOSTAT:
                out.append(f'T = {{ start = 0, der = "{name}_u + {name}_c*x{seen} - T" }}')
        return "\n".join(out) + "\n\n" + "\n\n".join(self.tables) + "\n"

    def draw(self, rng: np.random.Generator) -> Draw:
        """Random numbers for all of it."""
        values = {name: float(rng.uniform(*span)) for name, span in self.uniform.items()}
        for then in self.follow:
            then(values)
        at_rest = rng.random() < 0.25
        start: dict[str, float] = {}
        for i in range(self.masses):
            start[f"x{i}"] = float(rng.normal() * 0.5)
            start[f"v{i}"] = 0.0 if at_rest else float(rng.normal())
        q = np.array([start[f"x{i}"] for i in range(self.masses)])
        for e in self.elements:
            if e.kind == STOP:  # the gap is open at first
                values[f"{e.name}_g"] = float(rng.uniform(0.05, 0.8)) - float(e.row @ q)
        if any(kind == THERMOSTAT for kind, *_ in self.machines):
            start["T"] = 0.0
        return Draw(values, start, self.plan(values))

    def plan(self, p: Values) -> Plan:
        """The numbers as arrays."""
        m, E, A = self.masses, len(self.elements), len(self.machines)
        matrices = []
        for links in (self.dampers, self.springs):
            matrix = np.zeros((m, m))
            for i, j, name in links:
                w = unit(m, i) - (unit(m, j) if j >= 0 else 0.0)
                matrix += p[name] * np.outer(w, w)
            matrices.append(matrix)
        waves = np.zeros((m, 6))
        for i, names in self.forces.items():
            for name in names:
                at = {"F": 0, "A": 1, "w": 2, "h": 3, "B": 4, "P": 5}[name[0]]
                waves[i, at] = p[name]
        waves[waves[:, 4] == 0.0, 5] = 1.0
        plan = Plan(
            np.array([p[f"m{i}"] for i in range(m)]),
            *matrices,
            waves,
            np.array([e.kind for e in self.elements], dtype=np.int64),
            *(
                np.zeros(shape)
                for shape in ((E, m), (E, m), E, (E, m), (E, 9), (E, m), (E, 2, 3, m), (E, 3), (A, 8))
            ),
        )
        for j, e in enumerate(self.elements):
            fill(plan, j, e, p)
        for k, (kind, name, acting, seen) in enumerate(self.machines):
            numbers = [p.get(f"{name}_{letter}", 0.0) for letter in "abdec"]
            plan.machines[k] = [kind, acting, seen, *numbers]
        return plan


def fill(plan: Plan, j: int, e: Element, p: Values) -> None:
    """Write one element's numbers down."""
    has = {key: p[f"{e.name}_{key}"] for key in e.has}
    if e.kind == RELAY:
        plan.rows[j, e.masses[0]] = has["b"]
        plan.shifts[j, e.masses[0]], plan.offsets[j] = has["a"], has["s"]
        for side, letter in enumerate("ud"):
            for n, i in enumerate(e.masses):
                plan.fields[j, side, 0, i] = has[f"{letter}{n}"]
                plan.fields[j, side, 1, i] = has.get(f"{letter}{n}q", 0.0)
                plan.fields[j, side, 2, i] = has.get(f"{letter}{n}v", 0.0)
        return
    plan.rows[j] = plan.paths[j] = e.row
    if e.kind == STOP:
        plan.offsets[j] = p[f"{e.name}_g"]
        plan.stops[j] = has["e"], has.get("B", 0.0), has.get("w", 0.0)
        return
    plan.offsets[j] = -has.get("belt", 0.0)
    kinetic = has.get("mk", has.get("mu", 0.0)), has.get("mk", has.get("mb", has.get("mu", 0.0)))
    static = (has["ms"], has["ms"]) if "ms" in has else kinetic
    plan.laws[j] = (
        *kinetic,
        *static,
        has.get("vs", 0.0),
        has.get("c", 0.0),
        has["L"],
        has.get("n", 0.0),
        has.get("w", 0.0),
    )
    if "k" in has:
        plan.load_rows[j, int(np.argmax(e.row))] = has["k"]


def unit(m: int, i: int) -> np.ndarray:
    """The i-th unit vector."""
    return np.eye(m)[i]


def structure(number: int, seed: int) -> Structure:
    """The structure of a number."""
    rng = np.random.default_rng([seed, number])
    s = Structure(number, int(rng.choice([1, 2, 3, 4], p=[0.35, 0.3, 0.2, 0.15])))
    s.terms = [[] for _ in range(s.masses)]
    s.features.add(f"{s.masses} masses" if s.masses > 1 else "1 mass")
    links(s, rng)
    forcing(s, rng)
    kinds = rng.permutation(["friction", "relay", "stop", "machine"])
    chosen = kinds[: int(rng.choice([1, 2, 3], p=[0.5, 0.35, 0.15]))]
    for kind in chosen:
        {"friction": contacts, "relay": relays, "stop": stops, "machine": automata}[str(kind)](s, rng)
    monitors(s, rng)
    return s


def links(s: Structure, rng: np.random.Generator) -> None:
    """Masses, springs and dampers; every mass hangs on something."""
    for i in range(s.masses):
        s.number_of(f"m{i}", 0.5, 2.0)
        pairs = [(i, -1)] if i == 0 or rng.random() < 0.4 else [(i, int(rng.integers(i)))]
        if i > 1 and rng.random() < 0.3:
            pairs.append((i, i - 1) if pairs[0][1] != i - 1 else (i, -1))
        for a, b in pairs:
            tail = f"{a}_{b}" if b >= 0 else f"{a}"
            link(s, s.springs, s.number_of(f"k{tail}", 1.0, 30.0), "x", a, b)
            if rng.random() < 0.7:
                link(s, s.dampers, s.number_of(f"c{tail}", 0.0, 0.8), "v", a, b)


def link(s: Structure, into: list[tuple[int, int, str]], name: str, letter: str, a: int, b: int) -> None:
    """A spring or a damper between two masses, or a mass and the ground."""
    into.append((a, b, name))
    other = f"({letter}{a} - {letter}{b})" if b >= 0 else f"{letter}{a}"
    s.terms[a].append(f"- {name}*{other}")
    if b >= 0:
        s.terms[b].append(f"+ {name}*{other}")


def forcing(s: Structure, rng: np.random.Generator) -> None:
    """Forces on some of the masses."""
    for i in range(s.masses):
        names = []
        if i == 0 or rng.random() < 0.4:
            if rng.random() < 0.3:
                names.append(s.number_of(f"F{i}", -2.0, 2.0))
                s.terms[i].append(f"+ F{i}")
            if rng.random() < 0.8:
                names += [
                    s.number_of(f"A{i}", 0.3, 6.0),
                    s.number_of(f"w{i}", 0.5, 5.0),
                    s.number_of(f"h{i}", -3.0, 3.0),
                ]
                s.terms[i].append(f"+ A{i}*sin(w{i}*t + h{i})")
                s.features.add("sine")
            if rng.random() < 0.2:
                names += [s.number_of(f"B{i}", 0.3, 4.0), s.number_of(f"P{i}", 0.7, 6.0)]
                s.terms[i].append(f"+ sq{i}")
                s.tables.append(
                    f'[inputs.sq{i}]\nkind = "wave"\nshape = "square"\namplitude = "B{i}"\nperiod = "P{i}"'
                )
                s.features.add("square wave")
        s.forces[i] = names


def contacts(s: Structure, rng: np.random.Generator) -> None:
    """One to three friction contacts, no two of them about one velocity."""
    taken: set[tuple[int, int]] = set()
    for number in range(int(rng.integers(1, 4))):
        a = int(rng.integers(s.masses))
        b = int(rng.integers(-1, s.masses))
        a, b = max(a, b), min(a, b)
        b = -1 if a == b else b
        if (a, b) in taken:
            continue
        taken.add((a, b))
        name, law = f"f{number}", str(rng.choice(LAWS))
        has = ["L"]
        s.number_of(f"{name}_L", 0.5, 4.0)
        velocity, load = (f"v{a} - v{b}" if b >= 0 else f"v{a}"), f"{name}_L"
        if b < 0 and rng.random() < 0.3:
            velocity += " - " + s.number_of(f"{name}_belt", -1.0, 1.0)
            has.append("belt")
        opens = ""
        if rng.random() < 0.2:
            load += f" + {s.number_of(f'{name}_n', 0.0, 0.9)}*sin({s.number_of(f'{name}_w', 0.5, 4.0)}*t)"
            s.follow.append(lambda p, name=name: p.update({f"{name}_n": p[f"{name}_n"] * p[f"{name}_L"]}))
            has += ["n", "w"]
            s.features.add("varying load")
        elif rng.random() < 0.15:
            load += f" + {s.number_of(f'{name}_k', 0.5, 3.0)}*x{a}"
            has.append("k")
            opens = "opens = true\n"
            s.features.add("load that vanishes")
        arguments = law_of(s, name, law, has)
        s.tables.append(
            f'[contacts.{name}]\nvelocity = "{velocity}"\nnormal = "{load}"\n{opens}'
            f'law = {{ name = "{law}", {arguments} }}'
        )
        s.terms[a].append(f"- {name}")
        if b >= 0:
            s.terms[b].append(f"+ {name}")
        row = unit(s.masses, a) - (unit(s.masses, b) if b >= 0 else 0.0)
        s.elements.append(Element(FRICTION, name, row, law, tuple(has)))
        s.features |= {law, "between bodies" if b >= 0 else "belt" if "belt" in has else "ground"}


def law_of(s: Structure, name: str, law: str, has: list[str]) -> str:
    """A law's arguments, with parameters of their own."""
    if law in ("static-kinetic", "stribeck"):
        s.number_of(f"{name}_ms", 0.2, 0.8)
        s.number_of(f"{name}_mk", 0.4, 0.95)  # of the static one
        s.follow.append(lambda p: p.update({f"{name}_mk": p[f"{name}_mk"] * p[f"{name}_ms"]}))
        has += ["ms", "mk"]
        arguments = f'mu_s = "{name}_ms", mu_k = "{name}_mk"'
        if law == "stribeck":
            s.number_of(f"{name}_vs", 0.1, 0.6)
            has.append("vs")
            arguments += f', v_s = "{name}_vs"'
        return arguments
    s.number_of(f"{name}_mu", 0.1, 0.8)
    has.append("mu")
    if law == "asymmetric":
        s.number_of(f"{name}_mb", 0.1, 0.8)
        has.append("mb")
        return f'mu_forward = "{name}_mu", mu_backward = "{name}_mb"'
    if law == "viscous":
        s.number_of(f"{name}_c", 0.0, 0.6)
        has.append("c")
        return f'mu = "{name}_mu", c = "{name}_c"'
    return f'mu = "{name}_mu"'


def relays(s: Structure, rng: np.random.Generator) -> None:
    """One or two switching surfaces, each with a field on either side."""
    for number in range(int(rng.choice([1, 2], p=[0.75, 0.25]))):
        name, i = f"r{number}", int(rng.integers(s.masses))
        if any(e.kind == RELAY and e.masses[0] == i for e in s.elements):
            continue
        masses = [i]
        if s.masses > 1 and rng.random() < 0.4:
            masses.append(int((i + rng.integers(1, s.masses)) % s.masses))
        has = ["a", "b", "s"]
        s.number_of(f"{name}_a", 0.3, 3.0)
        s.number_of(f"{name}_b", 0.3, 1.5)
        s.number_of(f"{name}_s", -0.5, 0.5)
        sides: list[list[str]] = [[], []]
        draws = rng.random() < 0.8  # towards the surface
        with_states = rng.random() < 0.4
        for n, at in enumerate(masses):
            s.terms[at].append(f"+ {name}_z{n}")
            for side, letter in enumerate("ud"):
                key = f"{letter}{n}"
                low, high = (0.2, 4.0) if (side == 1) == draws else (-4.0, -0.2)
                s.number_of(f"{name}_{key}", low, high)
                has.append(key)
                text = f"{name}_{key}"
                if with_states:
                    s.number_of(f"{name}_{key}q", -2.0, 2.0)
                    s.number_of(f"{name}_{key}v", -0.5, 0.3)
                    has += [f"{key}q", f"{key}v"]
                    text += f" + {name}_{key}q*x{at} + {name}_{key}v*v{at}"
                sides[side].append(f'{name}_z{n} = "{text}"')
        s.tables.append(
            f'[surfaces.{name}]\nexpr = "{name}_a*x{i} + {name}_b*v{i} + {name}_s"\n'
            f"above = {{ {', '.join(sides[0])} }}\nbelow = {{ {', '.join(sides[1])} }}"
        )
        s.elements.append(Element(RELAY, name, unit(s.masses, i), "", tuple(has), tuple(masses)))
        s.features |= {"relay that draws" if draws else "relay that repels"} | (
            {"fields of states"} if with_states else set()
        )


def stops(s: Structure, rng: np.random.Generator) -> None:
    """One or two unilateral contacts: walls, moving ones among them, and pairs of masses."""
    for number in range(int(rng.choice([1, 2], p=[0.7, 0.3]))):
        name, a = f"p{number}", int(rng.integers(s.masses))
        b = int(rng.integers(-1, a)) if a > 0 else -1
        if any(e.kind == STOP and (e.row[a] != 0.0 or (b >= 0 and e.row[b] != 0.0)) for e in s.elements):
            continue
        sign = 1 if rng.random() < 0.5 else -1
        plus = "" if sign > 0 else "-"
        s.number_of(f"{name}_g", 0.5, 1.0)
        s.number_of(f"{name}_e", 0.0, 0.9)
        has = ["e"]
        gap = f"{name}_g {'+' if sign > 0 else '-'} x{a}"
        row = sign * unit(s.masses, a)
        if b >= 0:
            gap += f" {'-' if sign > 0 else '+'} x{b}"
            row = row - sign * unit(s.masses, b)
            s.terms[b].append(f"{'-' if sign > 0 else '+'} {name}")
            s.features.add("bodies that strike")
        elif rng.random() < 0.25:
            gap += f" - {s.number_of(f'{name}_B', 0.0, 0.05)}*sin({s.number_of(f'{name}_w', 1.0, 8.0)}*t)"
            has += ["B", "w"]
            s.features.add("wall that moves")
        else:
            s.features.add("wall")
        s.terms[a].append(f"{plus or '+'} {name}")
        s.tables.append(f'[impacts.{name}]\ngap = "{gap}"\nrestitution = "{name}_e"')
        s.elements.append(Element(STOP, name, row, "", tuple(has)))


def automata(s: Structure, rng: np.random.Generator) -> None:
    """One or two automata of different kinds."""
    for number, kind in enumerate(rng.permutation(list(MACHINES))[: int(rng.choice([1, 2], p=[0.7, 0.3]))]):
        name, acting, seen = f"u{number}", int(rng.integers(s.masses)), int(rng.integers(s.masses))
        tables, term = MACHINE[int(kind)](s, name, acting, seen, rng)
        s.machines.append((int(kind), name, acting, seen))
        s.tables.append(tables)
        if term:
            s.terms[acting].append(term)
        s.features.add(MACHINES[int(kind)])


def bilinear(s: Structure, name: str, acting: int, seen: int, rng: np.random.Generator) -> tuple[str, str]:
    a, b = s.number_of(f"{name}_a", 1.0, 40.0), s.number_of(f"{name}_b", -0.2, 0.6)
    return (
        f'[components.{name}.modes.off]\ninitial = true\nset = {{ {name}_u = "0" }}\n'
        f'guards.g = {{ expr = "{b} - x{seen}", then = "on" }}\n'
        f'[components.{name}.modes.on]\nset = {{ {name}_u = "{a}*(x{seen} - {b})" }}\n'
        f'guards.g = {{ expr = "x{seen} - {b}", then = "off" }}'
    ), f"- {name}_u"


def hysteresis(s: Structure, name: str, acting: int, seen: int, rng: np.random.Generator) -> tuple[str, str]:
    a = s.number_of(f"{name}_a", 0.3, 4.0)
    b, c = s.number_of(f"{name}_b", -0.5, -0.02), s.number_of(f"{name}_d", 0.02, 0.5)
    return switch(name, f'"{a}"', f"x{seen} - {b}", f"{c} - x{seen}"), f"+ {name}_u"


def switch(name: str, on: str, cold: str, warm: str) -> str:
    """An automaton that is off at first, with a variable that is zero then."""
    return (
        f'[components.{name}.modes.off]\ninitial = true\nset = {{ {name}_u = "0" }}\n'
        f'guards.g = {{ expr = "{cold}", then = "on" }}\n'
        f'[components.{name}.modes.on]\nset = {{ {name}_u = {on} }}\nguards.g = {{ expr = "{warm}", then = "off" }}'
    )


def kick(s: Structure, name: str, acting: int, seen: int, rng: np.random.Generator) -> tuple[str, str]:
    a, b = s.number_of(f"{name}_a", -0.3, 0.6), s.number_of(f"{name}_b", 0.2, 1.0)
    c, d = s.number_of(f"{name}_d", 0.0, 0.6), s.number_of(f"{name}_e", 0.02, 0.3)
    return (
        f"[components.{name}.modes.below]\ninitial = true\n"
        f'guards.g = {{ expr = "{a} - x{seen}", '
        f'then = [{{ to = "above", reset = {{ v{seen} = "{b}*v{seen} + {c}" }} }}] }}\n'
        f'[components.{name}.modes.above]\nguards.g = {{ expr = "x{seen} - {a} + {d}", then = "below" }}'
    ), ""


def saturation(s: Structure, name: str, acting: int, seen: int, rng: np.random.Generator) -> tuple[str, str]:
    a, b = s.number_of(f"{name}_a", 1.0, 15.0), s.number_of(f"{name}_b", 0.0, 2.0)
    c = s.number_of(f"{name}_d", 0.3, 3.0)
    signal = f"{a}*x{seen} + {b}*v{seen}"
    if rng.random() < 0.5:
        return f'[definitions]\n{name}_u = "min(max({signal}, -{c}), {c})"', f"- {name}_u"
    return (
        f'[components.{name}.modes.linear]\ninitial = true\nset = {{ {name}_u = "{signal}" }}\n'
        f'guards.high = {{ expr = "{c} - ({signal})", then = "high" }}\n'
        f'guards.low = {{ expr = "{signal} + {c}", then = "low" }}\n'
        f'[components.{name}.modes.high]\nset = {{ {name}_u = "{c}" }}\n'
        f'guards.g = {{ expr = "{signal} - {c}", then = "linear" }}\n'
        f'[components.{name}.modes.low]\nset = {{ {name}_u = "-{c}" }}\n'
        f'guards.g = {{ expr = "-({signal}) - {c}", then = "linear" }}'
    ), f"- {name}_u"


def thermostat(s: Structure, name: str, acting: int, seen: int, rng: np.random.Generator) -> tuple[str, str]:
    a = s.number_of(f"{name}_a", 1.5, 3.0)
    b, c = s.number_of(f"{name}_b", 0.3, 0.6), s.number_of(f"{name}_d", 0.8, 1.2)
    d = s.number_of(f"{name}_e", -2.0, 2.0)
    s.number_of(f"{name}_c", -0.3, 0.3)
    return switch(name, f'"{a}"', f"T - {b}", f"{c} - T"), f"+ {d}*T"


MACHINE = {
    BILINEAR: bilinear,
    HYSTERESIS: hysteresis,
    KICK: kick,
    SATURATION: saturation,
    THERMOSTAT: thermostat,
}


def monitors(s: Structure, rng: np.random.Generator) -> None:
    """Something that is only watched, or that ends the run."""
    if rng.random() < 0.3:
        at = int(rng.integers(s.masses))
        ends = rng.random() < 0.4
        level = s.number_of("level", 0.8, 2.0) if ends else s.number_of("level", -0.5, 0.5)
        s.tables.append(
            f'[monitors.m]\nexpr = "x{at} - {level}"\ndirection = "up"\naction = "{"terminate" if ends else "record"}"'
        )
        s.features.add("monitor that ends" if ends else "monitor")
        s.end_at = (at, level) if ends else None
