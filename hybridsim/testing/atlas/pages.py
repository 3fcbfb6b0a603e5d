"""The pages of the atlas: an index with a table of all verdicts, and one page for each class of test cases."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Mapping, Sequence

from hybridsim.testing.atlas.cell import Cell
from hybridsim.testing.atlas.configurations import Configuration
from hybridsim.testing.atlas.matrix import Atlas
from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import TROUBLES, Scene
from hybridsim.testing.verdict import (
    ERROR,
    HANG,
    NOT_RUN,
    REFUSED,
    RIGHT,
    VERDICTS,
    WRONG,
    WRONG_ANSWER,
    WRONG_SEQUENCE,
)

_WIDTH = 118

_INTRODUCTION = """\
# The atlas: where methods fail

{answer}

A scene is a model with a known answer. The answer is a closed form, or a number with at least 30 digits. The digits
were computed by a program that shares no code with the package. The command `hybridsim atlas` runs all scenes with
all methods.

A method is *right* in a scene if it satisfies four conditions:

- The method finds every event, in the right mode and order.
- The method reports no other events.
- States that are constant in stick are exact at every setting of the method.
- At the tightest setting the errors are within the scene's tolerance.

| method | settings |
| --- | --- |
| with error control | rtol 1e-6, 1e-9 and 1e-12; in a few scenes 1e-8, 1e-10 and 1e-12, or only 1e-9 and 1e-12; \
1e-13 if only the error at 1e-12 exceeds the scene's tolerance |
| `rk4-dichotomy`, `rk4-sign` | steps of unit/300, unit/1200 and unit/4800 |
| `moreau` (first order) | steps of unit/4800, unit/19200 and unit/76800 |
| `rk4 tanh`, `rk4 karnopp` | v0 of 1e-2, 1e-3 and 1e-4 of the scene's speed, with steps of unit/1200, unit/12000 \
and unit/120000, if the run needs at most 2e6 steps |
| `scipy-rk45 cooldown` | rtol 1e-9, guards ignored for 1e-2, 1e-3 and 1e-4 units after each event |

The *unit* of a scene is its typical time, which is the period of the forcing or about one oscillation. Each scene has
a tolerance, which applies to methods with error control. For `rk4-dichotomy`, which bisects its steps, the tolerance
is at least 1e-5. Other fixed-step methods place events at the ends of steps. For these methods the tolerance is at
least 4.2e-4 units, the length of two steps of unit/4800. In scenes longer than fifty units, `scipy-rk23` runs with
rtol 100 times as large.

In the tables of the scenes, a number follows the name of a method. This number is the larger of two errors at the
last setting in the table above. The first error is that of event times, in units of the scene. The second error is
that of states, relative to their largest true value. If the error decreases with the step, the table also has the
observed order of convergence. Each integrator states in `lacks` the features that it does not support. The atlas
also runs scenes that need such a feature. In these scenes the missing feature is the reason for a failure or refusal.

Most methods use the event location and the mode selection of the engine. The exceptions are the fixed-step methods, and
methods with native events, a cooldown or regularized friction. If all methods are right in a scene, the text of the
scene describes how other programs fail.

The event search of `solve_ivp` fails for the following reasons:

| mechanism | effect |
| --- | --- |
| closed sign test | The test of signs includes both ends of a step. A guard may be zero at the start of a run or \
after a restart. The test finds an event in the first step, if the guard is negative or zero at the end of this step. |
| only step ends | Signs are tested only at the ends of a step. Two zeros within one step are missed. |
| Brent's method | The root finder stops with an error after 100 iterations if a zero is of third order. |
| two values at a step end | The test of signs uses the state at the end of a step. The root finder uses the dense \
output, which differs from this state by rounding. It then finds no change of sign and stops with an error. |
| dense output | The event time is a zero of the dense output, which is less accurate than the steps. |
| trial steps | The solver tries a step beyond the domain of the model, and its state or Jacobian is not a number. The \
solver fails before it searches for the event. |

The picture of a scene shows one state in a time window around the first visible error of a method. The solid line is a
correct run. The dashed line is a run of the failing method. The legend names the failing method, and the table of
the scene names its setting. The strip below the curves shows the events of both runs in this window. The number of
events of each run is at the right edge of the strip. Circles are known exact values. If the error is below 4 % of
the range of the state in this window, a second panel shows the error.
"""
_QUESTIONS = {
    "events": "Does a method find each event once, at the right time and in the right order?",
    "stick": "Does a body stop, stay at rest and start to slip at the right times?",
    "sliding": "Does the motion stay on a switching surface, and leave it at the right time?",
    "accumulation": "Does a run continue correctly after infinitely many events?",
    "stiffness": "Can a method solve fast and slow rates in one run?",
    "stability": "Are the steps of a method short enough for stability, and accurate enough for long runs?",
    "sensitivity": "How accurate is a method if the motion amplifies its errors?",
}
_FAILURES = (*WRONG, HANG, ERROR)
_SYMBOLS = {
    RIGHT: "✓", WRONG_ANSWER: "**✗**", WRONG_SEQUENCE: "**≠**", HANG: "**∞**",
    REFUSED: "–", ERROR: "**!**", NOT_RUN: "",
}  # fmt: skip
_FAILURE = """A failure is a wrong answer, a wrong mode sequence, a hang or an error. A refused scene and a scene
that is not run do not count as failures. The [first page of the atlas](index.md) explains the methods."""
_LEAST_ORDER = 0.5  # smallest order that counts as convergence
_NUMBER = re.compile(r"(?<![\w.])\d+\.\d{9,}(?:e[+-]?\d+)?")
_DIGITS = 9  # digits of numbers in reasons
_RUBBING = "For friction at a hard stop, see the scene `rubbing-stop` and `hybridsim run thrown-block`."


def pages(result: Atlas, pictures: Collection[str] = ()) -> dict[str, str]:
    """Return the Markdown text of each page; `pictures` names the test cases that have a picture."""
    groups = result.by_class()
    found = {"index.md": index(result, groups)}
    for trouble, scenes in groups.items():
        found[f"{trouble or 'scenes'}.md"] = page(result, trouble, scenes, pictures)
    return found


def index(result: Atlas, groups: Mapping[str, list[Scene]]) -> str:
    """Return the text of the index page."""
    lines = [
        _INTRODUCTION.format(answer=_overall(result)),
        "| symbol | verdict | meaning |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {_SYMBOLS[verdict]} | {verdict} | {meaning} |" for verdict, meaning in VERDICTS.items()]
    lines += ["", "## Classes of scenes", "", "| class | scenes | topic |", "| --- | --- | --- |"]
    for trouble, scenes in groups.items():
        name = trouble or "scenes"
        lines.append(
            f"| [{name}]({name}.md) | {len(scenes)} | {TROUBLES.get(trouble, '').partition(': ')[2]} |"
        )
    lines += ["", "## Verdicts", "", *_matrix(result, groups), "", _RUBBING]
    shown = [verdict for verdict in VERDICTS if verdict != RIGHT]
    lines += ["", "## Integrators and other methods", ""]
    lines.append(f"| name | method | {RIGHT} | {' | '.join(shown)} |")
    lines.append("| --- | --- | " + " | ".join(["---"] * (1 + len(shown))) + " |")
    for one in result.configurations:
        cells = result.column(one)
        counts = [sum(cell.verdict == verdict for cell in cells) for verdict in (RIGHT, *shown)]
        lines.append(f"| `{one.name}` | {one.title} | {' | '.join(map(str, counts))} |")
    names = [trouble or "scenes" for trouble in groups]
    lines += ["", "```{toctree}", ":hidden:", "", *names, "```"]
    return "\n".join(lines) + "\n"


def _matrix(result: Atlas, groups: Mapping[str, list[Scene]]) -> list[str]:
    """Return a table of symbols of verdicts, with a row for each test case and a column for each method."""
    names = [one.name for one in result.configurations]
    lines = [f"| scene | {' | '.join(names)} |", "|" + " --- |" * (1 + len(names))]
    for trouble, scenes in groups.items():
        page = f"{trouble or 'scenes'}.md"
        lines.append(f"| **{trouble or 'scenes'}** |" + " |" * len(names))
        for scene in scenes:
            symbols = " | ".join(_SYMBOLS[cell.verdict] for cell in result.row(scene))
            lines.append(f"| [{scene.name}]({page}#{anchor(scene.title or scene.name)}) | {symbols} |")
    return lines


def anchor(title: str) -> str:
    """Return the anchor of a heading, for links to the heading."""
    return re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")


def page(result: Atlas, trouble: str, scenes: list[Scene], pictures: Collection[str] = ()) -> str:
    """Return the Markdown text of the page on one class of test cases."""
    sentence, table = _failures(result, scenes)
    opening = f"{_QUESTIONS.get(trouble, '')} {sentence} {_FAILURE}"
    lines = [f"# {TROUBLES.get(trouble, 'Scenes')}", "", _filled(opening), "", *table, ""]
    for scene in scenes:
        lines += [f"## {scene.title or scene.name}", "", f"`{scene.name}`. *Difficulty:* {scene.cause}.", ""]
        lines += [_filled(scene.story), ""]
        if scene.name in pictures:
            lines += [f"![{scene.title}]({trouble or 'scenes'}/{scene.name}.png)", ""]
        lines += verdicts(result.row(scene), result.configurations)
        source = CASES.get(scene.name, {}).get("source")
        lines += [*([f"| source | {_safe(source)} |"] if source else []), ""]
    return "\n".join(lines).rstrip() + "\n"


def _overall(result: Atlas) -> str:
    """Return a sentence on the number of test cases and on the methods that are right in all test cases."""
    right = [
        f"`{one.name}`"
        for one in result.configurations
        if all(cell.verdict == RIGHT for cell in result.column(one))
    ]
    question = "Which methods solve difficult scenes with events and friction, and which fail?"
    found = f"{question} The atlas runs {len(result.scenes)} scenes by {len(result.configurations)} methods."
    return _filled(f"{found} These methods are right in all scenes: {', '.join(right)}." if right else found)


def _failures(result: Atlas, scenes: Sequence[Scene]) -> tuple[str, list[str]]:
    """Return the number of test cases with a failure as a sentence, and a table of methods by their failures."""
    failed = {
        one.name: {scene.name for scene in scenes if result.cells[scene.name, one.name].verdict in _FAILURES}
        for one in result.configurations
    }
    of_number: dict[int, list[str]] = {}
    for name, those in failed.items():
        of_number.setdefault(len(those), []).append(f"`{name}`")
    rows = [f"| {number} | {', '.join(names)} |" for number, names in sorted(of_number.items())]
    failing = len(set().union(*failed.values()))
    sentence = f"At least one method fails in {failing} of the {len(scenes)} scenes of this page."
    return sentence, ["| scenes with a failure | methods |", "| --- | --- |", *rows]


def _filled(text: str) -> str:
    return textwrap.fill(" ".join(text.split()), _WIDTH, break_on_hyphens=False)


def verdicts(cells: list[Cell], configurations: Sequence[Configuration] = ()) -> list[str]:
    """Return the verdicts on one test case: the methods that are right, and a line for each other method."""
    lacks = {one.name: one.method.lacks for one in configurations}
    right = [cell for cell in cells if cell.verdict == RIGHT]
    lines = ["| | |", "| --- | --- |"]
    if right:
        lines.append(f"| {RIGHT} | {', '.join(map(_with_error, right))} |")
    for verdict in (*WRONG, HANG, REFUSED, ERROR):
        for reason, names in _by_reason([cell for cell in cells if cell.verdict == verdict]).items():
            own = [
                lacks.get(one.configuration, {})
                for one in cells
                if (one.verdict, one.reason) == (verdict, reason)
            ]
            note = _note_on_design(reason, own[0]) if verdict == WRONG_SEQUENCE and len(own) == 1 else ""
            lines.append(f"| **{verdict}** | {', '.join(names)}: {_safe(reason)}{note} |")
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
    """Return a method's name with its error, and with its order of convergence if this can be observed."""
    known = []
    if cell.error is not None and cell.rows:
        known.append(f"{cell.error:.0e}")
    if cell.order is not None and cell.order >= _LEAST_ORDER:
        known.append(f"order {cell.order:.1f}")
    return f"{cell.configuration} ({', '.join(known)})" if known else cell.configuration


def _safe(reason: str) -> str:
    """Return a reason as text that is safe in a Markdown table, with numbers in few digits."""
    return _NUMBER.sub(lambda number: f"{float(number[0]):.{_DIGITS}g}", reason).replace("|", r"\|")


def _note_on_design(reason: str, lacks: Mapping[str, str]) -> str:
    """Return a note for a false stop by a method that, by design, does not locate events."""
    is_stop = re.search(r"and is (\w+):stick at", reason) is not None
    return f" (by design: {lacks['located']})" if is_stop and "located" in lacks else ""
