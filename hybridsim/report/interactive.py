"""This module writes the parts of a report that its script fills: curves, phase plots and the table of events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from hybridsim.solution.run_trajectory import relative_velocity

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_HISTORIES = """<section aria-labelledby="h-curves" id="histories">
<h2 id="h-curves">Time histories</h2>
<div class="toolbar" role="group" aria-label="Range of time">
<button type="button" data-move="left" title="Earlier (left arrow)" aria-label="Earlier">←</button>
<button type="button" data-move="right" title="Later (right arrow)" aria-label="Later">→</button>
<button type="button" data-move="in" title="Zoom in (up arrow)" aria-label="Zoom in">+</button>
<button type="button" data-move="out" title="Zoom out (down arrow)" aria-label="Zoom out">−</button>
<button type="button" data-move="all" title="Whole run (Home)">Whole run</button>
<output id="range"></output>
</div>
{choice}
<div id="chart" tabindex="0" role="group" aria-labelledby="h-curves" aria-describedby="keys">
{rows}
<canvas id="axis" aria-hidden="true"></canvas>
<div id="line" hidden></div>
<div id="drag" hidden></div>
</div>
<p class="hint" id="note" hidden>This range has more steps than the page can hold. The curves show the least and
the largest value in short intervals. The first and the last part of the run have all details.</p>
{columns}<p class="hint" id="keys">Drag across the curves to zoom in, and double-click to see the whole run.
With the keyboard: left and right arrows move, up and down arrows zoom, Home shows the whole run, and Shift with left
or right moves the cursor.</p>
<p class="hidden" id="spoken" aria-live="polite"></p>
</section>"""

_COLUMNS = """<p class="hint">The run has more intervals of modes than the page can hold. Each strip of modes
has 4096 columns of equal time, and a column shows the share of each mode.</p>
"""

_EVENTS = """<section aria-labelledby="h-events" id="events">
<h2 id="h-events">Events</h2>
<div class="toolbar">
<label>Show <select id="filter">
{options}
</select></label>
<label>Go to number <input id="number" type="number" min="0" max="{last}"></label>
<output id="count"></output>
</div>
{omitted}<div class="row head" aria-hidden="true">
<span>number</span><span>{time}</span><span>change</span><span>reason</span></div>
<div id="rows" tabindex="0" role="listbox" aria-labelledby="h-events" aria-describedby="event-keys">
<div id="inner"></div></div>
<p class="hint" id="event-keys">With the keyboard: up and down arrows choose an event, and Enter shows it in the
curves.</p>
<div id="event" aria-live="polite"></div>
</section>"""


def label_of(quantity: Mapping[str, Any]) -> str:
    """Return the name of a quantity with its unit and, if the unit has no prefix, a power of ten."""
    power = f"10{str(quantity['power']).translate(_SUPERSCRIPTS)}" if quantity["has_power"] else ""
    unit = f"{power} {quantity['unit']}".strip()
    return f"{quantity['name']} [{unit}]" if unit else str(quantity["name"])


def histories(data: Mapping[str, Any]) -> str:
    """Return the curves over time, with the modes below them, or nothing if the run has neither."""
    quantities = data["curves"]["quantities"] if data["curves"] else []
    if not quantities and not data["modes"]:
        return ""
    rows = [
        f'<div class="curve" data-index="{k}" data-name="{escape(q["name"])}"{"" if q["shown"] else " hidden"}>'
        f'<div class="label"><b>{escape(label_of(q))}</b><output></output></div>'
        '<canvas aria-hidden="true"></canvas></div>'
        for k, q in enumerate(quantities)
    ]
    rows += [_strip(k, component) for k, component in enumerate(data["modes"])]
    boxes = "\n".join(
        f'<label><input type="checkbox"{" checked" if q["shown"] else ""}> {escape(label_of(q))}</label>'
        for q in quantities
    )
    columns = "" if all(component["is_exact"] for component in data["modes"]) else _COLUMNS
    choice = f'<details><summary>Choose quantities</summary><div id="boxes">{boxes}</div></details>'
    return _HISTORIES.format(choice=choice if boxes else "", rows="\n".join(rows), columns=columns)


def _strip(k: int, component: Mapping[str, Any]) -> str:
    keys = "".join(
        f'<span class="key"><i style="background: {colour or "var(--ink)"}"></i>{escape(mode)}</span>'
        for mode, colour in zip(component["modes"], component["colours"], strict=True)
    )
    name = escape(component["name"])
    return (
        f'<div class="strip" data-index="{k}" data-name="{name}"><div class="label"><b>{name}{keys}</b>'
        '<output></output></div><canvas aria-hidden="true"></canvas></div>'
    )


def planes(data: Mapping[str, Any]) -> str:
    """Return the phase plot and the friction loop of each contact, or nothing for fewer than two quantities."""
    quantities = data["curves"]["quantities"] if data["curves"] else []
    if len(quantities) < 2:
        return ""
    numbers = {quantity["name"]: k for k, quantity in enumerate(quantities)}
    components = [component["name"] for component in data["modes"] if component["is_exact"]]
    x, y = (data["states"] + [quantities[1]["name"]])[:2]
    pictures = [_plane("Phase plot", quantities, numbers[y], numbers[x], 0 if components else -1)]
    for name in data["contacts"]:
        velocity = relative_velocity(name)
        if name in numbers and velocity in numbers:
            title = f"Friction loop of {name}" if len(data["contacts"]) > 1 else "Friction loop"
            across, component = numbers[velocity], components.index(name) if name in components else -1
            pictures.append(_plane(title, quantities, numbers[name], across, component))
    heading = "Phase plot and friction loop" if len(pictures) > 1 else "Phase plot"
    return (
        f'<section aria-labelledby="h-planes"><h2 id="h-planes">{heading}</h2>\n'
        '<p class="hint">The range of time is that of the curves, without parts of which the page has no details.</p>\n'
        f'<div class="pair">{"".join(pictures)}</div></section>'
    )


def _plane(title: str, quantities: Sequence[Mapping[str, Any]], up: int, across: int, component: int) -> str:
    def select(chosen: int, axis: str) -> str:
        options = "".join(
            f'<option value="{k}"{" selected" if k == chosen else ""}>{escape(label_of(q))}</option>'
            for k, q in enumerate(quantities)
        )
        return f'<select aria-label="{escape(title)}: {axis} axis">{options}</select>'

    return (
        f'<div class="picture" data-component="{component}"><div class="toolbar"><span>{escape(title)}:</span>'
        f"{select(up, 'vertical')}<span>over</span>{select(across, 'horizontal')}</div>"
        f'<canvas role="img" aria-label="{escape(title)}"></canvas><i hidden></i></div>'
    )


def events(data: Mapping[str, Any]) -> str:
    """Return the frame of the table of events, or a sentence if there are none."""
    found = data["events"]
    if not found:
        return ""
    options = ['<option value="">all events</option>']
    options += [
        f'<option value="{k}">{escape(text)} ({count})</option>'
        for k, (text, count) in enumerate(zip(found["texts"], found["counts"], strict=True))
    ]
    time = f"t [{data['unit']}]" if data["unit"] else "t"
    half = (found["count"] - found["omitted"]) // 2
    omitted = f"The page leaves out events {half} to {half + found['omitted'] - 1}."
    omitted = f'<p class="hint">{omitted}</p>\n' if found["omitted"] else ""
    return _EVENTS.format(
        omitted=omitted, options="\n".join(options), last=found["count"] - 1, time=escape(time)
    )
