"""The parts that random models are made of; each adds states and components and says which forms it used."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from .builder import Builder
from .forms import (
    TIME, Automaton, Choice, Contact, Guard, Impact, Mode, Monitor, Node, Schedule, abs_, max_, min_, node, sin, sqrt, var,
)


def drifter(b: Builder) -> Node:
    """A state of the first order: constant speed, decay, a sine, switched in time."""
    kind = b.rng.choice(["constant", "decay", "force", "corner"])
    start = b.num(-2, 2)
    if kind == "constant":
        return b.state("x", start, b.either(b.num("0.3", "1.5")))
    if kind == "decay":
        return b.state("x", start, b.num(-2, 2) - b.num("0.3", 2) * var(f"x{b.count.get('x', 0) + 1}"))
    if kind == "force":
        return b.state("x", start, b.force())
    b.tag("corner in rate")
    me = var(f"x{b.count.get('x', 0) + 1}")
    return b.state("x", start, b.num(-1, 1) - b.corner(me, "rate"))


def counter(b: Builder) -> Node:
    name = b.name("n")
    b.m.discrete[name] = node(0)
    return var(name)


def automaton(b: Builder) -> None:
    """Two modes with corners in their guards, resets, conditions, a counter."""
    b.tag("automaton")
    x, n, name = drifter(b), counter(b), b.name("auto")
    other = drifter(b)
    there = Choice("two", reset={n.args[0]: n + 1})
    if b.chance(0.5):
        there.reset[other.args[0]] = b.num(-2, 2) if b.chance(0.5) else b.corner(other, "reset")
        b.tag("reset of a state")
    choices = [there]
    if b.chance(0.3):
        b.tag("condition of a transition")
        choices = [Choice("two", when=b.corner(other, "condition"), reset={n.args[0]: n + 2})] + choices
    one = Mode({"g": Guard(b.corner(x, "guard", 2), choices)})
    two = Mode({"g": Guard(b.corner(b.rng.choice([x, other]), "guard", 2), [Choice("one", reset={n.args[0]: n + 1})])})
    if b.chance(0.5):
        b.tag("mode with its own rates")
        one.rates[other.args[0]], two.rates[other.args[0]] = b.num(-1, 1), b.num(-1, 1)
    b.m.automata[name] = Automaton({"one": one, "two": two}, "one")


def single_guard(b: Builder) -> None:
    """A guard that fires once and for all, also from a start on it, written with the start's own numbers."""
    b.tag("automaton")
    x, n, name = drifter(b), counter(b), b.name("auto")
    if b.chance(0.5):
        b.tag("start on a guard")
        p, q = b.num(-2, 2, 40), b.num("0.1", "0.7", 6)
        start = p + q
        b.m.states[x.args[0]] = start, b.m.states[x.args[0]][1]
        expr = b.either(x - start)
    else:
        expr = b.corner(x, "guard", 2)
    b.m.automata[name] = Automaton(
        {"on": Mode({"g": Guard(expr, [Choice("off", reset={n.args[0]: n + 1})])}), "off": Mode()}, "on"
    )


def thermostat(b: Builder) -> None:
    """Two modes that set a variable; guards may have corners."""
    b.tag("automaton", "variable of a mode")
    y = b.state("y", b.num("-0.4", "0.4"), 0)
    u, name = b.name("u"), b.name("auto")
    b.m.states[y.args[0]] = b.m.states[y.args[0]][0], var(u) - b.num(0, "0.5") * y
    high, low = b.num("0.5", 1), b.num(-1, "-0.5")
    up, down = high - y, y - low
    if b.chance(0.5):
        b.tag("min", "in guard")
        up = min_(high - y, b.num(1, 2) - node("0.3") * y)
    b.m.automata[name] = Automaton(
        {
            "up": Mode({"g": Guard(up, [Choice("down")])}, sets={u: b.num(1, 3)}),
            "down": Mode({"g": Guard(down, [Choice("up")])}, sets={u: -b.num(1, 3)}),
        },
        "up",
    )


def rival_guards(b: Builder) -> None:
    """Two guards that are negative just after a reset; the one declared first decides, or nothing does."""
    b.tag("automaton", "two guards at once")
    a = b.state("x", b.num("-1.5", "-0.5"), -b.num("0.5", "1.5"))
    z = b.state("x", b.num("-1.5", "-0.5"), -b.num("0.5", "1.5"))
    guards = [("ga", Guard(node("0.1") - a, [Choice("A")])), ("gb", Guard(z, [Choice("B")]))]
    b.rng.shuffle(guards)
    first = {"g": Guard(a + b.num("1.6", "2.5"), [Choice("second", reset={a.args[0]: b.num("0.5", "0.9")})])}
    if b.chance(0.5):
        first = {"never": Guard(abs_(a) + 1, [Choice("second")])} | first
    modes = {"first": Mode(first), "second": Mode(dict(guards)),
             "A": Mode(rates={z.args[0]: node(2)}), "B": Mode(rates={z.args[0]: node(-2)})}
    b.m.automata[b.name("auto")] = Automaton(modes, "first")


def sampled(b: Builder) -> None:
    """A located value is copied and compared with the threshold that it was located at."""
    b.tag("automaton", "copy of a located value")
    c, w = b.num("0.3", 1), b.num("0.5", 3)
    x = b.state("x", b.num(-1, 0), b.num("0.6", "1.2") + (node("0.4") * sin(w * TIME) if b.chance(0.6) else 0))
    y = b.state("y", b.num(-1, 1), 0)
    n = counter(b)
    fall = b.num("0.3", 1) * b.rng.choice([-1, -1, 1])
    copy = b.rng.choice([x, x, x + x - c, 2 * x - x])
    b.m.automata[b.name("auto")] = Automaton(
        {
            "wait": Mode({"g": Guard(c - x, [Choice("held", reset={y.args[0]: copy, n.args[0]: n + 1})])}),
            "held": Mode({"g": Guard(c - y, [Choice("done", reset={n.args[0]: n + 1})])}, rates={y.args[0]: fall}),
            "done": Mode(),
        },
        "wait",
    )


def twins(b: Builder) -> None:
    """Two automata with the same numbers reach their guards together and add to one variable."""
    b.tag("automaton", "several at one instant", "resets that add")
    start, speed, n = b.num("0.2", 1), b.num("0.3", 1), counter(b)
    for _ in range(2):
        x = b.state("x", start, -speed)
        b.m.automata[b.name("auto")] = Automaton(
            {"run": Mode({"g": Guard(x, [Choice("run", reset={x.args[0]: start}, adds={n.args[0]: node(1)})])})}, "run"
        )


def doses(b: Builder) -> None:
    """Schedules and clocks that fire together and add to one state."""
    b.tag("schedule", "several at one instant", "resets that add")
    gut = b.state("gut", 0, 0)
    b.m.states[gut.args[0]] = node(0), -(b.num("0.5", 2) * gut)
    at, every = b.num("0.2", 1), b.num("0.5", 1)
    b.m.schedules[b.name("sched")] = Schedule([at, at + every], adds={gut.args[0]: b.num(1, 3)})
    if b.chance(0.5):
        b.tag("clock")
        b.m.schedules[b.name("sched")] = Schedule([at], adds={gut.args[0]: b.num(1, 3)}, period=every)
    else:
        b.m.schedules[b.name("sched")] = Schedule([at + every], adds={gut.args[0]: b.num(1, 3)})


def tick_on_guard(b: Builder) -> None:
    """A guard whose zero falls on the tick of a clock or a schedule that has to do with other variables."""
    b.tag("clock", "automaton", "several at one instant")
    start, speed, period = b.num(-1, 1), b.num("0.3", 1), b.num("0.2", 1)
    x, n, y = b.state("x", start, speed), counter(b), b.state("y", 0, b.num(-1, 1))
    k, other = b.rng.choice([1, 2, 3]), b.rng.choice([{y.args[0]: node(0)}, {y.args[0]: b.num(-1, 1)}])
    reset = b.chance(0.5)
    if reset:
        b.tag("tick that moves what is at its guard")
        k, other = 1, {x.args[0]: start}
    level = b.derived(start + speed * (k * period))
    then = [Choice("off", reset={n.args[0]: n + 1})]
    if not reset and b.chance(0.5):
        then = [Choice("on", reset={x.args[0]: start, n.args[0]: n + 1})]
    b.m.automata[b.name("auto")] = Automaton({"on": Mode({"g": Guard(level - x, then)}), "off": Mode()}, "on")
    b.m.schedules[b.name("clock")] = Schedule([period if reset else b.rng.choice([node(0), period])], other, period=period)


def two_clocks(b: Builder) -> None:
    """Two clocks that tick together and set one state to one value, written in two ways."""
    b.tag("clock", "several at one instant")
    p, q, period = b.num("0.1", 1), b.num("0.1", "0.7", 6), b.num("0.3", 1)
    y = b.state("y", 0, b.num(-1, 1))
    b.m.schedules[b.name("clock")] = Schedule([period], {y.args[0]: p}, period=period)
    b.m.schedules[b.name("clock")] = Schedule([period], {y.args[0]: (p + q) - q}, period=period)


def monitor_at_reset(b: Builder) -> None:
    """A monitor whose zero is that of a guard; the reset carries it back; a clock may tick at the same instant."""
    b.tag("monitor", "automaton", "several at one instant")
    start, speed, n = b.num("0.3", 1), b.num("0.3", 1), counter(b)
    x = b.state("x", start, -speed)
    b.m.automata[b.name("auto")] = Automaton(
        {"run": Mode({"g": Guard(x, [Choice("run", reset={x.args[0]: start, n.args[0]: n + 1})])})}, "run")
    b.m.monitors[b.name("mon")] = Monitor(x if b.chance(0.5) else x * b.num(1, 2), b.rng.choice(["down", "both"]),
                                          b.rng.choice(["record", "terminate"]))
    if b.chance(0.6):
        b.tag("clock")
        k = counter(b)
        b.m.schedules[b.name("clock")] = Schedule([node(0)], {k.args[0]: k + 1}, period=b.derived(start / speed))


def monitor(b: Builder) -> None:
    """A monitor of a function with corners that records, resets or ends the run."""
    b.tag("monitor")
    x, action = (b.other() if b.chance(0.5) else None) or drifter(b), b.rng.choice(["record", "record", "reset", "terminate"])
    n = counter(b)
    b.m.monitors[b.name("mon")] = Monitor(
        b.corner(x, "monitor", 2), b.rng.choice(["up", "down", "both"]), action,
        {n.args[0]: n + 1} if action == "reset" else {})


def clock(b: Builder) -> None:
    """A clock that samples a state or kicks one."""
    b.tag("clock")
    period = b.num("0.3", "1.2")
    source = b.other() or drifter(b)
    held = b.name("held")
    b.m.discrete[held] = node(0)
    y = b.state("y", 0, var(held))
    offset = b.rng.choice([node(0), period, b.num("0.1", "0.5")])
    b.tag("tick at the start" if offset == node(0) else "tick later")
    reset = {held: source}
    if b.chance(0.3):
        reset[y.args[0]] = b.num(-1, 1)
    b.m.schedules[b.name("clock")] = Schedule([offset], reset, period=period)


def kick(b: Builder) -> None:
    """A schedule that sets a state to the other side of what looks at it."""
    b.tag("schedule", "reset of a state")
    x = b.other() or drifter(b)
    b.m.schedules[b.name("sched")] = Schedule([b.moment()], {x.args[0]: b.num(-2, 2)})


def body(b: Builder, speed: Node | None = None) -> tuple[Node, Node]:
    """A mass with a force, perhaps a spring with a corner."""
    v = var(f"v{b.count.get('v', 0) + 1}")
    q = b.state("q", b.num(-1, 1), v)
    force = b.force()
    kind = b.rng.choice(["free", "spring", "corner"])
    if kind == "spring":
        force = force - b.num("0.5", 3) * q
    elif kind == "corner":
        b.tag("corner in rate")
        force = force - b.num("0.5", 3) * b.corner(q, "rate")
    start = speed if speed is not None else b.num(-2, 2)
    if start == node(0):
        b.tag("start at rest")
    return q, b.state("v", start, force)


def contact(b: Builder) -> None:
    """Dry friction on a body: loads, belts and coefficients with corners, jumps in time and other states."""
    b.tag("contact")
    rest = b.chance(0.4)
    q, v = body(b, node(0) if rest else None)
    f = b.name("f")
    b.add_rate(v, -var(f))
    about = b.rng.choice([q, drifter(b)])
    normal, opens = b.num(1, 3), False
    kind = b.rng.choice(["constant", "corner", "switched", "opens", "vanishes"])
    if kind == "corner":
        normal = b.positive(about, "load")
    elif kind == "switched":
        normal = b.switched(b.num(1, 3), b.rng.choice([node(0), b.num(1, 3)]), "load")
    elif kind == "opens":
        opens, normal = True, b.corner(about, "load")
        b.tag("contact that opens")
    elif kind == "vanishes":
        b.tag("max", "in load", "load that vanishes")
        normal = b.num(1, 3) * max_(-about, 0)
    mu = b.num("0.2", "0.8")
    mu_k = None
    if b.chance(0.4):
        b.tag("static above kinetic")
        mu_k, mu = mu, mu + b.num("0.1", "0.5")
    elif b.chance(0.3):
        mu = mu * b.positive(about, "law") * node("0.3")
    belt: Node = node(0)
    if b.chance(0.3):
        b.tag("belt")
        belt = b.num("-0.5", "0.5")
        if b.chance(0.4):
            belt = b.switched(belt, b.num("-0.5", "0.5"), "velocity")
        if rest:
            b.tag("start on a guard")
    b.m.contacts[f] = Contact(v - belt, normal, mu, mu_k, opens)


def elastic_floor(b: Builder) -> None:
    """A body on an elastic floor whose force is the load of friction."""
    b.tag("contact", "load that vanishes", "in load", "max")
    w = var(f"w{b.count.get('w', 0) + 1}")
    h = b.state("h", b.num("0.05", "0.3"), w)
    stiff = b.num(200, 1000)
    load = b.rng.choice([stiff * max_(-h, 0), max_(-(stiff * h), 0)])
    b.state("w", 0, load - node("9.81"))
    f = b.name("f")
    u = b.state("v", b.num(1, 3), -var(f))
    b.m.contacts[f] = Contact(u, load, b.num("0.1", "0.5"))


def level(b: Builder) -> Node:
    """A floor that moves by a table of time, with kinks and without jumps."""
    b.tag("input: table")
    name = b.name("tab")
    inner = sorted(b.rng.sample(range(5, 45), b.rng.randint(1, 3)))
    times = [node(-1), *(node(Fraction(k, 10)) for k in inner), node(6)]
    b.m.tables[name] = times, [node(Fraction(b.rng.randint(-5, 1), 10)) for _ in times]
    return Node("table", (name,))


def ball(b: Builder, e: Node | None = None) -> tuple[Node, Node, str]:
    """A body above a floor that may move."""
    b.tag("impact")
    w = var(f"w{b.count.get('w', 0) + 1}")
    h = b.state("h", b.num("0.2", 1), w)
    p = b.name("p")
    start = b.num(-1, 1)
    b.state("w", start, var(p) - b.num(2, 10))
    floor: Node = node(0)
    kind = b.rng.choice(["still", "raised", "moving", "table"])
    if kind == "raised":
        floor = b.num("-0.5", "0.1")
    elif kind == "moving":
        b.tag("sine", "in gap")
        floor = node("0.1") * sin(b.num(1, 4) * TIME)
    elif kind == "table":
        b.tag("in gap")
        floor = level(b)
    if e is None:
        e = b.rng.choice([node(0), node(1), b.num("0.2", "0.6")])
    b.m.impacts[p] = Impact(h - floor, e)
    return h, w, p


def bouncing(b: Builder) -> None:
    ball(b)


def closed_gap(b: Builder) -> None:
    """A closed gap whose force has a corner in another state, which a schedule moves across."""
    b.tag("impact", "schedule", "start on a guard", "corner in rate")
    y = b.state("y", b.either(b.num("0.5", 2)), 0)
    p, w = b.name("p"), var(f"w{b.count.get('w', 0) + 1}")
    h = b.state("h", 0, w)
    b.state("w", 0, var(p) - b.num("0.5", 2) - b.num(1, 4) * b.rng.choice([max_(y, 0), abs_(y), max_(-y, 0)]))
    b.m.impacts[p] = Impact(h, b.rng.choice([node(0), node(1), b.num("0.2", "0.8")]))
    b.m.schedules[b.name("sched")] = Schedule([b.moment()], {y.args[0]: b.either(b.num("0.5", 2))})


def loaded_contact(b: Builder) -> None:
    """Friction that the force of a unilateral contact loads, with or without influence back on the gap."""
    b.tag("impact", "contact", "friction loaded by an impact")
    p, f = b.name("p"), b.name("f")
    w, u = var(f"w{b.count.get('w', 0) + 1}"), var(f"v{b.count.get('v', 0) + 1}")
    kind = b.rng.choice(["apart", "coupled"])
    if kind == "apart":
        h = b.state("h", b.rng.choice([node(0), b.num("0.2", "0.8")]), w)
        b.state("w", 0, var(p) - b.num(2, 10))
        b.state("v", b.num(-3, 3), b.force() - var(f))
    else:
        b.tag("start on a guard")
        h = b.state("h", 0, w)
        b.state("w", 0, b.num(-2, 2) + var(p) + b.num(-3, 3) * var(f))
        b.state("v", b.num(-2, 2), -(b.num(4, 6) * var(f)) + b.num(-3, 3) * var(p))
    b.m.impacts[p] = Impact(h, node(0))
    b.m.contacts[f] = Contact(u, var(p), b.num("0.2", 1))


def planar(b: Builder) -> None:
    """A point in the plane inside of a circle, outside of one, or above a slope: gaps that are not linear."""
    b.tag("impact", "gap in several positions", "in gap")
    n = b.count.get("X", 0) + 1
    X, Y, VX, VY = (var(f"{s}{n}") for s in ("X", "Y", "VX", "VY"))
    p = b.name("p")
    kind = b.rng.choice(["circle", "square", "slope"])
    b.state("X", b.num("-0.4", "0.4"), VX)
    b.state("Y", b.num("0.1", "0.5"), VY)
    sx, sy = b.num("-0.9", "0.9"), b.num("0.3", "0.9")
    if kind == "circle":
        r = sqrt(X * X + Y * Y)
        gap, fx, fy = node(1) - r, -(var(p) * X) / r, -(var(p) * Y) / r
    elif kind == "square":
        gap, fx, fy = node(1) - X * X - Y * Y, -(var(p) * X), -(var(p) * Y)
    else:
        k = b.num("0.1", "0.6")
        gap, fx, fy = Y - k * X + 1, -(k * var(p)), var(p)
    down = b.num("0.5", 2) if kind == "slope" else node(0)
    b.state("VX", sx, fx)
    b.state("VY", sy, fy - down)
    b.m.impacts[p] = Impact(gap, node(1))


def two_discs(b: Builder) -> None:
    """Two discs in the plane that strike each other."""
    b.tag("impact", "gap in several positions", "in gap")
    p, m1, m2 = b.name("p"), b.num("0.5", 2), b.num("0.5", 2)
    names = [f"{s}{i}" for i in (1, 2) for s in ("DX", "DY", "EX", "EY")]
    dx, dy = var("DX2") - var("DX1"), var("DY2") - var("DY1")
    r = sqrt(dx * dx + dy * dy)
    fx, fy = var(p) * dx / r, var(p) * dy / r
    starts = [node(0), node(0), b.num("0.5", 1), node(0), node(1), b.num("-0.15", "0.15", 6), node(0), node(0)]
    rates = [var("EX1"), var("EY1"), -(fx / m1), -(fy / m1), var("EX2"), var("EY2"), fx / m2, fy / m2]
    for name, start, rate in zip(names, starts, rates):
        b.m.states[name] = start, rate
    b.m.impacts[p] = Impact(r - node("0.2"), node(1))


def relay(b: Builder) -> None:
    """A relay that draws to a surface, which may be moved, with a strength that has corners."""
    b.tag("relay")
    r = b.name("r")
    strength = b.num(1, 3)
    other = drifter(b)
    if b.chance(0.4):
        strength = b.positive(other, "rate")
        b.tag("corner in rate")
    x = b.state("x", b.rng.choice([node(0), b.num(-1, 1)]), b.force(-1, 1) - strength * var(r))
    surface = x
    if b.chance(0.4):
        b.tag("in surface")
        surface = x - b.num("0.1", "0.5") * sin(b.num(1, 3) * TIME)
    b.m.relays[r] = surface


def stack(b: Builder) -> None:
    """Two bodies that rub on each other, the lower one on the ground, too; some begin at rest."""
    b.tag("contact", "contact between bodies")
    v, u, f, g = (b.name(stem) for stem in ("v", "v", "f", "f"))
    m = b.num("0.5", 3)
    for name, rate in ((v, b.force() - var(f)), (u, (var(f) - var(g) + b.force()) / m)):
        b.m.states[name] = node(0) if b.chance(0.4) else b.num(-2, 2), rate
    for name, velocity in ((f, var(v) - var(u)), (g, var(u))):
        low, more = b.num("0.2", "0.6"), b.num("0.1", "0.4")
        static = b.chance(0.5)
        normal = b.num(1, 4) if b.chance(0.7) else b.positive(b.other() or drifter(b), "load")
        b.m.contacts[name] = Contact(velocity, normal, low + more if static else low, low if static else None)
        if static:
            b.tag("static above kinetic")


def walls(b: Builder) -> None:
    """A ball that strikes another one, which strikes a wall."""
    b.tag("impact", "several impacts")
    v, w, p, q = var(b.name("v")), var(b.name("v")), b.name("p"), b.name("p")
    m, e = b.num("0.5", 3), b.rng.choice([node(1), node(0), b.num("0.3", "0.9")])
    x = b.state("q", b.num("-0.5", "0.2"), v)
    y = b.state("q", b.num("0.5", 1), w)
    b.m.states[v.args[0]] = b.num("0.5", 2), b.force(-1, 1) - var(p)
    b.m.states[w.args[0]] = b.num(-1, 1), (var(p) - var(q)) / m
    b.m.impacts[p] = Impact(y - x, e)
    b.m.impacts[q] = Impact(b.num("1.1", 2) - y, e)


def watched_body(b: Builder) -> None:
    """A guard on the place and the speed of a body with friction."""
    b.tag("automaton", "contact", "guard on a sum of states")
    q, v = body(b)
    f, n = b.name("f"), counter(b)
    b.add_rate(v, -var(f))
    b.m.contacts[f] = Contact(v, b.num(1, 3), b.num("0.1", "0.5"))
    guard = Guard(b.corner(q + b.num("0.2", 1) * v, "guard", 2), [Choice("off", reset={n.args[0]: n + 1})])
    kick = {v.args[0]: b.num(-1, 1)} if b.chance(0.5) else {}
    back = Guard(b.corner(v, "guard"), [Choice("on", reset={n.args[0]: n + 1} | kick)])
    b.m.automata[b.name("auto")] = Automaton({"on": Mode({"g": guard}), "off": Mode({"g": back})}, "on")


def stranger(b: Builder) -> None:
    """A clock, a schedule, a guard that never fires: nothing that anything else reads."""
    b.tag("unrelated component")
    k, at = counter(b), b.num("0.2", 1)
    for schedule in b.m.schedules.values():
        at = schedule.period or schedule.times[0]
    kind = b.rng.choice(["clock", "schedule", "guard"])
    if kind == "clock":
        b.m.schedules[b.name("clock")] = Schedule([b.rng.choice([node(0), at])], {k.args[0]: k + 1}, period=at + node("0.1"))
    elif kind == "schedule":
        b.m.schedules[b.name("sched")] = Schedule([at], {k.args[0]: k + 1})
    else:
        x = drifter(b)
        modes = {"on": Mode({"never": Guard(abs_(x) + 1, [Choice("off")])}), "off": Mode()}
        b.m.automata[b.name("auto")] = Automaton(modes, "on")


PARTS: list[tuple[int, Callable[[Builder], object]]] = [
    (6, automaton), (6, single_guard), (2, thermostat), (2, rival_guards), (4, sampled), (2, twins), (2, doses), (4, tick_on_guard),
    (2, two_clocks), (2, monitor_at_reset), (4, monitor), (4, clock), (4, kick), (10, contact), (2, elastic_floor), (4, bouncing),
    (4, closed_gap), (4, loaded_contact), (4, planar), (1, two_discs), (4, relay), (4, stranger),
    (4, stack), (3, walls), (4, watched_body),
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
    return b
