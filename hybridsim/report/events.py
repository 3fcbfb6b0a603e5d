"""This module stores the events and the modes of a run for a report, and the reasons of events."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.presentation.colours import INK, mode_colours
from hybridsim.report.embedded import array, indices, numbers
from hybridsim.solution import Event, Solution

MOST_EVENTS = 120_000  # a report has the first and the last half of more events than this
MOST_INTERVALS = 120_000  # of all components; of more, the modes in each of many columns are stored
_FIRST_REASONS, _MOST_KINDS = 200, 50  # events with a reason: the first ones, and the first of each change
_STATES_SIZE = 1_100_000  # bytes for the states at events
_COLUMNS = 4096  # more than the page has pixels across
_LEAST_SHARE = 1e-3  # of a column, for a mode that occurs in it


def events_of(solution: Solution) -> dict[str, Any]:
    """Return the events of a run for the page, or only the first and last events if there are very many."""
    events = solution.events
    half = MOST_EVENTS // 2
    shown = list(range(len(events)))
    if len(events) > MOST_EVENTS:
        shown = [*range(half), *range(len(events) - half, len(events))]
    changes: dict[tuple[str, ...], int] = {}
    numbers = [changes.setdefault(_change(events[k]), len(changes)) for k in shown]
    return {
        "count": len(events),
        "omitted": len(events) - len(shown),
        "t": array([events[k].t for k in shown], "f8"),
        "change": indices(numbers),
        "texts": [_short_text(*change) for change in changes],
        "details": [_long_text(*change) for change in changes],
        "counts": np.bincount(numbers).tolist(),
        "states": _states(solution, [events[k] for k in shown]),
        "reasons": _reasons(solution, _explained(numbers, shown)),
    }


def _change(event: Event) -> tuple[str, ...]:
    return event.kind, event.component, event.guard, event.source, event.target


def _short_text(kind: str, component: str, guard: str, source: str, target: str) -> str:
    return f"{component}: {source} → {target}" if source or target else f"{component}: {kind}"


def _long_text(kind: str, component: str, guard: str, source: str, target: str) -> str:
    change = f" from {source} to {target}" if source or target else ""
    return f"{kind} of {component}{change}" + (f", guard {guard}" if guard else "")


def _states(solution: Solution, events: list[Event]) -> list[dict[str, Any]] | None:
    """Return each state just before and after the events; "after" is None if no event changes the state."""
    if not events or not solution.names:
        return None
    before = np.array([event.x_minus for event in events]).T
    after = np.array([event.x_plus for event in events]).T
    jumps = (before != after).any(axis=1)
    if (len(before) + jumps.sum()) * len(events) * 16 / 3 > _STATES_SIZE:
        return None
    return [
        {"before": numbers(x), "after": numbers(y) if jumps[i] else None}
        for i, (x, y) in enumerate(zip(before, after, strict=True))
    ]


def _explained(numbers: list[int], shown: list[int]) -> list[int]:
    """Return the numbers of the explained events: the first events, and the first event of each kind of change."""
    firsts: dict[int, int] = {}
    for number, k in zip(numbers, shown, strict=True):
        firsts.setdefault(number, k)
    return sorted({*shown[:_FIRST_REASONS], *list(firsts.values())[:_MOST_KINDS]})


def _reasons(solution: Solution, chosen: list[int]) -> dict[str, str]:
    """Return the reasons of events as text, by the number of the event."""
    found = {}
    for k in chosen:
        try:
            explanation = solution.explain(k)
        except UsageError:  # the run did not keep what explains events
            return {}
        notes = [f"Note: {remark}." for remark in explanation.remarks]
        found[str(k)] = " ".join([f"{explanation.reason}.", *notes])
    return found


def modes_of(solution: Solution) -> list[dict[str, Any]]:
    """Return the modes of each component with their colours, and their time intervals or columns."""
    colours = mode_colours(solution.components)
    held = {c.name: c.surface.hold for c in solution.components if getattr(c, "surface", None)}
    intervals = solution.modes
    is_long = sum(map(len, intervals.values())) > MOST_INTERVALS
    found = []
    for component, own in intervals.items():
        names = list(dict.fromkeys(interval.mode for interval in own))
        numbers = np.array([names.index(interval.mode) for interval in own], dtype=np.int64)
        ends = np.sort(np.array([(interval.t0, interval.t1) for interval in own]).reshape(-1, 2), axis=1)
        order = np.argsort(ends[:, 0], kind="stable")
        starts, numbers = ends[order, 0], numbers[order]
        if is_long:
            starts, numbers = in_columns(ends[order], numbers)
        found.append(
            {
                "name": component,
                "modes": names,
                "colours": ["" if colours.get(name, INK) == INK else colours[name] for name in names],
                "held": names.index(held[component]) if held.get(component) in names else -1,
                "is_exact": not is_long,
                "starts": array(starts, "f8"),
                "mode": indices(numbers),
            }
        )
    return found


def in_columns(ends: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return equal columns in place of many intervals; each column is divided among its modes by their shares of time.

    ends (m, 2), numbers (m,) : the ends and modes of all intervals, ascending.
    """
    t0, t1 = ends[0, 0], ends[-1, 1]
    edges = np.linspace(t0, t1, _COLUMNS + 1)
    width = edges[1] - edges[0]
    knots = np.append(ends[:, 0], t1)
    first = np.clip(np.searchsorted(edges, ends[:, 0], side="right") - 1, 0, _COLUMNS - 1)
    last = np.clip(np.searchsorted(edges, ends[:, 1], side="left"), first + 1, _COLUMNS)
    modes = np.unique(numbers)
    shares = np.zeros((_COLUMNS, len(modes)))
    for k, mode in enumerate(modes):
        is_own = numbers == mode
        change = np.zeros(_COLUMNS + 1, dtype=np.int64)
        np.add.at(change, first[is_own], 1)
        np.add.at(change, last[is_own], -1)
        spent = np.concatenate([[0.0], np.cumsum(np.where(is_own, np.diff(knots), 0.0))])
        share = np.diff(np.interp(edges, knots, spent)) / width
        shares[:, k] = np.where(np.cumsum(change)[:-1] > 0, np.maximum(share, _LEAST_SHARE), 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    column, found = np.nonzero(shares)
    before = np.cumsum(shares, axis=1) - shares
    return edges[column] + before[column, found] * width, modes[found]
