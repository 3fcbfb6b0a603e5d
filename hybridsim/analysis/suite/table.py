"""This module writes the comparison suite as text: correct runs, cheapest runs, and uncertainty of the references."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.analysis.compare.table import differences, milliseconds, setting, turns, versions
from hybridsim.analysis.suite.verdict import COMMON, USELESS
from hybridsim.errors import printable
from hybridsim.presentation.readable import aligned

if TYPE_CHECKING:
    from hybridsim.analysis.suite.result import SuiteComparison


def table(suite: SuiteComparison) -> str:
    """Return the results of the suite as text."""
    blocks = [_who_is_right(suite), _cheapest(suite), _references(suite), _notes(suite)]
    return printable("\n\n".join("\n".join(block) for block in blocks))


def _who_is_right(suite: SuiteComparison) -> list[str]:
    verdicts = suite.verdicts()
    # A long name is split over two lines, so that nine columns fit.
    heads = [name.rpartition("-") if len(name) > 8 else ("", "", name) for name in verdicts]
    rows = [["", *(first + dash for first, dash, _ in heads)], ["", *(last for *_, last in heads)]]
    rows += [
        [f"  {label}", *(str(found.get(label, "-")) for found in verdicts.values())] for label in suite.labels
    ]
    title = (
        f"Correct runs, at rtol {COMMON['rtol']:.0e}, or with {COMMON['steps_per_period']:g} steps per period "
        "if the step is fixed"
    )
    return [
        title,
        *aligned(rows),
        f"off: the modes are right, but a state is wrong by more than {USELESS:.0%} of its amplitude",
    ]


def _cheapest(suite: SuiteComparison) -> list[str]:
    cheapest = suite.cheapest()
    accuracies = next(iter(cheapest.values()))
    rows = [["", *(f"to {accuracy:.0e}" for accuracy in accuracies)]]
    for scene, found in cheapest.items():
        cells = [
            f"{row.label} {setting(row)}, {milliseconds(row.cost.wall_time)}" if row and row.cost else "none"
            for row in found.values()
        ]
        rows.append([f"  {scene}", *cells])
    return ["Cheapest, by the largest error of the states over the run", *aligned(rows)]


def _references(suite: SuiteComparison) -> list[str]:
    rows = [["", "reference", "compared with", "differs by"]]
    for result in suite.results:
        found = result.comparison
        second = found.second_reference or "nothing"
        difference = differences(found) if found.difference else "-"
        rows.append([f"  {result.scene.name}", found.reference, second, difference])
    return ["References", *aligned(rows)]


def _notes(suite: SuiteComparison) -> list[str]:
    return [
        "State errors: the largest error of all states over the run, relative to the state's amplitude.",
        "Event times are in periods of the forcing if the model has one, else in the model's unit of time.",
        f"Wall times: {turns(suite.repeat)} of all runs of all scenes; short runs are repeated within "
        "one measurement.",
        f"The suite took {suite.seconds:.0f} s of its budget of {suite.budget:g} s.",
        versions(suite.provenance),
        *(["Differences from the request:", *(f"  {note}" for note in suite.notes)] if suite.notes else []),
    ]
