"""The trials of random models by name; each yields what is not as it should be for one number of a structure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from .quotients import poles
from .reactions import reactions
from .slopes import linearizations
from .steady import steady_states
from .stepped import time_stepping
from .structures import mechanical_systems, moving_bases, repeated_runs

QUIET = ("agrees", "names refused", "unclear", "cannot", "no model", "warned of")

DRAWS = 5  # sets of numbers of a structure

Trial = Callable[[int], Iterator[dict[str, Any]]]


def whole_models(number: int) -> Iterator[dict[str, Any]]:
    """A structure of the generator with a few sets of numbers; a run that takes its time is no finding."""
    from . import compare
    from .trial import trials

    compare.LIMITS = {"steps": 4000, "events": 500}

    for record in trials(number, DRAWS):
        if record["kind"] not in QUIET and record.get("status") != "limit":
            yield record


TRIALS: dict[str, Trial] = {
    "whole models": whole_models,
    "steady states": steady_states,
    "linearizations": linearizations,
    "poles": poles,
    "reactions": reactions,
    "mechanical systems": mechanical_systems,
    "moving bases": moving_bases,
    "repeated runs": repeated_runs,
    "time stepping": time_stepping,
}
