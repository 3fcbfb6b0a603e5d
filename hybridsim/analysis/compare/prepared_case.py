"""This module prepares one model for the runs of a comparison and for the run of its reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from hybridsim.analysis.compare.comparison import Comparison
from hybridsim.analysis.compare.lines import Series
from hybridsim.analysis.compare.reference import Reference
from hybridsim.analysis.compare.regularised import as_set_valued
from hybridsim.analysis.compare.rows import STOPPED, Cost, Row
from hybridsim.analysis.compare.trajectory import trajectory_of
from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.time_budget import OutOfTime, TimeBudget
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model
from hybridsim.simulate import simulate
from hybridsim.solution import Solution


@dataclass(frozen=True)
class PreparedCase:
    """One model with its time span and initial values, ready for many runs.

    Parameters
    ----------
    model : the model with its parameters and initial values.
    t_span, period : the span of the runs; the period of the forcing or None.
    """

    model: Model
    t_span: tuple[float, float]
    period: float | None
    _forms: dict[tuple[str, float], Model] = field(default_factory=dict, repr=False, compare=False)

    def simulate(self, integrator: str, *, model: Model | None = None, **options: Any) -> Solution:
        """Run the model, or its regularised form, with an integrator."""
        return simulate(model or self.model, self.t_span, integrator=integrator, **options)

    def call(self, line: Series, value: float) -> Callable[[], Solution]:
        """Return a function that makes one run of a series at one setting, so that the run can be timed."""
        model, options = self._form(line, value), line.options_at(value)
        return lambda: self.simulate(line.integrator, model=model, **options)

    def first_run(self, line: Series, value: float, reference: Reference, limit: float = math.inf) -> Row:
        """Make the first run without timing, and return a row with the errors and counts of the run.

        Parameters
        ----------
        limit : seconds after which it is stopped; compiling does not count.
        """
        options = line.options_at(value)
        row = Row(line.integrator, line.label, (line.varied, value), options, "failed", form=line.regularized)
        watch = TimeBudget(limit) if limit < math.inf else None
        try:
            solution = self.simulate(
                line.integrator, model=self._form(line, value), progress=watch, **options
            )
            if not solution.success:
                return replace(row, status=solution.status, message=solution.message)
            found = trajectory_of(solution)
            if line.regularized:
                found = as_set_valued(found, {contact.name for contact in self.model.contacts})
            errors = reference.yardstick.measure(found)
        except OutOfTime as late:
            return replace(row, status=STOPPED, message=str(late))
        except HybridsimError as error:
            return replace(
                row, status="refused" if isinstance(error, UsageError) else "failed", message=error.message
            )
        except Exception as error:  # A third-party integrator may raise anything; it costs its own row only.
            return replace(row, message=f"{type(error).__name__}: {error}")
        stats = solution.stats
        rhs, guards, steps = (int(stats[name]) for name in ("rhs_evaluations", "guard_evaluations", "steps"))
        cost = Cost((float(stats["wall_time"]),), rhs, guards, steps, float(stats["compile_time"]))
        return replace(row, status=solution.status, errors=errors, cost=cost)

    def comparison(self, reference: Reference, rows: Sequence[Row], repeat: int) -> Comparison:
        """Return the rows as a comparison."""
        return Comparison(
            title=f"{self.model.name}: {self.model.title}" if self.model.title else self.model.name,
            t_span=self.t_span,
            period=self.period,
            reference=reference.title,
            uncertainty=reference.uncertainty,
            rows=tuple(rows),
            repeat=repeat,
            provenance=provenance(self.model),
            warnings=reference.warnings,
            second_reference=reference.second,
            difference=reference.difference,
        )

    def _form(self, line: Series, value: float) -> Model | None:
        """Return the regularised model of a series, or None if the series uses the model itself."""
        if not line.regularized:
            return None
        key = (line.regularized, value)
        if key not in self._forms:
            self._forms[key] = self.model.regularized(line.regularized, v0=value)
        return self._forms[key]
