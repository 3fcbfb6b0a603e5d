"""This module checks the header and the arrays of a saved solution against its model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.engine.record.array_forms import (
    Form,
    check_count,
    check_finite,
    check_forms,
    check_instant,
    check_modes,
    check_number,
    check_range,
)
from hybridsim.engine.run.headway import HEADWAY_PACE, HEADWAY_SIZE
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.system import System

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]

_TASK: dict[str, Form] = {
    "x0": (float, ("n",)),
    "z0": (np.int64, ("C",)),
    "discrete": (float, ("D",)),
    "atol": (float, ("n",)),
}
# Arrays of the checkpoints that the two loops write; see `hybridsim.engine.events.outcome` and
# `hybridsim.integrators.fixed_step.run`.
_AFTER_EVENT: dict[str, Form] = {
    "x": (float, ("n",)),
    "p": (float, ("P",)),
    "z": (np.int64, ("C",)),
    "sides": (np.int64, ("G",)),
    "orders": (np.int64, ("G",)),
    "monitor_sides": (np.int64, ("M",)),
    "monitor_orders": (np.int64, ("M",)),
    "x_error": (float, ("n",)),
    "guard_floors": (float, ("G",)),
    "monitor_floors": (float, ("M",)),
    "continuous": (bool, ()),
    "step_size": (float, ()),
}
_AFTER_STEPS: dict[str, Form] = {
    "x": (float, ("n",)),
    "z": (np.int64, ("C",)),
    "discrete": (float, ("D",)),
    "scale": (float, ("n",)),
    "fresh": (bool, ("M",)),
    "turned": (bool, ()),
}
_MOST_INTERVALS = 64  # more than the intervals that a component's pace ever holds
_NOBODY = -1  # the component number of a pace that belongs to resets of monitors
_TEXTS = ("status", "message", "reason")


def mode_counts(system: System) -> list[int]:
    """Return the number of modes of each component of a system."""
    return [len(a.modes) for a in system.automata]


def sizes_of(system: System) -> dict[str, int]:
    """Return the sizes in array shapes by symbol, such as n for the number of states."""
    return {
        "n": system.n,
        "C": len(system.automata),
        "P": system.layout.size,
        "D": system.layout.discrete,
        "G": system.guard_count,
        "M": len(system.monitor_names),
    }


def check_header(header: Header) -> None:
    """Reject a header in which an entry has the wrong type."""
    for name in _TEXTS:
        if not isinstance(header[name], str):
            raise ValueError(f"the entry '{name}' of the header cannot be {header[name]!r}")
    for name in ("warnings", "warnings_there"):
        entries = header[name]
        if not isinstance(entries, dict):
            raise ValueError(f"the entry '{name}' of the header cannot be {entries!r}")
        for count in entries.values():
            check_count(f"a count in the entry '{name}' of the header", count)
    for name in ("counters", "method", "tolerances"):
        if not isinstance(header[name], dict):
            raise ValueError(f"the entry '{name}' of the header is not a mapping")
    for name, value in header["counters"].items():
        check_number(f"the count '{name}'", value, 0.0)
    if not (isinstance(header["cost"], list) and len(header["cost"]) == 2):
        raise ValueError("the cost is not a pair of numbers")
    for value in header["cost"]:
        check_number("a part of the cost", value, 0.0)
    taken_over = header.get("taken_over")
    if taken_over is not None:
        if not (isinstance(taken_over, list) and len(taken_over) == 2 and isinstance(taken_over[0], str)):
            raise ValueError(f"the name of the integrator that finished the run cannot be {taken_over!r}")
        check_number("the time at which another integrator took over", taken_over[1])
    kinds = header["kinds"]
    if not (isinstance(kinds, list) and all(isinstance(kind, str) for kind in kinds)):
        raise ValueError("the `kind` of a block is not a string")
    if header["save"] not in ("all", "events", "last-period", "nothing"):
        check_number("the save setting", header["save"], 0.0)
    retention = header["keep"]
    if not (isinstance(retention, list) and len(retention) == 2):
        raise ValueError("the `keep` setting is not a pair")
    for value in retention:
        if value is not None:
            check_number("a part of the retention", value, 0.0, is_finite=False)


def check_task(header: Header, arrays: Arrays, system: System) -> None:
    """Reject a time span, tolerances or a start that `simulate` would reject."""
    arguments.time_span(header["span"])
    tolerances = header["tolerances"]
    arguments.relative_tolerance(check_number("rtol", tolerances["rtol"]))
    arguments.step_bound(check_number("max_step", tolerances["max_step"], is_finite=False), "max_step")
    if tolerances["first_step"] is not None:
        arguments.step_bound(check_number("first_step", tolerances["first_step"]), "first_step")
    check_forms("the start", arrays, _TASK, sizes_of(system))
    check_finite("the start", arrays["x0"], arrays["discrete"], arrays["atol"])
    check_range("atol", arrays["atol"], 0.0, math.inf)
    check_modes("the start", arrays["z0"], mode_counts(system), lowest=-1)
    if "grid" in arrays:
        check_forms("the grid", arrays, {"grid": (float, ("grid",))}, {})
        check_finite("a time of the grid", arrays["grid"])


def check_events(events: Arrays, hidden: object, system: System) -> None:
    """Reject events whose components or modes the model does not have."""
    lengths: dict[str, Form] = {
        "instants": (float, ("E", 2)),
        "directions": (np.int64, ("E",)),
        "x_minus": (float, ("E", "n")),
        "x_plus": (float, ("E", "n")),
    }
    known = check_forms("the events", events, lengths, sizes_of(system))
    texts = events.get("words")
    if texts is None or texts.dtype.kind != "U" or texts.shape != (known["E"], 5):
        raise ValueError("an event does not have five texts")
    check_count("the number of events that are not shown", hidden, known["E"])
    check_finite("the time of an event", events["instants"])
    check_range("the direction of an event", events["directions"], -1, 1)
    modes = {a.name: {*a.modes} for a in system.automata}
    kinds = {a.name: {a.kind, "near-grazing"} for a in system.automata}
    for monitor in system.monitor_names:
        kinds.setdefault(monitor, set()).add("monitor")
    for schedule in system.model.schedules:
        kinds.setdefault(schedule.name, set()).add("scheduled")
    for kind, component, _, source, target in {tuple(row) for row in texts.tolist()}:
        if kind not in kinds.get(component, ()):
            raise ValueError(f"there is no {kind} of {component!r} in the model")
        if component in modes and kind != "monitor" and not {source, target} <= modes[component]:
            raise ValueError(f"{component} has no mode {source!r} or {target!r}")


def check_checkpoint(header: Header, arrays: Arrays, system: System, span: tuple[float, float]) -> None:
    """Reject a checkpoint that a run of this system cannot have written."""
    high, low = check_instant("the checkpoint", header["instant"])
    if not min(span) <= high + low <= max(span):
        raise ValueError("the checkpoint is outside of t_span")
    if header["settled"] is not None:
        check_instant("the settled instant", header["settled"])
    for name in ("segments", "occurrences"):
        check_count(f"the checkpoint's number of {name}", header[name])
    if not isinstance(header["paces"], list):
        raise ValueError("the checkpoint's event rates are not a list")
    for row in header["paces"]:
        _check_pace(row, len(system.automata))
    if not isinstance(header["names"], list) or sorted(map(str, header["names"])) != sorted(arrays):
        raise ValueError("the names of the checkpoint do not match its arrays")
    sizes = sizes_of(system)
    if set(arrays) >= set(_AFTER_STEPS):
        check_forms("the checkpoint", arrays, _AFTER_STEPS, sizes)
        check_finite("the checkpoint", arrays["x"], arrays["discrete"], arrays["scale"])
    else:
        check_forms("the checkpoint", arrays, _AFTER_EVENT, sizes)
        check_finite("the checkpoint", arrays["x"])
        for name in ("x_error", "guard_floors", "monitor_floors"):
            check_range(f"{name} of the checkpoint", arrays[name], 0.0, math.inf)
        for name in ("sides", "monitor_sides"):
            check_range(f"{name} of the checkpoint", arrays[name], -1, 1)
        for name in ("orders", "monitor_orders"):
            check_range(f"{name} of the checkpoint", arrays[name], 0, ORDER + 1)
        step = float(arrays["step_size"])
        if not (math.isnan(step) or 0.0 < step < math.inf):
            raise ValueError(f"the next step of the checkpoint cannot be {step!r}")
        if "headway" in arrays:
            check_forms("the checkpoint", arrays, {"headway": (float, (HEADWAY_SIZE,))}, {})
            if (
                np.isnan(arrays["headway"]).any()
                or np.isinf(np.delete(arrays["headway"], HEADWAY_PACE)).any()
            ):
                raise ValueError("a speed measured during the run is not finite in the checkpoint")
        if "taken_over" in arrays:
            check_forms("the checkpoint", arrays, {"taken_over": (float, ())}, {})
            check_finite("the time of a change of method", arrays["taken_over"])
        if "place" in arrays:
            check_forms("the checkpoint", arrays, {"place": (float, ("numbers",))}, {})
    check_modes("the checkpoint", arrays["z"], mode_counts(system))


def _check_pace(row: object, components: int) -> None:
    entry = "the pace of a component"
    if not (isinstance(row, list) and len(row) == 2 and isinstance(row[1], list) and len(row[1]) == 5):
        raise ValueError(f"{entry} cannot be {row!r}")
    component, (last, intervals, longest, forecast, steadiest) = row
    if type(component) is not int or not _NOBODY <= component < components:
        raise ValueError(f"{entry} refers to the unknown component {component!r}")
    if last is not None:
        check_instant(entry, last)
    if not isinstance(intervals, list) or len(intervals) > _MOST_INTERVALS:
        raise ValueError(f"{entry} has invalid intervals: {intervals!r}")
    for value in (*intervals, longest):
        check_number(entry, value, 0.0)
    for values, count in ((forecast, 2), (steadiest, 3)):
        if values is None:
            continue
        if not isinstance(values, list) or len(values) != count:
            raise ValueError(f"{entry} cannot be {values!r}")
        for value in values:
            check_number(entry, value, is_finite=False)
