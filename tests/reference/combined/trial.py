"""One structure with several sets of numbers: render, run by two integrators each, judge."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import asdict
from fractions import Fraction
from typing import Any

import hybridsim as hs

from .builder import number_set
from .compare import Truth, Verdict, hold, judged, parted, shortened
from .forms import Abstract
from .parts import structure
from .render import Renderer, Style
from .values import Digits

OURS = ["auto", "exact", "exact", "taylor", "taylor", "dop853", "dop853", "tsit5", "rodas5p"]
OTHERS = ["scipy-dop853", "scipy-rk45", "scipy-radau", "scipy-bdf", "scipy-lsoda", "cvode-adams", "cvode-bdf"]
QUIET = ("agrees", "names refused", "unclear", "cannot")  # what is no finding
SCALES = [
    Fraction(-1),
    Fraction(2),
    Fraction(1, 2),
    Fraction(3),
    Fraction(-1, 10),
    Fraction(1000),
    Fraction(1, 1000),
]
AWKWARD = [
    "N",
    "v",
    "mu",
    "speed",
    "dN",
    "i",
    "e",
    "f_N",
    "f1_N",
    "p",
    "x",
    "s",
    "slip",
    "stick",
    "E",
    "I",
    "S",
    "lam",
    "beta",
    "y",
    "z",
]


def style_of(model: Abstract, seed: int) -> Style:
    """A way to write a model: scales and mirror images of states, a shift of time."""
    rng = random.Random(seed * 7 + 1)
    style = Style(seed)
    if rng.random() < 0.25:
        for name in model.states:
            if rng.random() < 0.5:
                style.scales[name] = rng.choice(SCALES)
        model.features.add("scaled states")
    if rng.random() < 0.2:
        style.shift = rng.choice([Fraction(1, 10), Fraction(-3), Fraction(100), Fraction(1, 3)])
        model.features.add("shifted time")
    if rng.random() < 0.3:
        style.named = 0.15
        model.features.add("definition of an expression")
    return style


def names_of(model: Abstract, seed: int) -> dict[str, str]:
    """Names that people and the package use, for some of what a model declares."""
    rng = random.Random(seed * 11 + 5)
    if rng.random() > 0.3:
        return {}
    model.features.add("awkward names")
    every = [
        *model.numbers,
        *model.states,
        *model.discrete,
        *model.contacts,
        *model.impacts,
        *model.automata,
        *model.monitors,
    ]
    chosen = rng.sample(every, min(len(every), rng.randint(1, 6)))
    names = dict(zip(chosen, rng.sample(AWKWARD, len(chosen))))
    if any(c.opens for c in model.contacts.values()) and rng.random() < 0.7:
        names = {key: name for key, name in names.items() if name != "f1_N"}
        names[rng.choice(every)] = "f1_N"
    return names


def rendered(model: Abstract, seed: int) -> tuple[Renderer, hs.Model, str]:
    """The model in a random syntax; plainer names where the random ones are refused."""
    style, numbers = style_of(model, seed), number_set(model, seed, 0)
    why = ""
    for names in (names_of(model, seed), {}):
        renderer = Renderer(model, style, names)
        try:
            return renderer, hs.Model.from_toml(renderer.toml(numbers)), why
        except hs.ModelError as error:
            why = str(error)
            if not names:
                raise
    raise AssertionError


def second_look(model: Abstract, numbers: dict[str, Fraction], truth: Truth, v: Verdict) -> Truth:
    """The truth in 40 digits, and cut where a small change of the start makes a large one."""
    exact = judged(model, numbers, Digits())
    truth = shortened(exact, min([parted(model, exact, truth), *exact[0].borders]))
    if v.off < 0.01:
        near = judged(model, numbers, nudge=1e-8)
        truth = shortened(truth, parted(model, truth, near))
    return truth


def trials(seed: int, draws: int, first: int = 0) -> Iterator[dict[str, Any]]:
    """What became of each run of a structure."""
    return single_runs(structure(seed).m, seed, draws, first)


def single_runs(model: Abstract, seed: int, draws: int, first: int = 0) -> Iterator[dict[str, Any]]:
    """What became of each run of a model, by two integrators for each set of numbers."""
    try:
        renderer, compiled, why = rendered(model, seed)
    except hs.ModelError as error:
        yield {"seed": seed, "draw": 0, "kind": "no model", "integrator": "", "detail": str(error)[:300]}
        return
    if why:
        yield {"seed": seed, "draw": 0, "kind": "names refused", "integrator": "", "detail": why[:300]}
    for draw in range(first, draws):
        numbers = number_set(model, seed, draw)
        valued = compiled.with_(**renderer.values(numbers))
        truth, looked_twice = judged(model, numbers), False
        if truth[2] < 1e-3 and truth[0].status not in ("nonunique", "inconsistent"):  # nothing is certain
            yield {"seed": seed, "draw": draw, "kind": "unclear", "integrator": "", "detail": truth[0].status}
            continue
        rng = random.Random(seed * 31 + draw)
        way = "resumed" if rng.random() < 0.1 and model.duration else "plain"
        for integrator in chosen(rng):
            v = hold(model, valued, renderer, integrator, truth, way)
            if v.kind == "cannot":
                integrator = "dop853"
                v = hold(model, valued, renderer, integrator, truth, way)
            if v.kind not in ("agrees", "cannot", "model"):
                if not looked_twice or v.off < 0.01:
                    truth, looked_twice = second_look(model, numbers, truth, v), True
                v = hold(model, valued, renderer, integrator, truth, way)
            yield {
                "seed": seed,
                "draw": draw,
                "way": way,
                "judge": truth[0].status,
                "instants": len(truth[0].events),
            } | asdict(v)


def chosen(rng: random.Random) -> list[str]:
    """One integrator of ours and another one, of ours or not."""
    first = rng.choice(OURS)
    return [first, rng.choice([name for name in (OTHERS if rng.random() < 0.2 else OURS) if name != first])]


def features(seed: int) -> set[str]:
    """The forms of a structure."""
    model = structure(seed).m
    style_of(model, seed)
    names_of(model, seed)
    return model.features
