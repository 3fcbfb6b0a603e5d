"""The pages of the atlas: an index with the matrix, and a page for each class with every scene's story and verdicts."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping

from hybridsim.testing.atlas.cell import Cell
from hybridsim.testing.atlas.matrix import Atlas
from hybridsim.testing.atlas.verdict import HANG, NOT_RUN, REFUSED, RIGHT, VERDICTS, WRONG
from hybridsim.testing.scene import TROUBLES, Scene

_WIDTH = 118

_INTRODUCTION = """\
# The atlas: where methods fail

Scenes whose answer is known and which break simulators, run with every integrator and with what else people use.
The truth of each is a closed form, or 30 digits and more from a computation that shares no code with the package.
`hybridsim atlas` makes these pages.

![scenes against integrators, a verdict for each pair](matrix.png)

A method is *right* in a scene when every event is found, in the right mode and order, none is invented, what is held is
exact at every setting, and the errors come down to the scene's tolerance with rtol (1e-6, 1e-9, 1e-12) or, for fixed
steps, with the step (a 300th, a 1200th and a 4800th of the scene's own time). Everything is run, also where an
integrator says what it lacks; what fails there fails for the reason that it gives. The figure behind a name is the
larger error of event times and states at the last setting, and the order in the step that the last two show. A scene in
which nobody fails is one in which other programs do: all methods here share the location and the decisions of events,
unless their name says otherwise.
"""


def pages(result: Atlas, pictures: Collection[str] = ()) -> dict[str, str]:
    """File name -> text in Markdown; `pictures` are the scenes that have one, at CLASS/SCENE.png."""
    groups = result.by_class()
    found = {"index.md": index(result, groups)}
    for trouble, scenes in groups.items():
        found[f"{trouble or 'scenes'}.md"] = page(result, trouble, scenes, pictures)
    return found


def index(result: Atlas, groups: Mapping[str, list[Scene]]) -> str:
    """The first page."""
    lines = [_INTRODUCTION, "| verdict | what it means |", "| --- | --- |"]
    lines += [f"| {verdict} | {meaning} |" for verdict, meaning in VERDICTS.items()]
    lines += ["", "## Classes of trouble", "", "| class | scenes | what it is about |", "| --- | --- | --- |"]
    for trouble, scenes in groups.items():
        name = trouble or "scenes"
        lines.append(
            f"| [{name}]({name}.md) | {len(scenes)} | {TROUBLES.get(trouble, '').partition(': ')[2]} |"
        )
    shown = [verdict for verdict in VERDICTS if verdict != RIGHT]
    lines += ["", "## Integrators and what else people use", ""]
    lines.append(f"| name | what it is | {RIGHT} | {' | '.join(shown)} |")
    lines.append("| --- | --- | " + " | ".join(["---"] * (1 + len(shown))) + " |")
    for one in result.configurations:
        cells = result.column(one)
        counts = [sum(cell.verdict == verdict for cell in cells) for verdict in (RIGHT, *shown)]
        lines.append(f"| `{one.name}` | {one.title} | {' | '.join(map(str, counts))} |")
    names = [trouble or "scenes" for trouble in groups]
    lines += ["", "```{toctree}", ":hidden:", "", *names, "```"]
    return "\n".join(lines) + "\n"


def page(result: Atlas, trouble: str, scenes: list[Scene], pictures: Collection[str] = ()) -> str:
    """The page of one class."""
    lines = [f"# {TROUBLES.get(trouble, 'Scenes')}", "", "[The whole matrix](index.md)", ""]
    for scene in scenes:
        lines += [f"## {scene.title or scene.name}", "", f"`{scene.name}`: {scene.cause}.", ""]
        lines += [textwrap.fill(" ".join(scene.story.split()), _WIDTH, break_on_hyphens=False), ""]
        if scene.name in pictures:
            lines += [f"![{scene.title}]({trouble or 'scenes'}/{scene.name}.png)", ""]
        lines += [*verdicts(result.row(scene)), ""]
    return "\n".join(lines).rstrip() + "\n"


def verdicts(cells: list[Cell]) -> list[str]:
    """The verdicts on one scene: who is right, and one line for each that is not."""
    right = [cell for cell in cells if cell.verdict == RIGHT]
    lines = ["| | |", "| --- | --- |"]
    if right:
        lines.append(f"| {RIGHT} | {', '.join(map(_with_error, right))} |")
    for verdict in (*WRONG, HANG, REFUSED):
        for reason, names in _by_reason([cell for cell in cells if cell.verdict == verdict]).items():
            lines.append(f"| **{verdict}** | {', '.join(names)}: {_safe(reason)} |")
    left_out = [cell.configuration for cell in cells if cell.verdict == NOT_RUN]
    return [*lines, *([f"| {NOT_RUN} | {', '.join(left_out)} |"] if left_out else [])]


def _by_reason(cells: list[Cell]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for cell in cells:
        found.setdefault(cell.reason, []).append(
            _with_error(cell) if cell.verdict in WRONG else cell.configuration
        )
    return found


def _with_error(cell: Cell) -> str:
    """A name with its error and, where it is seen, the order in the step."""
    known = []
    if cell.error is not None and cell.rows:
        known.append(f"{cell.error:.0e}")
    if cell.order is not None:
        known.append(f"order {cell.order:.1f}")
    return f"{cell.configuration} ({', '.join(known)})" if known else cell.configuration


def _safe(reason: str) -> str:
    """A reason that breaks no table."""
    return reason.replace("|", r"\|")
