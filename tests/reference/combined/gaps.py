"""Parts with unilateral contacts."""

from __future__ import annotations

from fractions import Fraction

from .builder import Builder
from .forms import TIME, Contact, Impact, Node, Schedule, abs_, max_, node, sin, sqrt, var


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
    starts = [
        node(0),
        node(0),
        b.num("0.5", 1),
        node(0),
        node(1),
        b.num("-0.15", "0.15", 6),
        node(0),
        node(0),
    ]
    rates = [var("EX1"), var("EY1"), -(fx / m1), -(fy / m1), var("EX2"), var("EY2"), fx / m2, fy / m2]
    for name, start, rate in zip(names, starts, rates):
        b.m.states[name] = start, rate
    b.m.impacts[p] = Impact(r - node("0.2"), node(1))


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
