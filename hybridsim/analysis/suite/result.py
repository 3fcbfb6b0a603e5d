"""This module defines the result of the comparison suite: one comparison per test case, and overall verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.compare.comparison import Comparison, differences
from hybridsim.analysis.compare.comparison_request import positives
from hybridsim.analysis.compare.rows import NOT_STARTED, STOPPED, Row
from hybridsim.analysis.compare.table import milliseconds, setting, turns, versions
from hybridsim.analysis.suite.scenes import Scene
from hybridsim.analysis.suite.verdict import COMMON, USELESS, Verdict, verdict
from hybridsim.errors import printable
from hybridsim.files import csv_records, json_record
from hybridsim.presentation.readable import Readable, aligned
from hybridsim.presentation.tables import library

if TYPE_CHECKING:
    import pandas as pd

ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-11)


@dataclass(frozen=True)
class SceneResult:
    """One test case of the suite, and the comparison of the integrators on this test case."""

    scene: Scene
    comparison: Comparison

    def cheapest(self, accuracy: float) -> Row | None:
        """Return the fastest row with correct modes and a state error of at most a given accuracy."""
        good = [row for row in self.comparison.rows if self._reaches(row, accuracy)]
        # other rows include the time of warming up
        timed = [row for row in good if row.cost and row.cost.repetitions]
        good = timed or good
        return min(good, key=lambda row: row.cost.wall_time if row.cost else 0.0, default=None)

    def _reaches(self, row: Row, accuracy: float) -> bool:
        reading = self.comparison.reading(row, "state")
        return (
            reading is not None
            and reading.value <= accuracy
            and row.errors is not None
            and not row.errors.wrong_modes
        )


@dataclass(frozen=True)
class SuiteComparison(Readable):
    """The comparison of all integrators on all test cases.

    Parameters
    ----------
    results : tuple of SceneResult
        One for each scene, in order.
    repeat : int
        The requested number of timed repetitions.
    budget, seconds : float
        The time budget of the suite, and the time it took.

    Examples
    --------
    >>> import hybridsim as hs
    >>> suite = hs.compare_suite(scenes=["P1"], budget=60)  # doctest: +SKIP
    >>> suite.labels  # doctest: +SKIP
    """

    results: tuple[SceneResult, ...]
    repeat: int
    budget: float
    seconds: float

    def plot(self) -> Any:
        """Draw a small chart of error against cost for each test case; see `hybridsim.plot.suite_page`.

        It returns the axes; ``hybridsim.plot.save`` writes them to a file.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").suite_page(self)

    def __repr__(self) -> str:
        return self.table()

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of the compared integrators and laws, in the order of the comparison."""
        return tuple(dict.fromkeys(label for result in self.results for label in result.comparison.labels))

    def verdicts(self) -> dict[str, dict[str, Verdict]]:
        """Return the verdict for each test case and series at a common tolerance."""
        return {
            result.scene.name: {
                label: verdict(result.scene, [row for row in result.comparison.rows if row.label == label])
                for label in result.comparison.labels
            }
            for result in self.results
        }

    def cheapest(self, accuracies: Sequence[float] = ACCURACIES) -> dict[str, dict[float, Row | None]]:
        """Return the cheapest row for each test case and accuracy; None if no row is so accurate."""
        accuracies = positives(accuracies, "accuracies") or ()
        return {
            result.scene.name: {accuracy: result.cheapest(accuracy) for accuracy in accuracies}
            for result in self.results
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on runs that were skipped or timed less often, and on uncertain references."""
        left_out: dict[str, dict[str, list[str]]] = {}
        for result in self.results:
            for row in result.comparison.rows:
                if row.status in (NOT_STARTED, STOPPED):
                    left_out.setdefault(row.label, {}).setdefault(result.scene.name, []).append(setting(row))
        notes = [
            f"{label}, skipped because of its run time: "
            + "; ".join(f"{scene} at {', '.join(settings)}" for scene, settings in scenes.items())
            for label, scenes in left_out.items()
        ]
        for result in self.results:
            notes += [f"{result.scene.name}: {warning}" for warning in result.comparison.warnings]
        timed = [
            row.cost.repetitions for result in self.results for row in result.comparison.rows if row.cost
        ]
        fewer = [repetitions for repetitions in timed if repetitions < self.repeat]
        if fewer:
            notes.append(
                f"{len(fewer)} of {len(timed)} runs were timed fewer than {self.repeat} times, "
                f"{fewer.count(0)} runs only while they warmed up"
            )
        return tuple(notes)

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Versions and machine; the comparisons contain the hashes of the models."""
        facts = self.results[0].comparison.provenance
        return {name: value for name, value in facts.items() if not name.startswith("model")}

    def table(self) -> str:
        """Return the results as text: correct runs, cheapest runs, uncertainty of the references, and notes."""
        blocks = [_who_is_right(self), _cheapest(self), _references(self), _notes(self)]
        return printable("\n\n".join("\n".join(block) for block in blocks))

    def to_csv(self, path: str | Path) -> None:
        """Write one line per run of any test case; times are in the model's unit, wall times in seconds."""
        csv_records(path, self.records())

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame with one row per run of any test case and the columns of `to_csv`."""
        return library("pandas").DataFrame(self.records())

    def records(self) -> list[dict[str, Any]]:
        """Return the runs of all test cases as plain Python values."""
        rows = ((result.scene.name, row) for result in self.results for row in result.comparison.records())
        return [{"scene": scene, **row} for scene, row in rows]

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain Python values."""
        return {
            "repeat": self.repeat,
            "budget": self.budget,
            "seconds": self.seconds,
            "notes": list(self.notes),
            "provenance": dict(self.provenance),
            "verdicts": {
                scene: {label: str(found) for label, found in verdicts.items()}
                for scene, verdicts in self.verdicts().items()
            },
            "cheapest": {
                scene: {
                    f"{accuracy:.0e}": {
                        "label": row.label,
                        "setting": setting(row),
                        "wall_time": row.cost.wall_time,
                    }
                    if row and row.cost
                    else None
                    for accuracy, row in rows.items()
                }
                for scene, rows in self.cheapest().items()
            },
            "scenes": {
                result.scene.name: {"why": result.scene.why, **result.comparison.to_dict()}
                for result in self.results
            },
        }

    def to_json(self, path: str | Path | None = None) -> str:
        """Return all results as JSON text, with versions and machine. With a path, also write the text."""
        return json_record(self.to_dict(), path)


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
