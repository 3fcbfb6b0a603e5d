"""This module makes all runs of one or several test cases within a time budget: first runs, then timed repetitions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hybridsim.analysis.compare.lines import Series
from hybridsim.analysis.compare.prepared_case import PreparedCase
from hybridsim.analysis.compare.reference import Reference
from hybridsim.analysis.compare.rows import NOT_STARTED, STOPPED, Row
from hybridsim.analysis.compare.timing import timed_in_turns
from hybridsim.analysis.time_budget import Stopwatch

# A run may take this multiple of its equal share of the budget, because most runs take far less.
_SHARES = 10
# The shares allow for this many repetitions; further ones are dropped first.
_TIMED_TURNS = 3
# A run that takes longer than predicted is stopped at this multiple of its limit.
_PATIENCE = 2


class Budget:
    """A time limit in seconds that starts when the object is made; compiling does not count."""

    def __init__(self, seconds: float) -> None:
        self.seconds, self._watch = seconds, Stopwatch()

    @property
    def spent(self) -> float:
        """The seconds since the start."""
        return self._watch.seconds

    @property
    def left(self) -> float:
        """The remaining seconds, at least zero."""
        return max(self.seconds - self.spent, 0.0)


@dataclass(frozen=True)
class Entry:
    """A test case with its reference and the series of runs to make on it."""

    case: PreparedCase
    reference: Reference
    lines: tuple[Series, ...]


@dataclass(frozen=True)
class _Run:
    entry: int
    line: int
    level: int


def timed_rows(
    entries: Sequence[Entry], repeat: int, budget: Budget, step: Callable[[str], None]
) -> list[tuple[Row, ...]]:
    """Make all runs, and return the rows of each test case in the order of its series.

    First everything is run once, the loosest setting of every line before the second of any. Lines that were fast
    so far come first. The time of the next setting of a line is predicted from its last two. A run that would take
    more than ten times its equal share of the budget is not started; if the next runs do not all fit, the longest
    are dropped. The remaining time goes to timed repetitions in turns, which are dropped first if it is short. Each
    row states the outcome.

    Parameters
    ----------
    step : called with the name of the next item, for each first run and each repetition, done or not.
    """
    rows: dict[_Run, Row] = {}
    runs = [
        _Run(e, i, level)
        for e, entry in enumerate(entries)
        for i, line in enumerate(entry.lines)
        for level in range(len(line.values))
    ]
    share = _SHARES * budget.seconds / max(len(runs) * (1 + min(repeat, _TIMED_TURNS)), 1)
    for level in range(max((run.level + 1 for run in runs), default=0)):
        here = [run for run in runs if run.level == level]
        predicted = {run: _predicted(entries, rows, run) for run in here}
        too_long = {
            run: f"the run would take {seconds:.2g} s, more than its share of the budget of {budget.seconds:.3g} s"
            if math.isfinite(seconds)
            else "a looser setting took too long"
            for run, seconds in predicted.items()
            if seconds > share
        }
        too_long |= dict.fromkeys(
            _not_fitting({run: predicted[run] for run in here if run not in too_long}, budget.left),
            f"the budget of {budget.seconds:.3g} s is spent",
        )
        for run in sorted(here, key=lambda run: predicted[run] or _last_time(rows, run)):
            entry = entries[run.entry]
            line = entry.lines[run.line]
            value = line.values[level]
            step(f"{entry.case.model.name}: {line.label}, {line.varied} {value:g}")
            reason = too_long.get(run) or (
                "" if budget.left else f"the budget of {budget.seconds:.3g} s is spent"
            )
            if reason:
                row = Row(
                    line.integrator, line.label, (line.varied, value), line.options_at(value), NOT_STARTED
                )
                rows[run] = replace(row, message=reason, form=line.regularized)
            else:
                limit = min(_PATIENCE * share, budget.left)
                rows[run] = entry.case.first_run(line, value, entry.reference, limit)
    _time(entries, rows, repeat, budget, step)
    return [tuple(rows[run] for run in runs if run.entry == e) for e in range(len(entries))]


def _predicted(entries: Sequence[Entry], rows: dict[_Run, Row], run: _Run) -> float:
    """Predict the seconds of a run from its last two looser settings; return 0 if fewer than two were run.

    The prediction is infinite if a looser setting was stopped.
    """
    before = [rows[replace(run, level=level)] for level in range(run.level)]
    done = [(row.setting[1], row.cost) for row in before if row.cost is not None]
    if any(row.status == STOPPED for row in before):
        return math.inf
    if len(done) < 2:  # the first time may also include one-time set-up
        return 0.0
    (earlier, cheaper), (value, cost) = done[-2:]
    line = entries[run.entry].lines[run.line]
    growth = math.log(max(cost.work / cheaper.work, 1.0)) / abs(math.log(value / earlier))
    return cost.wall_time * math.exp(growth * abs(math.log(line.values[run.level] / value)))


def _last_time(rows: dict[_Run, Row], run: _Run) -> float:
    """Return the seconds of the next looser setting of a run, or 0 if there is no finished one."""
    before = rows.get(replace(run, level=run.level - 1))
    return before.cost.wall_time if before is not None and before.cost is not None else 0.0


def _not_fitting(predicted: dict[_Run, float], seconds: float) -> list[_Run]:
    """Return the runs to skip, the longest first, so that the other runs fit into the budget."""
    gone = []
    total = sum(predicted.values())
    for run in sorted(predicted, key=lambda run: -predicted[run]):
        if total <= seconds:
            break
        total -= predicted[run]
        gone.append(run)
    return gone


def _time(
    entries: Sequence[Entry], rows: dict[_Run, Row], repeat: int, budget: Budget, step: Callable[[str], None]
) -> None:
    timed = [run for run, row in rows.items() if row.cost is not None]
    calls, expected = [], []
    for run in timed:
        entry, cost = entries[run.entry], rows[run].cost
        line = entry.lines[run.line]
        calls.append(entry.case.call(line, line.values[run.level]))
        expected.append(cost.wall_time if cost else 0.0)

    def announce(k: int) -> None:
        step(f"timing {entries[timed[k].entry].case.model.name}: {rows[timed[k]].label}")

    times = timed_in_turns(calls, repeat, announce, expected, time.monotonic() + budget.left)
    for run, spent in zip(timed, times, strict=True):
        rows[run] = rows[run].timed(spent)
