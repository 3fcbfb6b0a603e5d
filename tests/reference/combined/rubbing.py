"""Parts with friction contacts and relays."""

from __future__ import annotations

from .automata import counter, drifter, signal
from .builder import Builder
from .forms import (
    TIME,
    Automaton,
    Choice,
    Contact,
    Guard,
    Mode,
    Node,
    Schedule,
    abs_,
    max_,
    min_,
    node,
    sin,
    var,
)


def body(b: Builder, speed: Node | None = None) -> tuple[Node, Node]:
    """A mass with a force, perhaps a spring with a corner."""
    v = var(f"v{b.count.get('v', 0) + 1}")
    other = b.other()
    q = b.state("q", b.num(-1, 1), v)
    force = b.force()
    kind = b.rng.choice(["free", "spring", "corner"] + ["coupled"] * (other is not None))
    if kind == "spring":
        force = force - b.num("0.5", 3) * q
    elif kind == "coupled":
        b.tag("rate of another part")
        force = force - b.num("0.5", 3) * (q - node(other))
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
    about = q if b.chance(0.5) else signal(b)
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
    if b.chance(0.25):
        b.tag("clock", "tick at the start")
        held = b.name("held")
        b.m.discrete[held] = node(0)
        b.m.schedules[b.name("clock")] = Schedule([node(0)], {held: v}, period=b.num("0.5", 3))


def resting(b: Builder) -> None:
    """A body at rest whose force has a corner there, or is switched later; friction holds more than it slides with."""
    b.tag("contact", "start at rest", "static above kinetic")
    place = b.num(-2, 2)
    v, f = b.name("v"), b.name("f")
    q = b.state("q", place, var(v))
    low, more = b.num("0.2", "0.4"), b.num("0.2", "0.6")
    kind, normal, opens = b.rng.choice(["corner", "switched", "load", "law"]), node(1), False
    force = b.either(b.num("0.1", "0.9"))
    if kind == "corner":
        b.tag("corner in rate")
        force = force - b.num(1, 3) * b.rng.choice(
            [max_(q, 0), max_(-q, 0), min_(q, 0), abs_(q) - abs_(place)]
        )
    elif kind == "switched":
        force = b.switched(force, b.either(b.num("0.5", 2)), "rate")
    elif kind == "load":
        opens = b.chance(0.5)
        normal = b.corner(q, "load", 2) if opens else b.positive(q, "load")
    else:
        low = low * b.positive(q, "law") * node("0.4")
    b.m.states[v] = node(0), force - var(f)
    b.m.contacts[f] = Contact(var(v), normal, low + more, low, opens)


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


def relay(b: Builder) -> None:
    """A relay that draws to a surface, which may be moved, with a strength that has corners."""
    b.tag("relay")
    r = b.name("r")
    strength = b.num(1, 3)
    other = signal(b)
    if b.chance(0.4):
        strength = b.positive(other, "rate")
        b.tag("corner in rate")
    x = b.state("x", b.rng.choice([node(0), b.num(-1, 1)]), b.force(-1, 1) - strength * var(r))
    surface = x
    if b.chance(0.4):
        b.tag("in surface")
        surface = x - b.num("0.1", "0.5") * sin(b.num(1, 3) * TIME)
    b.m.relays[r] = surface
