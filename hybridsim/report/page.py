"""This module puts the report of a run together as one page of HTML and writes it to a file."""

from __future__ import annotations

import hashlib
from base64 import b64encode
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any

from hybridsim import __version__
from hybridsim.errors import UsageError
from hybridsim.files import path_text, write_text
from hybridsim.model.checks.units import time_unit
from hybridsim.plot.drawing.theme import DARK, LIGHT
from hybridsim.plot.shared.smooth_parts import refuse_arrays
from hybridsim.report import interactive, sections
from hybridsim.report.curves import curves_of
from hybridsim.report.embedded import json_in_html
from hybridsim.report.events import events_of, modes_of
from hybridsim.report.repeat import Settings
from hybridsim.solution import Solution

SUFFIX = ".html"
_SIZE = 4_700_000  # bytes of the whole page
_LEAST_CURVES = 200_000  # bytes for the curves, whatever the rest takes
_FOLDER = Path(__file__).parent

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; script-src '{hash}'">
<meta name="generator" content="hybridsim {version}">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
<main>
{body}
<footer>Written by hybridsim {version}.</footer>
</main>
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""
_NO_SCRIPT = "<noscript><p>The curves and the events of this page need JavaScript.</p></noscript>"


def write_report(solution: Solution, path: str | PathLike[str]) -> Path:
    """Write the report of a run to a file; `Solution.report` describes the arguments."""
    refuse_arrays(solution)
    path = Path(path_text(path))
    if path.suffix.lower() != SUFFIX:
        raise UsageError(f"path {path}: unsupported file type {path.suffix!r}", remedy=f"use {SUFFIX}")
    write_text(path, page_of(solution))
    return path


def page_of(solution: Solution) -> str:
    """Return the report of a run as a page."""
    script = (_FOLDER / "report.js").read_text(encoding="utf-8")
    style = _drawing_colours() + (_FOLDER / "report.css").read_text(encoding="utf-8")
    title = solution.model.title or solution.model.name
    parts = [
        sections.head(solution),
        sections.messages(solution),
        f'<div class="pair">\n{sections.summary(solution)}\n{sections.drawing(solution)}\n</div>',
        sections.described(solution),
        f'<div class="pair">\n{sections.repeated(Settings(solution))}\n{sections.cost(solution)}\n</div>',
    ]
    data = data_of(solution, _SIZE - sum(map(len, (*parts, script, style))))
    parts[3:3] = [_NO_SCRIPT, interactive.histories(data), interactive.planes(data), interactive.events(data)]
    return _PAGE.format(
        hash=_hash_of(script),
        version=escape(__version__),
        title=escape(title),
        style=style,
        body="\n".join(parts),
        data=json_in_html(data),
        script=script,
    )


def data_of(solution: Solution, size: int) -> dict[str, Any]:
    """Return the numbers of a run for the script of the page, in about `size` bytes."""
    save = solution._run.save
    has_events = save != "nothing" and bool(solution._segments)
    has_curves = solution.t_end != solution.t_start and save not in ("events", "nothing")
    found: dict[str, Any] = {
        "name": solution.model.name,
        "unit": time_unit(solution.model),
        "t0": min(solution.t_start, solution.t_end),
        "t1": max(solution.t_start, solution.t_end),
        "states": list(solution.names),
        "contacts": [contact.name for contact in solution.model.contacts],
        "events": events_of(solution) if has_events and solution.events else None,
        "modes": modes_of(solution) if has_events and solution.t_end != solution.t_start else [],
        "curves": None,
    }
    if has_curves:
        rest = size - len(json_in_html(found))
        found["curves"] = curves_of(solution, max(rest, _LEAST_CURVES))
    return found


def _hash_of(script: str) -> str:
    """Return the hash with which the page allows its own script and no other script."""
    return "sha256-" + b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def _drawing_colours() -> str:
    """Return the colours of the drawing on light and on dark pages as properties of the style sheet."""
    light, dark = (
        "".join(f"--drawing-{number}: {colour}; " for number, colour in enumerate(theme.colours))
        for theme in (LIGHT, DARK)
    )
    return f":root {{ {light}}}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark}}} }}\n"
