"""Parts with automata, monitors, schedules and clocks."""

from __future__ import annotations

from .builder import Builder
from .forms import TIME, Automaton, Choice, Guard, Mode, Monitor, Node, Schedule, abs_, min_, node, sin, var


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


def signal(b: Builder) -> Node:
    """A state to look at: one that is there already, or one of its own."""
    return (b.other() if b.chance(0.4) else None) or drifter(b)


def counter(b: Builder) -> Node:
    name = b.name("n")
    b.m.discrete[name] = node(0)
    return var(name)


def automaton(b: Builder) -> None:
    """Two modes with corners in their guards, resets, conditions, a counter."""
    b.tag("automaton")
    x, n, name = signal(b), counter(b), b.name("auto")
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
    two = Mode(
        {
            "g": Guard(
                b.corner(b.rng.choice([x, other]), "guard", 2), [Choice("one", reset={n.args[0]: n + 1})]
            )
        }
    )
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
    modes = {
        "first": Mode(first),
        "second": Mode(dict(guards)),
        "A": Mode(rates={z.args[0]: node(2)}),
        "B": Mode(rates={z.args[0]: node(-2)}),
    }
    b.m.automata[b.name("auto")] = Automaton(modes, "first")


def sampled(b: Builder) -> None:
    """A located value is copied and compared with the threshold that it was located at."""
    b.tag("automaton", "copy of a located value")
    c, w = b.num("0.3", 1), b.num("0.5", 3)
    x = b.state(
        "x", b.num(-1, 0), b.num("0.6", "1.2") + (node("0.4") * sin(w * TIME) if b.chance(0.6) else 0)
    )
    y = b.state("y", b.num(-1, 1), 0)
    n = counter(b)
    fall = b.num("0.3", 1) * b.rng.choice([-1, -1, 1])
    copy = b.rng.choice([x, x, x + x - c, 2 * x - x])
    b.m.automata[b.name("auto")] = Automaton(
        {
            "wait": Mode({"g": Guard(c - x, [Choice("held", reset={y.args[0]: copy, n.args[0]: n + 1})])}),
            "held": Mode(
                {"g": Guard(c - y, [Choice("done", reset={n.args[0]: n + 1})])}, rates={y.args[0]: fall}
            ),
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
            {
                "run": Mode(
                    {"g": Guard(x, [Choice("run", reset={x.args[0]: start}, adds={n.args[0]: node(1)})])}
                )
            },
            "run",
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
    b.m.schedules[b.name("clock")] = Schedule(
        [period if reset else b.rng.choice([node(0), period])], other, period=period
    )


def two_clocks(b: Builder) -> None:
    """Two clocks that tick together and set one state to one value, written in two ways."""
    b.tag("clock", "several at one instant")
    p, q, period = b.num("0.1", 1), b.num("0.1", "0.7", 6), b.num("0.3", 1)
    y = b.state("y", 0, b.num(-1, 1))
    b.m.schedules[b.name("clock")] = Schedule([period], {y.args[0]: p}, period=period)
    other = b.name("held")
    b.m.discrete[other] = p + q
    b.m.schedules[b.name("clock")] = Schedule([period], {y.args[0]: var(other) - q}, period=period)


def monitor_at_reset(b: Builder) -> None:
    """A monitor whose zero is that of a guard; the reset carries it back; a clock may tick at the same instant."""
    b.tag("monitor", "automaton", "several at one instant")
    start, speed, n = b.num("0.3", 1), b.num("0.3", 1), counter(b)
    x = b.state("x", start, -speed)
    b.m.automata[b.name("auto")] = Automaton(
        {"run": Mode({"g": Guard(x, [Choice("run", reset={x.args[0]: start, n.args[0]: n + 1})])})}, "run"
    )
    b.m.monitors[b.name("mon")] = Monitor(
        x if b.chance(0.5) else x * b.num(1, 2),
        b.rng.choice(["down", "both"]),
        b.rng.choice(["record", "terminate"]),
    )
    if b.chance(0.6):
        b.tag("clock")
        k = counter(b)
        b.m.schedules[b.name("clock")] = Schedule(
            [node(0)], {k.args[0]: k + 1}, period=b.derived(start / speed)
        )


def monitor(b: Builder) -> None:
    """A monitor of a function with corners that records, resets or ends the run."""
    b.tag("monitor")
    x, action = signal(b), b.rng.choice(["record", "record", "reset", "terminate"])
    n = counter(b)
    b.m.monitors[b.name("mon")] = Monitor(
        b.corner(x, "monitor", 2),
        b.rng.choice(["up", "down", "both"]),
        action,
        {n.args[0]: n + 1} if action == "reset" else {},
    )


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


def stranger(b: Builder) -> None:
    """A clock, a schedule, a guard that never fires: nothing that anything else reads."""
    b.tag("unrelated component")
    k, at = counter(b), b.num("0.2", 1)
    for schedule in b.m.schedules.values():
        at = schedule.period or schedule.times[0]
    kind = b.rng.choice(["clock", "schedule", "guard"])
    if kind == "clock":
        b.m.schedules[b.name("clock")] = Schedule(
            [b.rng.choice([node(0), at])], {k.args[0]: k + 1}, period=at + node("0.1")
        )
    elif kind == "schedule":
        b.m.schedules[b.name("sched")] = Schedule([at], {k.args[0]: k + 1})
    else:
        x = drifter(b)
        modes = {"on": Mode({"never": Guard(abs_(x) + 1, [Choice("off")])}), "off": Mode()}
        b.m.automata[b.name("auto")] = Automaton(modes, "on")
