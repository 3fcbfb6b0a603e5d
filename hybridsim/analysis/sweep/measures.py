"""This module chooses the measure of a sweep: a user's function, or a built-in measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.keyword_options import refuse_what_it_does_not_take
from hybridsim.analysis.sweep.named_measures import named_measure
from hybridsim.analysis.sweep.work.job import Measure
from hybridsim.arguments import cannot_be, is_row
from hybridsim.model import Model


@dataclass(frozen=True)
class UserFunction:
    """A measure defined by a user's function of the model and, with `warm_start`, of the previous result."""

    function: Callable[..., Any]
    options: Mapping[str, Any]
    chained: bool

    def run(self, model: Model, previous: Any) -> Any:
        """Call the user's function at one point."""
        if self.chained:
            return self.function(model, previous, **self.options)
        return self.function(model, **self.options)

    def read(self, result: Any) -> Any:
        """Return the result unchanged."""
        return result


def measure_of(measure: Any, model: Model, chained: bool, options: Mapping[str, Any]) -> Measure:
    """Return the measure that the argument `measure` of `sweep` describes."""
    if callable(measure):
        refuse_what_it_does_not_take(measure, options)
        return UserFunction(measure, options, chained)
    if isinstance(measure, str):
        return named_measure(measure, model, options)
    names = tuple(measure) if is_row(measure) else ()
    if names and all(isinstance(word, str) for word in names):
        return named_measure(names, model, options)
    raise cannot_be("measure", measure, "use a function of the model, or the name of a built-in measure")
