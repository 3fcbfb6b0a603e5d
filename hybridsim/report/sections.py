"""This module writes the parts of a report that need no script: summary, drawing, cost, model and settings."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator
from html import escape

from hybridsim import __version__
from hybridsim.engine.run.report import describe
from hybridsim.model import Model
from hybridsim.model.checks.starting_facts import starting_facts
from hybridsim.model.checks.units import time_unit, unit_of_work
from hybridsim.model.smoothing.explicit_corners import smoothing_of
from hybridsim.plot.drawing.mechanism import mechanism
from hybridsim.plot.drawing.theme import LIGHT
from hybridsim.plot.shared.style import as_svg
from hybridsim.presentation.automaton import lines_of
from hybridsim.report.repeat import Settings
from hybridsim.solution import Solution
from hybridsim.solution.by_name import ByName
from hybridsim.solution.event import counted_kind

_LONGEST = 400_000  # characters of the text of a model; a longer one, with tables of data, is left out
_MOST_STEPS = (
    20_000  # of a run whose energies are computed; of more it would take longer than the rest of the page
)
_DRAWN = 0.7  # size of the drawing, so that its text is legible on small screens
_COSTS = {
    "steps": "steps",
    "rejected": "rejected steps",
    "rhs_evaluations": "evaluations of the right-hand side",
    "guard_evaluations": "evaluations of guards",
    "events": "events, with corners",
    "restarts": "restarts of the integrator",
    "wall_time": "time of the run [s]",
    "kernel_time": "part of it in compiled loops [s]",
    "compile_time": "time to compile before it [s]",
}


def head(solution: Solution) -> str:
    """Return the title, the status of the run, and the descriptions that the model contains."""
    model: Model = solution.model
    mark, state = ("✔", "good") if solution.success else ("✘", "bad")
    texts = [model.description, model.look, model.source and f"Source: {model.source}"]
    return "\n".join(
        [
            "<header>",
            f"<h1>{escape(model.title or model.name)}</h1>",
            f'<p class="status"><span class="{state}">{mark} {escape(solution.status)}</span> '
            f"<code>{escape(model.name)}</code> by <code>{escape(solution.integrator)}</code></p>",
            *(f"<p>{escape(' '.join(text.split()))}</p>" for text in texts if text),
            "</header>",
        ]
    )


def messages(solution: Solution) -> str:
    """Return the message of a run that stopped early, and its warnings."""
    found = [] if solution.success else [solution.message]
    found += solution.warnings
    if not found:
        return ""
    items = "\n".join(f"<li>{escape(text)}</li>" for text in found)
    heading = '<h2 id="h-warnings">Warnings</h2>'
    return f'<section class="warnings" aria-labelledby="h-warnings">{heading}\n<ul>{items}</ul></section>'


def summary(solution: Solution) -> str:
    """Return the main facts of a run as a list."""
    trajectory, stats = solution._of_model, solution.stats
    unit = time_unit(solution.model)
    kinds = trajectory.kinds() if solution._run.save != "nothing" else {}
    counted = ", ".join(counted_kind(kind, n) for kind, n in kinds.items())
    facts = {
        "Time": f"{solution.t_start:.9g} to {solution.t_end:.9g} {unit}".rstrip(),
        "Integrator": solution.integrator,
        "Events": counted or ("none" if kinds or solution._run.save != "nothing" else "not stored"),
        "Cost": f"{stats['steps']} steps, {stats['rhs_evaluations']} evaluations, {stats['wall_time']:.3g} s",
        "Result": solution.message,
    } | _energies(solution)
    rows = "\n".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in facts.items())
    return f'<section aria-labelledby="h-run"><h2 id="h-run">Run</h2>\n<dl>{rows}</dl></section>'


def _energies(solution: Solution) -> dict[str, str]:
    """Return the energy that each contact dissipates, if the run stored its states and is not very long."""
    model, steps = solution.model, solution._of_model.own_times.size
    if not model.contacts or solution._run.save in ("events", "nothing") or not 1 < steps <= _MOST_STEPS:
        return {}
    found = solution.dissipated
    texts = [f"{c.name} {found[c.name]:.6g} {unit_of_work(model, c)}".rstrip() for c in model.contacts]
    remark = f" ({found.remark})" if isinstance(found, ByName) and found.remark else ""
    return {"Energy dissipated by friction": ", ".join(texts) + remark}


def drawing(solution: Solution) -> str:
    """Return the mechanism at the end of the run as SVG in the colours of the page, or nothing without a drawing."""
    if not solution.model.drawing or solution._run.save in ("events", "nothing") or len(solution.t) < 2:
        return ""
    axes = mechanism(solution)
    axes.set_title("", loc="left")
    if legend := axes.get_legend():
        legend.remove()
    figure = axes.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches().tolist()
    figure.set_size_inches(_DRAWN * width, _DRAWN * height)
    svg = re.sub(r"<metadata>.*?</metadata>", "", as_svg(figure), flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"', r"\1", svg, count=1)
    for number, colour in enumerate(LIGHT.colours):
        svg = svg.replace(colour, f"var(--drawing-{number})")
    when = f"at t = {solution.t_end:.6g} {time_unit(solution.model)}".rstrip()
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="The mechanism {escape(when)}" ', 1)
    heading = f'<h2 id="h-drawing">Mechanism {escape(when)}</h2>'
    return f'<section class="drawing" aria-labelledby="h-drawing">{heading}\n{svg}</section>'


def cost(solution: Solution) -> str:
    """Return the cost of a run as a table."""
    stats = solution.stats
    names = [*(name for name in _COSTS if name in stats), *(name for name in stats if name not in _COSTS)]
    rows = "\n".join(
        f'<tr><th scope="row">{escape(_COSTS.get(name, name.replace("_", " ")))}</th>'
        f"<td>{format(stats[name], '.4g' if isinstance(stats[name], float) else 'd')}</td></tr>"
        for name in names
    )
    return f'<section aria-labelledby="h-cost"><h2 id="h-cost">Cost</h2>\n<table class="cost">{rows}</table></section>'


def described(solution: Solution) -> str:
    """Return the equations and the automaton of the model as text, as `hybridsim check` prints them."""
    text = "\n".join(_lines(solution.model))
    return (
        '<section aria-labelledby="h-model"><h2 id="h-model">Model</h2>\n'
        f'<pre tabindex="0" aria-labelledby="h-model">{escape(text)}</pre></section>'
    )


def _lines(model: Model) -> Iterator[str]:
    if model.flow is not None:
        yield "The equations of this model are Python functions."
        for name, value in model.parameter_values().items():
            yield f"{name} = {value!r}"
        return
    yield from lines_of(model, describe(model), smoothing_of(model).primitives, starting_facts(model))


def repeated(settings: Settings) -> str:
    """Return the ways to repeat the run in Python and on the command line, with a model file if one is needed."""
    parts = ['<section aria-labelledby="h-again"><h2 id="h-again">Repeat this run</h2>']
    if settings.text is not None and not settings.is_packaged:
        name = f"{settings.name}.toml"
        link = b64encode(settings.text.encode("utf-8")).decode("ascii")
        if len(settings.text) <= _LONGEST:
            parts.append(
                f'<p>Save <a download="{escape(name)}" href="data:text/plain;base64,{link}">{escape(name)}</a>, the '
                "model with its parameters and start values, in the folder where you work.</p>"
            )
        else:
            parts.append(f"<p>The file <code>{escape(name)}</code> is too large to be part of this page.</p>")
    command = settings.command()
    parts += [
        "<h3>Python</h3>",
        f'<pre tabindex="0" id="again-python">{escape(settings.python(__version__))}</pre>',
        "<h3>Command line</h3>",
        f'<pre tabindex="0" id="again-command">{escape(command)}</pre>'
        if command
        else "<p>The command line has no options for all settings of this run.</p>",
    ]
    if settings.text is not None and len(settings.text) <= _LONGEST:
        parts.append(
            f'<details><summary>The model as one file</summary>\n<pre tabindex="0" id="again-model">'
            f"{escape(settings.text)}</pre></details>"
        )
    return "\n".join([*parts, "</section>"])
