"""A small model that shows the same disagreement as a run of the study."""

from __future__ import annotations

import hybridsim as hs

from .builder import number_set
from .compare import hold
from .forms import Abstract
from .parts import structure
from .render import Renderer, Style
from .shrink import literal, pruned, shrunk
from .trial import judged, names_of, second_look, style_of


def small(seed: int, draw: int, integrator: str, tries: int = 150) -> str:
    """The model file of the smallest model found, with the two values."""
    model, found = structure(seed).m, {}
    numbers = number_set(model, seed, draw)
    kinds: list[str] = []

    def shows(style: Style, names: dict[str, str]):  # type: ignore[no-untyped-def]  # local
        def holds(m: Abstract) -> bool:
            renderer = Renderer(m, style, names)
            try:
                text = renderer.toml(numbers)
                compiled = hs.Model.from_toml(text)
                truth = judged(m, numbers)
                v = hold(m, compiled, renderer, integrator, truth)
                if v.kind not in ("agrees", "cannot"):
                    truth = second_look(m, numbers, truth, v)
                    v = hold(m, compiled, renderer, integrator, truth)
            except Exception:  # a smaller model may be invalid in any way
                return False
            if not kinds:
                kinds.append(v.kind)
            if v.kind == kinds[0]:
                found["text"], found["verdict"], found["truth"] = text, v, truth[0]
                return True
            return False

        return holds

    style, names = style_of(model, seed), names_of(model, seed)
    holds = shows(style, names)
    holds(model)
    if kinds and kinds[0] == "agrees":
        return "agrees"
    for other, called in ((Style(seed, plain=True), {}), (Style(seed), {}), (style, {})):
        if shows(other, called)(model):
            holds = shows(other, called)
            break
    for step in range(2):
        model = next((m for m in (literal(model, numbers), pruned(model)) if holds(m)), model)
        if step == 0:
            model = shrunk(model, holds, tries)
    holds(model)
    motion = found["truth"]
    events = [(round(t, 6), who, what) for t, who, what in motion.events[:8]]
    judge = f"# judge: {motion.status} {motion.message} until {motion.end}: {events}"
    return f"{found['text']}\n# {found['verdict']}\n{judge}"
