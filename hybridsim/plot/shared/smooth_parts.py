"""This module cuts a solution at its events into smooth parts, with a bounded number of sample points."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybridsim.arguments import two_numbers
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.period import forcing_period
from hybridsim.errors import UsageError, nearest
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalSystem
from hybridsim.model.checks.units import unit_of as unit_of_expression
from hybridsim.model.checks.units import units_of
from hybridsim.plot.shared.curve_samples import sample_curves
from hybridsim.solution import Solution
from hybridsim.solution.run_trajectory import relative_velocity

# First division of a whole picture, two parts per horizontal pixel, before parts on which a curve bends are divided.
# Between events there are at least 2 parts, and at least 4 if the picture then has no more than 60 000 points.
_PARTS, _LEAST, _MOST_POINTS = 3_000, (2, 4), 60_000
_MOST_STEPS = 20_000  # of the integrator, among the ends of the parts
# If there are more periods than a picture can resolve, only the last few are drawn, without the transient.
_MAX_PERIODS, _LAST_PERIODS = 24, 4
CUTS = ("transition", "monitor", "scheduled")  # kinds of events at which a curve may jump or bend
_MAX_EVENTS, _LAST_EVENTS = 300, 24  # the same for events of a motion without a period
# A number of periods that differs from a whole one by this fraction is whole, because an end such as 100T is
# rounded.
_WHOLE = 1e-9
_ROUNDING = 1e-9  # of an input: a smaller difference at a knot is no jump
_MOST_KNOTS = 1000  # of an input in a window: at more of them its curve is not cut


@dataclass(frozen=True)
class SmoothPart:
    """A smooth part of a run: its times (k,), the values (k,) of each quantity, and the modes."""

    t: NDArray[np.float64]
    values: Mapping[str, NDArray[np.float64]]
    modes: Mapping[str, str]


@dataclass(frozen=True)
class Samples:
    """The samples of all smooth parts of a window in order of time."""

    t: NDArray[np.float64]  # (k,), an inner event time twice
    values: Mapping[str, NDArray[np.float64]]  # (k,) of each quantity
    firsts: NDArray[np.int64]  # (parts + 1,): the first sample of each part, and k


@dataclass(frozen=True)
class Window:
    """The part of a run to draw, with a note for the title."""

    t0: float
    t1: float
    note: str = ""


def require_run(solution: Any) -> None:
    """Raise an error for objects that are not solutions."""
    if not hasattr(solution, "model"):
        raise UsageError(
            f"{type(solution).__name__} {getattr(solution, 'name', '')}".rstrip() + " cannot be drawn",
            remedy="use the result of a run: hs.simulate(model, (t0, t1))",
        )


def refuse_arrays(solution: Any) -> None:
    """Raise an error for objects that are not solutions, and for solutions of a `MechanicalSystem`."""
    require_run(solution)
    if isinstance(solution.model, MechanicalSystem):
        raise UsageError(
            f"{type(solution).__name__} of {solution.model.name} cannot be drawn by this function",
            remedy="draw its time history with sol.plot(), or simulate system.to_model() and draw the "
            "new solution",
        )


def window_of(solution: Solution, t_span: tuple[float, float] | None) -> Window:
    """Return the part of a run to draw: `t_span` if given, otherwise all or the last periods or events."""
    start, end = sorted((solution.t_start, solution.t_end))
    if t_span is not None:
        t0, t1 = sorted(two_numbers(t_span, "t_span", "use two times, (a, b)"))
        if not (t1 > start and t0 < end):
            raise UsageError(
                f"t_span = ({t0:g}, {t1:g}) is outside the run",
                remedy=f"the run covers t = {start:g} to {end:g}",
            )
        return Window(max(t0, start), min(t1, end))
    period = _period(solution.model)
    if period is None:
        return _last_events(solution, start, end)
    if end - start <= _MAX_PERIODS * period:
        return Window(start, end)
    return Window(
        end - _LAST_PERIODS * period,
        end,
        f"the last {_LAST_PERIODS} of {_whole((end - start) / period)} periods",
    )


def _period(model: Any) -> float | None:
    """Return the period of the forcing, or None if there is no single period."""
    if not isinstance(model, MechanicalSystem):
        return forcing_period(model)
    signals = [signal for terms in model.forcing.values() for signal in terms]
    signals += [contact.base for contact in model.contacts]
    rates = {abs(signal.omega) for signal in signals if isinstance(signal, Harmonic) and signal.omega}
    return 2.0 * math.pi / rates.pop() if len(rates) == 1 else None


def event_times(solution: Solution, kinds: Collection[str]) -> NDArray[np.float64]:
    """Return the times of the events of given kinds; the events of a `MechanicalSystem` are read as arrays."""
    if isinstance(solution.model, MechanicalSystem):
        parts = solution.modes if "transition" in kinds else ()
        return np.concatenate([[], *(solution.event_times(part) for part in parts)])
    return np.array([event.t for event in solution.events if event.kind in kinds])


def _last_events(solution: Solution, start: float, end: float) -> Window:
    """Return the whole run, or its last events if very many events are spread over the run."""
    times = event_times(solution, ["transition"])
    if len(times) <= _MAX_EVENTS:
        return Window(start, end)
    first = end - (end - start) * _LAST_EVENTS / len(times)
    count = int((times >= first).sum())
    if not 0.5 * _LAST_EVENTS <= count <= 2 * _LAST_EVENTS:
        return Window(start, end)
    return Window(first, end, f"the last {count} of {len(times)} events")


def _input_jumps(solution: Solution, window: Window) -> NDArray[np.float64]:
    """Return the times in a window at which an input jumps; inputs with very many knots are left out."""
    jumps: list[NDArray[np.float64]] = []
    inputs = getattr(solution.model, "inputs", ())
    for declared, signal in zip(inputs, solution._system.signals if inputs else ()):
        knots: list[float] = []
        knot = signal.next_knot(Instant(window.t0), True)
        while knot is not None and float(knot) < window.t1 and len(knots) <= _MOST_KNOTS:
            knots.append(float(knot))
            knot = signal.next_knot(knot, True)
        if 0 < len(knots) <= _MOST_KNOTS:
            t = np.array(knots)
            before, after = (solution.output(declared.name, t, side=side) for side in "-+")
            jumps.append(t[np.abs(after - before) > _ROUNDING * np.abs(after).max()])
    return np.concatenate([[], *jumps])


def _whole(periods: float) -> int:
    """Round a number of periods down to an integer."""
    return math.floor(periods * (1 + _WHOLE))


def title_of(model: Any, name: str) -> str:
    """Return the title of a state or output, or "friction force" of a contact, or an empty text."""
    if isinstance(model, MechanicalSystem):
        return ""
    found = {state.name: state.title for state in model.states}
    found |= {output.name: output.title for output in model.outputs if not found.get(output.name)}
    found |= {discrete.name: discrete.title for discrete in model.discrete}
    return found.get(name) or ("friction force" if any(one.name == name for one in model.contacts) else "")


def known_units(solution: Solution) -> dict[str, str]:
    """Return the units of states and other quantities by name; a `MechanicalSystem` declares no units."""
    if isinstance(solution.model, MechanicalSystem):
        return dict.fromkeys(solution.names, "")
    return units_of(solution.model)


def unit_of(solution: Solution, name: str) -> str:
    """Return the unit of a quantity, or an empty text if none is declared."""
    units = known_units(solution)
    if name not in units:
        try:
            solution.output(name, solution.t_start)
        except UsageError:
            raise UsageError(
                f"{solution.model.name} has no quantity '{name}'",
                remedy=nearest(name, units, kind="quantities"),
            ) from None
        model = solution.model
        if isinstance(model, MechanicalSystem):
            return ""
        expressions = {relative_velocity(contact.name): contact.velocity for contact in model.contacts}
        expressions |= dict(getattr(model, "definitions", ()))
        return unit_of_expression(model, expressions[name]) if name in expressions else ""
    return units[name]


def extent(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the least and largest value of a quantity."""
    return float(np.min(values)), float(np.max(values))


def require_length(window: Window) -> None:
    """Raise an error if the part of a run to be drawn has zero length."""
    if not window.t1 > window.t0:
        raise UsageError(
            f"there is no curve from t = {window.t0:g} to {window.t1:g}",
            remedy="draw a longer run, or select a longer part of the run with `t_span`",
        )


def samples_of(solution: Solution, names: Sequence[str], window: Window) -> Samples:
    """Return the samples of a window, with both sides of each event, so that each smooth part has its own ends.

    Straight lines between the samples show the curves: the samples are dense where a curve bends.
    """
    require_length(window)
    times = np.concatenate([event_times(solution, CUTS), _input_jumps(solution, window)])
    cuts = np.unique([window.t0, *times[(times > window.t0) & (times < window.t1)], window.t1])
    lengths = np.diff(cuts)
    least = np.clip(_MOST_POINTS // (2 * len(lengths)), *_LEAST)
    counts = np.maximum(least, np.ceil(_PARTS * lengths / lengths.sum())).astype(int)
    firsts = np.concatenate([[0], np.cumsum(counts)])
    steps = np.arange(firsts[-1]) - np.repeat(firsts[:-1], counts)
    grid = np.repeat(cuts[:-1], counts) + steps * np.repeat(lengths / counts, counts)
    own = solution._trajectory.own_times
    own = own[(own > window.t0) & (own < window.t1)]
    knots = np.union1d(np.union1d(grid, cuts), own[:: 1 + len(own) // _MOST_STEPS])
    sides = ("-", "+") if solution.t_end >= solution.t_start else ("+", "-")
    t, values, firsts = sample_curves(
        lambda t, is_after: _evaluate(solution, names, t, sides[is_after]),
        knots,
        np.isin(knots[1:], cuts),
        most=_MOST_POINTS,
    )
    return Samples(t, dict(zip(names, values, strict=True)), firsts)


def smooth_parts_of(solution: Solution, names: Sequence[str], window: Window) -> list[SmoothPart]:
    """Return the smooth parts of a window in order of time, split at the events."""
    samples, modes_at = samples_of(solution, names, window), mode_lookup(solution)
    return [
        SmoothPart(
            samples.t[a:b],
            {name: samples.values[name][a:b] for name in names},
            modes_at((samples.t[a] + samples.t[b - 1]) / 2),
        )
        for a, b in itertools.pairwise(samples.firsts.tolist())
    ]


def _evaluate(
    solution: Solution, names: Sequence[str], t: NDArray[np.float64], side: str
) -> NDArray[np.float64]:
    """Return the values (n, k) of quantities at times (k,); all states are evaluated together."""
    states = [state.name for state in getattr(solution.model, "states", ())]
    x = solution(t, side=side) if any(name in states for name in names) else np.zeros((0, len(t)))
    rows = [
        x[states.index(name)] if name in states else solution.output(name, t, side=side) for name in names
    ]
    return np.array(rows).reshape(len(names), len(t))


def mode_lookup(solution: Solution) -> Callable[[float], dict[str, str]]:
    """Return a function from a time to the mode of each component."""
    starts, modes = {}, {}
    for component, intervals in solution.modes.items():
        ordered = sorted((min(interval.t0, interval.t1), interval.mode) for interval in intervals)
        starts[component] = [start for start, _ in ordered]
        modes[component] = [mode for _, mode in ordered]

    def lookup(t: float) -> dict[str, str]:
        return {name: modes[name][max(bisect.bisect_right(starts[name], t) - 1, 0)] for name in modes}

    return lookup
